"""Groups the trainings of one planner, which a report shows in one row.

Trainings differ in their seed and enter a run as separate planners, `il-ppo/0`, `il-ppo/1`, ... All of them run the
same episodes. A report shows the mean over trainings. Its interval says what other sequences and other trainings would
give: each resample draws both.

Trainings of what all planners share, the recogniser and the gain field, are `nbv@0`, `nbv@1`, ... in a run that was
made of theirs. A resample draws the same ones for all planners. Trainings that are drawn together are a family.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.errors import DataError
from eval.records.episodes import EpisodeRecords
from eval.scores.resampling.resamples import Resamples

OWN, SHARED = "/", "@"  # before the number of a training in record names: the planner's own, or that of all planners
_RECORD_NAME = re.compile(rf"(.+)([{OWN}{SHARED}])(0|[1-9][0-9]*)")


@dataclass(frozen=True)
class PlannerGroup:
    """The trainings of one planner among M record names; a planner without training seed is a group of one.

    Args:
        name: name of the planner, without seeds.
        seeds: G training seeds in ascending order; empty for a planner whose name has none.
        records: its record names, in the order of the seeds.
        rows: indices of its record names among all M.
        family: whose trainings a resample draws together: `SHARED` of what all planners share, else the planner's
            name; None if there is only one training, which is not drawn.
    """

    name: str
    seeds: tuple[int, ...]
    records: tuple[str, ...]
    rows: tuple[int, ...]
    family: str | None = None


def record_name(name: str, seed: int) -> str:
    """Return the record name of a planner that was trained with a seed: `il-ppo/0`."""
    return f"{name}{OWN}{seed}"


def shared_record_name(name: str, training: int) -> str:
    """Return the record name of a planner with a training of what all planners share: `nbv@0`."""
    return f"{name}{SHARED}{training}"


def split_record_name(name: str) -> tuple[str, int | None]:
    """Return a planner's name and training seed; the seed is None if the name has none."""
    match = _RECORD_NAME.fullmatch(name)
    return (name, None) if match is None else (match[1], int(match[3]))


def is_shared(name: str) -> bool:
    """Return whether a record name is one of `shared_record_name`."""
    match = _RECORD_NAME.fullmatch(name)
    return match is not None and match[2] == SHARED


def families(groups: Iterable[PlannerGroup]) -> dict[str, int]:
    """Return how many trainings each family has, for `Resamples.with_trainings`."""
    return {group.family: len(group.records) for group in groups if group.family is not None}


def group_planners(names: Iterable[str]) -> tuple[PlannerGroup, ...]:
    """Return the planners behind record names, each once, in the order in which they first appear.

    Raises:
        DataError: a planner has records both with and without a training seed.
    """
    found: dict[str, list[tuple[int | None, str, int]]] = {}
    for row, record in enumerate(names):
        name, seed = split_record_name(record)
        found.setdefault(name, []).append((seed, record, row))
    groups = []
    for name, trainings in found.items():
        seeds = [seed for seed, _, _ in trainings if seed is not None]
        if seeds and len(seeds) < len(trainings):
            got = ", ".join(record for _, record, _ in trainings)
            raise DataError(f"planner {name!r}: expected every record name with a training seed, or none, got {got}")
        ordered = sorted(trainings, key=lambda training: -1 if training[0] is None else training[0])
        groups.append(
            PlannerGroup(
                name=name,
                seeds=tuple(sorted(seeds)),
                records=tuple(record for _, record, _ in ordered),
                rows=tuple(row for _, _, row in ordered),
                family=None if len(ordered) == 1 else SHARED if is_shared(ordered[0][1]) else name,
            )
        )
    return tuple(groups)


def first_trainings(names: Iterable[str]) -> dict[str, str]:
    """Return the record name of each planner's first training, by the planner's own name."""
    return {group.name: group.records[0] for group in group_planners(names)}


def mean_over_seeds(values: FloatArray, groups: Sequence[PlannerGroup]) -> FloatArray:
    """Return the mean of each planner's trainings, (P, ...) from (M, ...)."""
    means: FloatArray = np.stack([values[list(group.rows)].mean(axis=0) for group in groups])
    return means


def seed_counts(group: PlannerGroup, resamples: Resamples) -> IntArray:
    """Return how often each of a planner's G trainings is drawn in each row of the resamples, (rows, G).

    In rows that draw something else alone, each training is there once.
    """
    if group.family is None:
        return np.ones((len(resamples.counts), 1), dtype=np.int64)
    return resamples.trainings[group.family]


def resample_seeds(resampled: FloatArray, groups: Sequence[PlannerGroup], resamples: Resamples) -> FloatArray:
    """Return the mean over drawn trainings in every row, (P, rows); a single training is not drawn.

    Like every bootstrap, one over G seeds sees (G - 1) / G of the variance between them: half of it with two seeds.
    `Resamples.interval` makes up for that.

    Args:
        resampled: (M, rows), a statistic of each training in resamples of episodes, which all of them share.
        groups: P planners.
        resamples: these resamples.
    """
    drawn = np.empty((len(groups), resampled.shape[1]))
    for row, group in enumerate(groups):
        trainings = resampled[list(group.rows)]
        if len(trainings) > 1:
            drawn[row] = (seed_counts(group, resamples).T * trainings).sum(axis=0) / len(trainings)
        else:
            drawn[row] = trainings[0]
    return drawn


def curves(records: Mapping[str, EpisodeRecords]) -> dict[str, FloatArray]:
    """Return the accuracy after each frame, (L,), 0 to 1, of every planner: the mean over its trainings."""
    groups = group_planners(records)
    accuracy = np.stack([episodes.correct.mean(axis=0) for episodes in records.values()])
    return {group.name: curve for group, curve in zip(groups, mean_over_seeds(accuracy, groups), strict=True)}
