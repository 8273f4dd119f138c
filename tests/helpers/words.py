import numpy as np

from ehar.arrays import BoolArray, FloatArray
from eval.scores.deciding.rules import Words


def words_of(probabilities: FloatArray, shown: BoolArray | None = None) -> Words:
    """Return what is said by the probabilities of all classes (B, T, K), after each frame of each activity.

    `shown` says whether the activity has that frame; None means all.
    """
    ordered = np.sort(probabilities, axis=-1)
    mask = np.ones(probabilities.shape[:2], dtype=np.bool_) if shown is None else shown
    return Words(probabilities.argmax(axis=-1), ordered[..., -1], ordered[..., -2], mask)
