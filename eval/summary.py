"""The numbers of a report, each a pure function of the records."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ehar.arrays import FloatArray
from ehar.errors import DataError
from eval.metrics import ACC_AT, acc_at, ece, gap_closed, mean_acc, nll, path_length
from eval.records import EpisodeRecords
from eval.statistics import interval, resample_counts, resampled_means

NO_ACT, ORACLE = "no-act", "oracle"  # the two ends of the gap
BOOTSTRAP_SEED = 0  # intervals are properties of the records, not of a run

Interval = tuple[float, float]


@dataclass(frozen=True)
class PlannerSummary:
    """How well one planner did.

    Args:
        name: the planner's.
        privileged: whether it was handed the truth.
        acc: accuracy [%] after 10 to 100 % of the frames.
        acc_mean: accuracy [%], the mean over all frames.
        acc_mean_ci95: its 95 % interval, bootstrap over sequences.
        gap_closed: the share of the way from no-act to the oracle; None where one of them was not run, or the
            oracle was no better.
        gap_closed_ci95: its 95 % interval.
        nll: mean negative log-likelihood of the true class [nat].
        ece: expected calibration error, 0 to 1.
        path_length_m: mean distance travelled in an episode [m].
        step_ms: planning time of one frame of one episode [ms]; the one number that is not in the records.
    """

    name: str
    privileged: bool
    acc: dict[str, float]
    acc_mean: float
    acc_mean_ci95: Interval
    gap_closed: float | None
    gap_closed_ci95: Interval | None
    nll: float
    ece: float
    path_length_m: float
    step_ms: float


@dataclass(frozen=True)
class Summary:
    """How well each planner did on the same episodes; what follows `planners` is for titles and stays unwritten."""

    data: str
    sensor: str
    views: str
    track: str
    episodes: int
    planners: tuple[PlannerSummary, ...]
    sequences: int
    length: int
    form: str

    def to_json(self) -> dict[str, Any]:
        """Return what summary.json holds."""
        return {name: value for name, value in asdict(self).items() if name not in ("sequences", "length", "form")}

    def planner(self, name: str) -> PlannerSummary:
        """Return the summary of one planner, by name."""
        return next(planner for planner in self.planners if planner.name == name)


@dataclass(frozen=True)
class Conditions:
    """Under which conditions records were made: what a summary says beside its numbers."""

    data: str
    sensor: str
    views: str
    track: str
    form: str


def summarise(
    records: Mapping[str, EpisodeRecords],
    conditions: Conditions,
    *,
    privileged: Mapping[str, bool],
    step_ms: Mapping[str, float],
) -> Summary:
    """Compute a summary from the records of planners that ran the same episodes.

    Raises:
        DataError: there are no records, or the planners' episodes differ.
    """
    if not records:
        raise DataError("expected the records of at least one planner, got none")
    reference = next(iter(records.values()))
    for name, episodes in records.items():
        _check_same_episodes(name, episodes, reference)
    sequences, clusters = np.unique(reference.sequence, return_inverse=True)
    accuracy = np.stack([mean_acc(episodes.correct) for episodes in records.values()])
    counts = resample_counts(np.random.default_rng(BOOTSTRAP_SEED), len(sequences))
    resampled = resampled_means(accuracy, clusters, counts)
    acc_ends = 100 * interval(resampled)
    gaps, gap_ends = _gaps(list(records), accuracy.mean(axis=1), resampled)
    planners = tuple(
        PlannerSummary(
            name=name,
            privileged=privileged[name],
            acc={str(percent): 100 * acc_at(episodes.correct, percent) for percent in ACC_AT},
            acc_mean=100 * float(accuracy[row].mean()),
            acc_mean_ci95=_pair(acc_ends[row]),
            gap_closed=float(gaps[row]) if np.isfinite(gaps[row]) else None,
            gap_closed_ci95=_pair(gap_ends[row]) if np.isfinite(gaps[row]) else None,
            nll=nll(episodes.true_probability),
            ece=ece(episodes.top_probability, episodes.correct),
            path_length_m=float(path_length(episodes.viewpoint).mean()),
            step_ms=step_ms[name],
        )
        for row, (name, episodes) in enumerate(records.items())
    )
    return Summary(
        data=conditions.data,
        sensor=conditions.sensor,
        views=conditions.views,
        track=conditions.track,
        episodes=len(reference),
        planners=planners,
        sequences=len(sequences),
        length=reference.predicted.shape[1],
        form=conditions.form,
    )


def _gaps(names: list[str], acc: FloatArray, resampled: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return gap closed (planners,) and its intervals (planners, 2); NaN without both ends of the gap."""
    if NO_ACT not in names or ORACLE not in names:
        return np.full(len(names), np.nan), np.full((len(names), 2), np.nan)
    low, high = names.index(NO_ACT), names.index(ORACLE)
    return gap_closed(acc, acc[low], acc[high]), interval(gap_closed(resampled, resampled[low], resampled[high]))


def _pair(ends: FloatArray) -> Interval:
    return float(ends[0]), float(ends[1])


def _check_same_episodes(name: str, episodes: EpisodeRecords, reference: EpisodeRecords) -> None:
    """Raise a DataError unless a planner ran the reference's episodes, in the same order."""
    same = episodes.sequence == reference.sequence and all(
        np.array_equal(getattr(episodes, field), getattr(reference, field)) for field in ("first", "start", "label")
    )
    if not same:
        raise DataError(f"planner {name!r}: expected the same {len(reference)} episodes as the planner before it")
