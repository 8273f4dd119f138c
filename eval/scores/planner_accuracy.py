"""The accuracy of planners in the forms that comparisons need: by sequence, by episode and in shared resamples."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ehar.arrays import FloatArray, IntArray
from eval.records.episodes import EpisodeRecords
from eval.scores.metrics import mean_acc
from eval.scores.resampling.resamples import Resamples, resample_episodes
from eval.scores.resampling.statistics import why_no_intervals
from eval.scores.resampling.training_seeds import (
    PlannerGroup,
    curves,
    families,
    group_planners,
    resample_seeds,
    seed_counts,
)
from eval.scores.sequence_scores import accuracy_by_sequence


@dataclass(frozen=True, eq=False)
class PlannerAccuracy:
    """The accuracy of the G trainings of a planner; without training seeds G is 1.

    Args:
        name: name of the planner.
        mean: accuracy, 0 to 1, the mean over all frames and trainings.
        resampled: (rows,), the same in every row of the resamples, which draw people, sequences and trainings.
        by_sequence: (G, S), the accuracy of each training in each sequence.
        draws: (rows, G), how often each training is drawn in each row.
    """

    name: str
    mean: float
    resampled: FloatArray
    by_sequence: FloatArray
    draws: IntArray


def draw_resamples(records: Sequence[EpisodeRecords], groups: Iterable[PlannerGroup]) -> Resamples:
    """Draw the resamples for the records of planners that ran the same episodes.

    Args:
        records: records of every planner and training.
        groups: the planners whose trainings are drawn.
    """
    reference = records[0]
    classes = np.unique(np.concatenate([reference.label, *(episodes.predicted.ravel() for episodes in records)]))
    why_none = why_no_intervals(len(set(reference.sequence)), len(classes))
    resamples = resample_episodes(np.array(reference.sequence), reference.subjects, why_none=why_none)
    return resamples.with_trainings(families(groups))


def planner_accuracy(
    group: PlannerGroup, records: Mapping[str, EpisodeRecords], resamples: Resamples
) -> PlannerAccuracy:
    """Return the accuracy of one planner, whose trainings the resamples draw."""
    correct = [records[name].correct for name in group.records]
    accuracy = np.stack([mean_acc(right) for right in correct])
    alone = replace(group, rows=tuple(range(len(correct))))
    return PlannerAccuracy(
        name=group.name,
        mean=float(accuracy.mean(axis=1).mean()),
        resampled=resample_seeds(resamples.means(accuracy), [alone], resamples)[0],
        by_sequence=np.stack([accuracy_by_sequence(right, resamples.clusters) for right in correct]),
        draws=seed_counts(group, resamples),
    )


def accuracy_bands(records: Mapping[str, EpisodeRecords], resamples: Resamples) -> dict[str, FloatArray]:
    """Return the interval of each planner's accuracy after each frame, (L, 2), 0 to 1; NaN without resamples.

    Each frame's interval holds for that frame, not for the curve as a whole. The curves are those of
    `eval.scores.resampling.training_seeds.curves`, and the resamples are those of a summary's intervals.

    Args:
        records: records on the same episodes, by record name.
        resamples: resamples of their people and sequences.
    """
    bands = {}
    for group, curve in zip(group_planners(records), curves(records).values(), strict=True):
        alone = group_planners(group.records)
        by_frame = [records[name].correct.T.astype(np.float64) for name in group.records]
        resampled = [resamples.means(values) for values in by_frame]
        drawn = [resample_seeds(np.stack(trainings), alone, resamples)[0] for trainings in zip(*resampled, strict=True)]
        bands[group.name] = resamples.interval(curve, np.stack(drawn), bounds=(0, 1))
    return bands
