"""The accuracy of a planner over its trainings, as in the paper's Table 3, and their records together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from eval.records.episodes import EpisodeRecords, join_records
from eval.records.one_by_one import OneByOne
from eval.scores.metrics import acc_at, mean_acc
from eval.scores.resampling.training_seeds import group_planners

TABLE_3 = (  # the paper's rows: without the embeddings of f^A, without f^V, without f^P, with everything
    "il-ppo-no-embedding",
    "il-ppo-no-log-probs",  # what f^A is told here beside embeddings, one by one, and all of f^A's inputs
    "il-ppo-no-time",
    "il-ppo-no-recognition",
    "il-ppo-no-vision",
    "il-ppo-no-position",
    "il-ppo",
)
TABLE_3_AT = (10, 50, 100)  # the observation ratios of Table 3 [%]


class Spread(NamedTuple):
    """A number over training seeds: its mean, and its standard deviation (n - 1); None with one seed."""

    mean: float
    std: float | None


@dataclass(frozen=True)
class SeedAccuracy:
    """The accuracy of one planner's trainings.

    Args:
        name: name of the planner.
        seeds: number of trainings.
        acc: accuracy [%] after some shares of the frames, by percent.
        acc_mean: accuracy [%], the mean over all frames.
    """

    name: str
    seeds: int
    acc: dict[str, Spread]
    acc_mean: Spread


def seeds_of(records: Mapping[str, EpisodeRecords]) -> dict[str, list[EpisodeRecords]]:
    """Return the records of each planner's trainings; a planner without seeds has one."""
    return {group.name: [records[name] for name in group.records] for group in group_planners(records)}


def pool_seeds(records: Mapping[str, EpisodeRecords]) -> Mapping[str, EpisodeRecords]:
    """Return the records of each planner, with its trainings one after another; they are made when asked for."""
    groups = {group.name: group.records for group in group_planners(records)}
    return OneByOne(list(groups), lambda name: join_records([records[record] for record in groups[name]]))


def accuracy_over_seeds(name: str, seeds: Sequence[EpisodeRecords], at: Sequence[int] = TABLE_3_AT) -> SeedAccuracy:
    """Return mean and standard deviation of the accuracies that trainings reached, after `at` % of the frames."""
    return SeedAccuracy(
        name=name,
        seeds=len(seeds),
        acc={str(percent): _spread([acc_at(run.correct, percent) for run in seeds]) for percent in at},
        acc_mean=_spread([float(mean_acc(run.correct).mean()) for run in seeds]),
    )


def _spread(shares: Sequence[float]) -> Spread:
    """Return the spread of shares, in percent."""
    std = float(100 * np.std(shares, ddof=1)) if len(shares) > 1 else None
    return Spread(float(100 * np.mean(shares)), std)
