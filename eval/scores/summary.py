"""The numbers of a report, each a pure function of the records."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.data.scenario import TEST
from ehar.errors import DataError
from eval.records.episodes import EpisodeRecords
from eval.records.flights import FlightSummary, flight_numbers, join_flights, summarise_flights
from eval.records.solves import Solves, join_solves
from eval.scores.differences import Difference, differences
from eval.scores.metrics import ACC_AT, acc_at, ece, gap_closed, mean_acc, nll, path_length
from eval.scores.planner_accuracy import planner_accuracy, resample_sequences
from eval.scores.sequence_scores import interquartile_mean, resampled_interquartile_means
from eval.scores.statistics import Interval, interval, pair, resampled_means
from eval.scores.training_seeds import PlannerGroup, group_planners, mean_over_seeds, resample_seeds

NO_ACT, ORACLE = "no-act", "oracle"  # the two ends of the gap


@dataclass(frozen=True)
class PlannerSummary:
    """How well one planner did; of one that was trained with several seeds every number is the mean over them.

    Args:
        name: the planner's, without seeds.
        privileged: whether it was handed the truth.
        training_seeds: which it was trained with, in ascending order; empty for a planner that names none.
        acc: accuracy [%] after 10 to 100 % of the frames.
        acc_mean: accuracy [%], the mean over all frames.
        acc_mean_ci95: its 95 % interval, bootstrap over sequences and, where there are several, training seeds; None,
            like all intervals, where they cannot be had.
        acc_mean_seed_sd: standard deviation (ddof 1) of `acc_mean` over training seeds [percentage points]; None below
            two seeds.
        acc_iqm: accuracy [%], the interquartile mean over sequences and training seeds, each sequence counting once.
        acc_iqm_ci95: its 95 % interval.
        gap_closed: the share of the way from no-act to the oracle, that of the ideal track for flights which are
            compared with it; None where one of them was not run, or the oracle was no better.
        gap_closed_ci95: its 95 % interval.
        nll: mean negative log-likelihood of the true class [nat].
        ece: expected calibration error, 0 to 1; each training's own, so that their errors do not cancel.
        path_length_m: mean distance travelled in an episode [m].
        step_ms: planning time of one frame of one episode [ms]; like `solves` not in the records.
        flight: what its flights demanded of the vehicle, those of all seeds; None on the ideal track.
        accuracy_kept: the gap closed in flight over that on the ideal track, both of the ideal track's gap, so that
            the oracle cancels: (acc in flight - acc of no-act) / (acc on the ideal track - acc of no-act), mean
            accuracies over frames. None without a run of each of its seeds on the ideal track, or where the planner
            gained nothing there.
        accuracy_kept_ci95: its 95 % interval, over the resamples in which the planner gained on the ideal track.
        solves: what became of its plans, those of all seeds; None for a planner that counts none.
    """

    name: str
    privileged: bool
    training_seeds: tuple[int, ...]
    acc: dict[str, float]
    acc_mean: float
    acc_mean_ci95: Interval | None
    acc_mean_seed_sd: float | None
    acc_iqm: float
    acc_iqm_ci95: Interval | None
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
class Summary:
    """How well each planner did on the same episodes; what follows `differences` is for titles and stays unwritten.

    `differences` are those of `differences.SUBJECTS` and every other planner that is not privileged; `no_intervals`
    says why intervals cannot be had, None where they can.
    """

    data: str
    sensor: str
    views: str
    track: str
    readout: str
    episodes: int
    no_intervals: str | None
    planners: tuple[PlannerSummary, ...]
    differences: tuple[Difference, ...]
    sequences: int
    length: int
    form: str
    part: str

    def to_json(self) -> dict[str, Any]:
        """Return what summary.json holds."""
        written = ("data", "sensor", "views", "track", "readout", "episodes", "no_intervals")
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
    part: str = TEST


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
        records: by record name; trainings of one planner, `il-ppo/0`, `il-ppo/1`, ..., are summarised as one.
        conditions: under which they were made.
        privileged: which planners were handed the truth, by record name.
        step_ms: planning time of each, by record name.
        solves: what became of the plans of those that count them, by record name.
        on_ideal: records of the same episodes on the ideal track, no-act among them; flights are compared with them.

    Raises:
        DataError: there are no records, the planners' episodes differ, or one has records with and without a seed.
    """
    if not records:
        raise DataError("expected the records of at least one planner, got none")
    reference = next(iter(records.values()))
    for name, episodes in records.items():
        _check_same_episodes(name, episodes, reference)
    for name, episodes in (on_ideal or {}).items():
        _check_same_episodes(f"{name} on the ideal track", episodes, reference)
    groups = group_planners(records)
    trainings = [[records[name] for name in group.records] for group in groups]
    resamples = resample_sequences(list(records.values()))
    clusters, counts = resamples.clusters, resamples.counts
    compared = [planner_accuracy(group, records, resamples) for group in groups]
    accuracy = np.stack([mean_acc(episodes.correct) for episodes in records.values()])
    acc_of_record = accuracy.mean(axis=1)
    gaps, gap_ends = _gaps(groups, accuracy, clusters, counts, on_ideal)
    kept, kept_ends = _kept(groups, accuracy, clusters, counts, on_ideal)
    planners = tuple(
        PlannerSummary(
            name=group.name,
            privileged=any(privileged[name] for name in group.records),
            training_seeds=group.seeds,
            acc={str(percent): 100 * _mean(acc_at(one.correct, percent) for one in trained) for percent in ACC_AT},
            acc_mean=100 * of.mean,
            acc_mean_ci95=pair(100 * interval(of.resampled)),
            acc_mean_seed_sd=100 * float(acc_of_record[list(group.rows)].std(ddof=1)) if len(group.rows) > 1 else None,
            acc_iqm=100 * interquartile_mean(of.by_sequence),
            acc_iqm_ci95=pair(100 * interval(resampled_interquartile_means(of.by_sequence, counts, of.draws))),
            gap_closed=float(gaps[row]) if np.isfinite(gaps[row]) else None,
            gap_closed_ci95=pair(gap_ends[row]) if np.isfinite(gaps[row]) else None,
            nll=_mean(nll(one.true_probability) for one in trained),
            ece=_mean(ece(one.top_probability, one.correct) for one in trained),
            path_length_m=_mean(path_length(one.viewpoint).mean() for one in trained),
            step_ms=_mean(step_ms[name] for name in group.records),
            flight=_flights(trained),
            accuracy_kept=float(kept[row]) if np.isfinite(kept[row]) else None,
            accuracy_kept_ci95=pair(kept_ends[row]) if np.isfinite(kept[row]) else None,
            solves=None if solves is None else join_solves([solves[name] for name in group.records]),
        )
        for row, (group, trained, of) in enumerate(zip(groups, trainings, compared, strict=True))
    )
    return Summary(
        data=conditions.data,
        sensor=conditions.sensor,
        views=conditions.views,
        track=conditions.track,
        readout=conditions.readout,
        episodes=len(reference),
        no_intervals=resamples.why_none,
        planners=planners,
        differences=differences(compared, {planner.name: planner.privileged for planner in planners}, resamples),
        sequences=len(set(reference.sequence)),
        length=reference.predicted.shape[1],
        form=conditions.form,
        part=conditions.part,
    )


def _mean(values: Iterable[float]) -> float:
    return float(np.mean(list(values)))


def _flights(trainings: Sequence[EpisodeRecords]) -> FlightSummary | None:
    """Return what all flights of a planner demanded; None where it did not fly."""
    flights = [episodes.flight for episodes in trainings if episodes.flight is not None]
    return summarise_flights(join_flights(flights)) if flights else None


def _gaps(
    groups: Sequence[PlannerGroup],
    accuracy: FloatArray,
    clusters: IntArray,
    counts: IntArray,
    on_ideal: Mapping[str, EpisodeRecords] | None,
) -> tuple[FloatArray, FloatArray]:
    """Return gap closed (P,) and its intervals (P, 2); NaN without both ends of the gap.

    A flight's gap reaches up to the oracle on the ideal track where that was run: one that flies is no upper bound.

    Args:
        groups: P planners.
        accuracy: (M, N) of each episode, by record name.
        clusters: (N,) sequence of each episode.
        counts: of resamples.
        on_ideal: records on the ideal track.
    """
    names = [group.name for group in groups]
    above = ORACLE in names or (on_ideal is not None and ORACLE in on_ideal)
    if NO_ACT not in names or not above:
        return np.full(len(names), np.nan), np.full((len(names), 2), np.nan)
    if on_ideal is not None and ORACLE in on_ideal:
        oracle = mean_acc(on_ideal[ORACLE].correct)
    else:
        oracle = accuracy[groups[names.index(ORACLE)].rows[0]]
    rows = np.concatenate([accuracy, oracle[None]])
    ends = (*groups, PlannerGroup(name=ORACLE, seeds=(), records=(ORACLE,), rows=(len(accuracy),)))
    means = mean_over_seeds(rows.mean(axis=1), ends)
    resampled = resample_seeds(resampled_means(rows, clusters, counts), ends)
    low = names.index(NO_ACT)
    closed = gap_closed(means[:-1], means[low], means[-1])
    return closed, interval(gap_closed(resampled[:-1], resampled[low], resampled[-1]))


def _kept(
    groups: Sequence[PlannerGroup],
    accuracy: FloatArray,
    clusters: IntArray,
    counts: IntArray,
    on_ideal: Mapping[str, EpisodeRecords] | None,
) -> tuple[FloatArray, FloatArray]:
    """Return accuracy kept (P,) and its intervals (P, 2); NaN without a run on the ideal track.

    The arguments are those of `_gaps`. A training is compared with itself: what is drawn in flight is also drawn on
    the ideal track, and a planner is compared only where each of its trainings was run there.
    """
    kept, ends = np.full(len(groups), np.nan), np.full((len(groups), 2), np.nan)
    rows = [row for row, group in enumerate(groups) if on_ideal is not None and on_ideal.keys() >= {*group.records}]
    if on_ideal is None or not rows:
        return kept, ends
    records = [name for row in rows for name in groups[row].records]
    flown = accuracy[[row for chosen in rows for row in groups[chosen].rows]]
    low, high = (
        np.stack([mean_acc(on_ideal[name].correct) for name in chosen]) for chosen in ([NO_ACT] * len(records), records)
    )
    compared = group_planners(records)
    of_means = (mean_over_seeds(values.mean(axis=1), compared) for values in (flown, low, high))
    resampled = (resample_seeds(resampled_means(values, clusters, counts), compared) for values in (flown, low, high))
    kept[rows] = gap_closed(*of_means)
    ends[rows] = interval(gap_closed(*resampled))
    return kept, ends


def _check_same_episodes(name: str, episodes: EpisodeRecords, reference: EpisodeRecords) -> None:
    """Raise a DataError unless a planner ran the reference's episodes, in the same order."""
    same = episodes.sequence == reference.sequence and all(
        np.array_equal(getattr(episodes, field), getattr(reference, field)) for field in ("first", "start", "label")
    )
    if not same:
        raise DataError(f"planner {name!r}: expected the same {len(reference)} episodes as the planner before it")
