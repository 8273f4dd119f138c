"""Which of the tracked bodies are kept: trackers follow more than there are people, in any order."""

import numpy as np

from ehar.arrays import FloatArray


def most_moving(motion: FloatArray, count: int) -> FloatArray | None:
    """Return the bodies that move most, in their order, (T, count, J, 3); None if there are fewer.

    How much a body moves is the variance of its joints' places over the frames that it is in, summed over axes and
    joints, as is usual for NTU RGB+D. A chair that a tracker takes for somebody moves little.

    Args:
        motion: (T, P, J, 3), NaN where a body is not seen.
        count: number of bodies to keep.
    """
    seen = np.flatnonzero(np.isfinite(motion).any(axis=(0, 2, 3)))
    if len(seen) < count:
        return None
    variance = np.ma.masked_invalid(motion[:, seen].astype(np.float64)).var(axis=0).filled(0)
    kept = np.sort(seen[np.argsort(-variance.sum(axis=(1, 2)), kind="stable")[:count]])
    return motion[:, kept]
