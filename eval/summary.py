"""The numbers of a report, each a pure function of the records."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.errors import DataError
from eval.flight_records import FlightSummary, flight_numbers, summarise_flights
from eval.metrics import ACC_AT, acc_at, ece, gap_closed, mean_acc, nll, path_length
from eval.records import EpisodeRecords
from eval.solves import Solves
from eval.statistics import interval, resample_counts, resampled_means

NO_ACT, ORACLE = "no-act", "oracle"  # the two ends of the gap
NBV = "nbv"  # compared with every other planner
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
        gap_closed: the share of the way from no-act to the oracle, that of the ideal track for flights which are
            compared with it; None where one of them was not run, or the oracle was no better.
        gap_closed_ci95: its 95 % interval.
        nll: mean negative log-likelihood of the true class [nat].
        ece: expected calibration error, 0 to 1.
        path_length_m: mean distance travelled in an episode [m].
        step_ms: planning time of one frame of one episode [ms]; like `solves` not in the records.
        flight: what its flights demanded of the vehicle; None on the ideal track.
        accuracy_kept: the gap closed in flight over that on the ideal track, both of the ideal track's gap, so that
            the oracle cancels: (acc in flight - acc of no-act) / (acc on the ideal track - acc of no-act), mean
            accuracies over frames. None without a run on the ideal track, or where the planner gained nothing there.
        accuracy_kept_ci95: its 95 % interval, over the resamples in which the planner gained on the ideal track.
        solves: what became of its plans; None for a planner that counts none.
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
    flight: FlightSummary | None = None
    accuracy_kept: float | None = None
    accuracy_kept_ci95: Interval | None = None
    solves: Solves | None = None

    def to_json(self) -> dict[str, Any]:
        """Return what summary.json holds: the same keys for every planner on every track, flat."""
        values = {name: value for name, value in asdict(self).items() if name not in ("flight", "solves")}
        return {
            **values,
            **flight_numbers(self.flight),
            "solves": None if self.solves is None else self.solves.counts,
            "fallback_share": None if self.solves is None else self.solves.fallback_share,
        }


@dataclass(frozen=True)
class Difference:
    """A paired difference: the same episodes, the same resamples.

    Args:
        planner: the one whose accuracy is the minuend.
        other: the one whose accuracy is taken away.
        acc_mean: the difference of their accuracies, the mean over all frames [percentage points].
        ci95: its 95 % interval, bootstrap over sequences.
    """

    planner: str
    other: str
    acc_mean: float
    ci95: Interval


@dataclass(frozen=True)
class Summary:
    """How well each planner did on the same episodes; what follows `differences` is for titles and stays unwritten.

    `differences` are those of `nbv` and every other planner that is not privileged; none without `nbv`.
    """

    data: str
    sensor: str
    views: str
    track: str
    readout: str
    episodes: int
    planners: tuple[PlannerSummary, ...]
    differences: tuple[Difference, ...]
    sequences: int
    length: int
    form: str

    def to_json(self) -> dict[str, Any]:
        """Return what summary.json holds."""
        written = ("data", "sensor", "views", "track", "readout", "episodes")
        return {
            **{name: getattr(self, name) for name in written},
            "planners": [planner.to_json() for planner in self.planners],
            "differences": [asdict(difference) for difference in self.differences],
        }

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
    readout: str


def summarise(
    records: Mapping[str, EpisodeRecords],
    conditions: Conditions,
    *,
    privileged: Mapping[str, bool],
    step_ms: Mapping[str, float],
    solves: Mapping[str, Solves | None] | None = None,
    on_ideal: Mapping[str, EpisodeRecords] | None = None,
) -> Summary:
    """Compute a summary from the records of planners that ran the same episodes.

    Args:
        records: of each planner.
        conditions: under which they were made.
        privileged: which planners were handed the truth.
        step_ms: planning time of each.
        solves: what became of the plans of those that count them.
        on_ideal: records of the same episodes on the ideal track, no-act among them; flights are compared with them.

    Raises:
        DataError: there are no records, or the planners' episodes differ.
    """
    if not records:
        raise DataError("expected the records of at least one planner, got none")
    reference = next(iter(records.values()))
    for name, episodes in records.items():
        _check_same_episodes(name, episodes, reference)
    for name, episodes in (on_ideal or {}).items():
        _check_same_episodes(f"{name} on the ideal track", episodes, reference)
    sequences, clusters = np.unique(reference.sequence, return_inverse=True)
    accuracy = np.stack([mean_acc(episodes.correct) for episodes in records.values()])
    counts = resample_counts(np.random.default_rng(BOOTSTRAP_SEED), len(sequences))
    resampled = resampled_means(accuracy, clusters, counts)
    acc_ends = 100 * interval(resampled)
    gaps, gap_ends = _gaps(list(records), accuracy, clusters, counts, on_ideal)
    kept, kept_ends = _kept(list(records), accuracy, clusters, counts, on_ideal)
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
            flight=None if episodes.flight is None else summarise_flights(episodes.flight),
            accuracy_kept=float(kept[row]) if np.isfinite(kept[row]) else None,
            accuracy_kept_ci95=_pair(kept_ends[row]) if np.isfinite(kept[row]) else None,
            solves=None if solves is None else solves[name],
        )
        for row, (name, episodes) in enumerate(records.items())
    )
    return Summary(
        data=conditions.data,
        sensor=conditions.sensor,
        views=conditions.views,
        track=conditions.track,
        readout=conditions.readout,
        episodes=len(reference),
        planners=planners,
        differences=_differences(list(records), privileged, accuracy.mean(axis=1), resampled),
        sequences=len(sequences),
        length=reference.predicted.shape[1],
        form=conditions.form,
    )


def _gaps(
    names: list[str],
    accuracy: FloatArray,
    clusters: IntArray,
    counts: IntArray,
    on_ideal: Mapping[str, EpisodeRecords] | None,
) -> tuple[FloatArray, FloatArray]:
    """Return gap closed (planners,) and its intervals (planners, 2); NaN without both ends of the gap.

    A flight's gap reaches up to the oracle on the ideal track where that was run: one that flies is no upper bound.
    """
    above = ORACLE in names or (on_ideal is not None and ORACLE in on_ideal)
    if NO_ACT not in names or not above:
        return np.full(len(names), np.nan), np.full((len(names), 2), np.nan)
    if on_ideal is not None and ORACLE in on_ideal:
        oracle = mean_acc(on_ideal[ORACLE].correct)
    else:
        oracle = accuracy[names.index(ORACLE)]
    rows = np.concatenate([accuracy, oracle[None]])
    means, resampled = rows.mean(axis=1), resampled_means(rows, clusters, counts)
    low = names.index(NO_ACT)
    closed = gap_closed(means[:-1], means[low], means[-1])
    return closed, interval(gap_closed(resampled[:-1], resampled[low], resampled[-1]))


def _kept(
    names: list[str],
    accuracy: FloatArray,
    clusters: IntArray,
    counts: IntArray,
    on_ideal: Mapping[str, EpisodeRecords] | None,
) -> tuple[FloatArray, FloatArray]:
    """Return accuracy kept (planners,) and its intervals (planners, 2); NaN without a run on the ideal track.

    Args:
        names: of the planners.
        accuracy: (planners, N) of each episode in flight.
        clusters: (N,) sequence of each episode.
        counts: of resamples.
        on_ideal: records on the ideal track.
    """
    kept, ends = np.full(len(names), np.nan), np.full((len(names), 2), np.nan)
    rows = [row for row, name in enumerate(names) if on_ideal is not None and name in on_ideal]
    if on_ideal is None or not rows:
        return kept, ends
    low, high = (
        np.stack([mean_acc(on_ideal[name].correct) for name in chosen])
        for chosen in ([NO_ACT] * len(rows), [names[row] for row in rows])
    )
    flown = accuracy[rows]
    kept[rows] = gap_closed(flown.mean(axis=1), low.mean(axis=1), high.mean(axis=1))
    ends[rows] = interval(gap_closed(*(resampled_means(values, clusters, counts) for values in (flown, low, high))))
    return kept, ends


def _differences(
    names: list[str], privileged: Mapping[str, bool], acc: FloatArray, resampled: FloatArray
) -> tuple[Difference, ...]:
    """Return what nbv has more than each planner without the truth; nothing where it was not run."""
    if NBV not in names:
        return ()
    nbv = names.index(NBV)
    return tuple(
        Difference(
            planner=NBV,
            other=name,
            acc_mean=100 * float(acc[nbv] - acc[row]),
            ci95=_pair(100 * interval(resampled[nbv] - resampled[row])),
        )
        for row, name in enumerate(names)
        if name != NBV and not privileged[name]
    )


def _pair(ends: FloatArray) -> Interval:
    return float(ends[0]), float(ends[1])


def _check_same_episodes(name: str, episodes: EpisodeRecords, reference: EpisodeRecords) -> None:
    """Raise a DataError unless a planner ran the reference's episodes, in the same order."""
    same = episodes.sequence == reference.sequence and all(
        np.array_equal(getattr(episodes, field), getattr(reference, field)) for field in ("first", "start", "label")
    )
    if not same:
        raise DataError(f"planner {name!r}: expected the same {len(reference)} episodes as the planner before it")
