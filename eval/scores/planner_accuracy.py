"""The accuracy of planners in the forms that comparisons need: by sequence, by episode and in shared resamples."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ehar.arrays import FloatArray, IntArray
from eval.records.episodes import EpisodeRecords
from eval.scores.metrics import mean_acc, right_at
from eval.scores.sequence_scores import accuracy_by_sequence
from eval.scores.statistics import (
    BOOTSTRAP_SEED,
    RESAMPLES,
    interval,
    resample_counts,
    resampled_means,
    why_no_intervals,
)
from eval.scores.training_seeds import PlannerGroup, group_planners, resample_seeds, seed_counts

TESTED_AT = 50  # the observation ratio of McNemar's test [%], chosen before any result was seen


@dataclass(frozen=True, eq=False)
class Resamples:
    """R resamples of S sequences, which all planners share; R is 0 if there can be no intervals.

    Args:
        clusters: (N,), the sequence of each episode, 0 to S - 1.
        counts: (R, S), how often each sequence is drawn.
        why_none: why R is 0, or None.
    """

    clusters: IntArray
    counts: IntArray
    why_none: str | None


@dataclass(frozen=True, eq=False)
class PlannerAccuracy:
    """The accuracy of the G trainings of a planner; without training seeds G is 1.

    Args:
        name: name of the planner.
        mean: accuracy, 0 to 1, the mean over all frames and trainings.
        resampled: (R,), the same in every resample of sequences and trainings.
        by_sequence: (G, S), the accuracy of each training in each sequence.
        draws: (R, G), how often each training is drawn in each resample.
        right: (N,), the share of trainings that are right in each episode after `TESTED_AT` % of its frames.
    """

    name: str
    mean: float
    resampled: FloatArray
    by_sequence: FloatArray
    draws: IntArray
    right: FloatArray


def resample_sequences(records: Sequence[EpisodeRecords]) -> Resamples:
    """Draw the resamples for the records of planners that ran the same episodes."""
    sequences, clusters = np.unique(records[0].sequence, return_inverse=True)
    classes = np.unique(np.concatenate([records[0].label, *(episodes.predicted.ravel() for episodes in records)]))
    why_none = why_no_intervals(len(sequences), len(classes))
    rng = np.random.default_rng(BOOTSTRAP_SEED)
    counts = resample_counts(rng, len(sequences), RESAMPLES if why_none is None else 0)
    return Resamples(clusters, counts, why_none)


def planner_accuracy(
    group: PlannerGroup, records: Mapping[str, EpisodeRecords], resamples: Resamples
) -> PlannerAccuracy:
    """Return the accuracy of one planner; its name seeds the draws of its trainings."""
    correct = [records[name].correct for name in group.records]
    accuracy = np.stack([mean_acc(right) for right in correct])
    means = resampled_means(accuracy, resamples.clusters, resamples.counts)
    alone = replace(group, rows=tuple(range(len(correct))))
    return PlannerAccuracy(
        name=group.name,
        mean=float(accuracy.mean(axis=1).mean()),
        resampled=resample_seeds(means, [alone])[0],
        by_sequence=np.stack([accuracy_by_sequence(right, resamples.clusters) for right in correct]),
        draws=seed_counts(group.name, len(correct), len(resamples.counts)),
        right=np.mean([right_at(right, TESTED_AT) for right in correct], axis=0),
    )


def accuracy_bands(records: Mapping[str, EpisodeRecords], resamples: Resamples) -> dict[str, FloatArray]:
    """Return the interval of each planner's accuracy after each frame, (L, 2), 0 to 1; NaN without resamples.

    Each frame's interval holds for that frame, not for the curve as a whole. The curves are those of
    `eval.scores.training_seeds.curves`, and the resamples are those of a summary's intervals.

    Args:
        records: records on the same episodes, by record name.
        resamples: resamples of their sequences.
    """
    bands = {}
    for group in group_planners(records):
        alone = group_planners(group.records)
        by_frame = [records[name].correct.T.astype(np.float64) for name in group.records]
        resampled = [resampled_means(values, resamples.clusters, resamples.counts) for values in by_frame]
        drawn = [resample_seeds(np.stack(of_frame), alone)[0] for of_frame in zip(*resampled, strict=True)]
        bands[group.name] = interval(np.stack(drawn))
    return bands
