"""How sure accuracy curves are: 95 % intervals of the accuracy after each frame."""

from collections.abc import Mapping

import numpy as np

from ehar.arrays import FloatArray
from eval.records.episodes import EpisodeRecords
from eval.scores.planner_accuracy import Resamples
from eval.scores.statistics import interval, resampled_means
from eval.scores.training_seeds import group_planners, resample_seeds


def accuracy_bands(records: Mapping[str, EpisodeRecords], resamples: Resamples) -> dict[str, FloatArray]:
    """Return the interval of each planner's accuracy after each frame, (L, 2), 0 to 1; NaN without resamples.

    Each frame's interval holds for that frame, not for the curve as a whole. The curves are those of
    `eval.scores.training_seeds.curves`, and what is drawn is drawn as for the intervals of a summary.

    Args:
        records: by record name, on the same episodes.
        resamples: of their sequences.
    """
    bands = {}
    for group in group_planners(records):
        alone = group_planners(group.records)
        by_frame = [records[name].correct.T.astype(np.float64) for name in group.records]
        resampled = [resampled_means(values, resamples.clusters, resamples.counts) for values in by_frame]
        drawn = [resample_seeds(np.stack(of_frame), alone)[0] for of_frame in zip(*resampled, strict=True)]
        bands[group.name] = interval(np.stack(drawn))
    return bands
