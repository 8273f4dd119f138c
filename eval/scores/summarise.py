"""Computes the summary of a run as a pure function of its records."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ehar.arrays import FloatArray
from ehar.errors import DataError
from eval.records.config import RunConfig
from eval.records.contacts import ContactRecords, ContactSummary, join_contacts, summarise_contacts
from eval.records.episodes import EpisodeRecords, join_records
from eval.records.flights import FlightRecords, FlightSummary, join_flights, summarise_flights
from eval.records.solves import Solves, join_solves
from eval.scores.answers import answers_only
from eval.scores.differences import differences
from eval.scores.metrics import ACC_AT, acc_at, gap_closed, mean_acc
from eval.scores.planner_accuracy import PlannerAccuracy, draw_resamples, planner_accuracy
from eval.scores.planner_metrics import METRICS
from eval.scores.planner_summary import NO_ACT, ORACLE, PlannerSummary
from eval.scores.resampling.resamples import Resamples
from eval.scores.resampling.statistics import pair
from eval.scores.resampling.training_seeds import (
    PlannerGroup,
    group_planners,
    mean_over_seeds,
    resample_seeds,
)
from eval.scores.sequence_scores import interquartile_mean, resampled_interquartile_means
from eval.scores.streams.scores import stream_scores
from eval.scores.summary import Summary


def summarise(
    records: Mapping[str, EpisodeRecords],
    config: RunConfig,
    *,
    privileged: Mapping[str, bool],
    step_ms: Mapping[str, float],
    solves: Mapping[str, Solves | None] | None = None,
    on_ideal: Mapping[str, EpisodeRecords] | None = None,
) -> Summary:
    """Compute a summary from the records of planners that ran the same episodes.

    Args:
        records: records by record name; trainings of one planner, `il-ppo/0`, `il-ppo/1`, ..., are summarised as one.
        config: configuration of the run.
        privileged: whether each planner was handed the truth, by record name.
        step_ms: planning time of each planner [ms], by record name.
        solves: counts of plans by status, for planners that count them, by record name.
        on_ideal: records of the same episodes on the ideal track, including no-act, to compare flights with.

    Raises:
        DataError: there are no records, the planners' episodes differ, or one has records with and without a seed.
    """
    if not records:
        raise DataError("expected the records of at least one planner, got none")
    told: dict[str, _Told] = {}
    answers: dict[str, EpisodeRecords] = {}
    # One pass, and one planner at a time: records may lie on disk, as they are too many for memory.
    for name in records:
        answers[name] = answers_only(name, records[name], next(iter(answers.values()), None))
        told[name] = _Told.of(records[name], step_ms[name], None if solves is None else solves[name])
    stored, records, reference = records, answers, next(iter(answers.values()))
    own = {planner.name for planner in config.planners if planner.source_sha256 is not None}
    of_streams, fps = any(one.of_streams for one in told.values()), config.conditions.fps
    if on_ideal is not None:
        on_ideal = {name: answers_only(f"{name} on the ideal track", on_ideal[name], reference) for name in on_ideal}
    groups = group_planners(records)
    trainings = [[records[name] for name in group.records] for group in groups]
    resamples = draw_resamples(list(records.values()), groups)
    compared = [planner_accuracy(group, records, resamples) for group in groups]
    accuracy = np.stack([mean_acc(episodes.correct) for episodes in records.values()])
    acc_of_record = accuracy.mean(axis=1)
    gaps, gap_ends = _gaps(groups, accuracy, resamples, on_ideal)
    kept, kept_ends = _kept(groups, accuracy, resamples, on_ideal)
    planners = tuple(
        PlannerSummary(
            name=group.name,
            privileged=any(privileged[name] for name in group.records),
            training_seeds=group.seeds,
            acc={str(percent): 100 * _mean(acc_at(one.correct, percent) for one in trained) for percent in ACC_AT},
            acc_mean=100 * held.mean,
            acc_mean_ci95=pair(100 * resamples.interval(held.mean, held.resampled, bounds=(0, 1))),
            acc_mean_seed_sd=100 * float(acc_of_record[list(group.rows)].std(ddof=1)) if len(group.rows) > 1 else None,
            acc_iqm=100 * interquartile_mean(held.by_sequence),
            acc_iqm_ci95=pair(100 * _iqm_interval(held, resamples)),
            gap_closed=float(gaps[row]) if np.isfinite(gaps[row]) else None,
            gap_closed_ci95=pair(gap_ends[row]) if np.isfinite(gaps[row]) else None,
            metrics={metric.key: _mean(told[name].metrics[metric.key] for name in group.records) for metric in METRICS},
            step_ms=_mean(told[name].step_ms for name in group.records),
            flight=_flights([told[name].flight for name in group.records]),
            accuracy_kept=float(kept[row]) if np.isfinite(kept[row]) else None,
            accuracy_kept_ci95=pair(kept_ends[row]) if np.isfinite(kept[row]) else None,
            solves=None if solves is None else join_solves([told[name].solves for name in group.records]),
            streams=stream_scores(join_records([stored[name] for name in group.records]), fps)
            if of_streams and fps is not None
            else None,
            contacts=_contacts([told[name].contacts for name in group.records]),
            tracking_error_median=_tracking([told[name].tracking for name in group.records], 50),
            tracking_error_p95=_tracking([told[name].tracking for name in group.records], 95),
        )
        for row, (group, trained, held) in enumerate(zip(groups, trainings, compared, strict=True))
    )
    return Summary(
        config=config,
        episodes=next(iter(told.values())).episodes,
        activities=len(reference) if of_streams else None,
        sequences=len(set(reference.sequence)),
        no_intervals=resamples.why_none,
        basis=resamples.basis,
        planners=planners,
        differences=differences(
            compared,
            {planner.name: planner.privileged for planner in planners},
            resamples,
            own={group.name for group in groups if any(name in own for name in group.records)},
        ),
    )


def _mean(values: Iterable[float]) -> float:
    return float(np.mean(list(values)))


class _Told(NamedTuple):
    """What is left of a training's records when their arrays are gone."""

    episodes: int
    of_streams: bool
    metrics: dict[str, float]
    step_ms: float
    flight: FlightRecords | None
    contacts: ContactRecords | None
    tracking: FloatArray | None  # (N, L - 1) [m]
    solves: Solves | None

    @staticmethod
    def of(records: EpisodeRecords, step_ms: float, solves: Solves | None) -> "_Told":
        metrics = {metric.key: metric.of_records(records) for metric in METRICS}
        tracking = None if records.tracking_error is None else records.tracking_error[:, 1:]
        return _Told(
            len(records), records.of_streams, metrics, step_ms, records.flight, records.contacts, tracking, solves
        )


def _flights(trainings: Sequence[FlightRecords | None]) -> FlightSummary | None:
    """Return the demands of all flights of a planner; None if it did not fly."""
    flights = [flight for flight in trainings if flight is not None]
    return summarise_flights(join_flights(flights)) if flights else None


def _contacts(trainings: Sequence[ContactRecords | None]) -> ContactSummary | None:
    """Return how often cameras of a planner were too near to obstacles; None in a world without any."""
    contacts = [one for one in trainings if one is not None]
    return summarise_contacts(join_contacts(contacts)) if contacts else None


def _tracking(trainings: Sequence[FloatArray | None], percentile: float) -> float | None:
    """Return a percentile of the tracking errors of all frames but the first [m]; None without paths."""
    errors = [held for held in trainings if held is not None]
    return float(np.percentile(np.concatenate(errors), percentile)) if errors and errors[0].size else None


def _iqm_interval(held: PlannerAccuracy, resamples: Resamples) -> FloatArray:
    """Return the interval of the interquartile mean over sequences and trainings, (2,), 0 to 1."""
    resampled = resampled_interquartile_means(held.by_sequence, resamples.counts, held.draws)
    return resamples.interval(interquartile_mean(held.by_sequence), resampled, bounds=(0, 1))


def _gaps(
    groups: Sequence[PlannerGroup],
    accuracy: FloatArray,
    resamples: Resamples,
    on_ideal: Mapping[str, EpisodeRecords] | None,
) -> tuple[FloatArray, FloatArray]:
    """Return gap closed (P,) and its intervals (P, 2); NaN without both ends of the gap.

    The gap of flights reaches up to the oracle on the ideal track if it ran there: an oracle that flies is no upper
    bound.

    Args:
        groups: P planners.
        accuracy: (M, N), the accuracy of each record in each episode.
        resamples: resamples of the episodes.
        on_ideal: records on the ideal track.
    """
    names = [group.name for group in groups]
    above = ORACLE in names or (on_ideal is not None and ORACLE in on_ideal)
    if NO_ACT not in names or not above:
        return np.full(len(names), np.nan), np.full((len(names), 2), np.nan)
    if on_ideal is not None and ORACLE in on_ideal:
        rows = np.concatenate([accuracy, mean_acc(on_ideal[ORACLE].correct)[None]])
        oracle = PlannerGroup(name=ORACLE, seeds=(), records=(ORACLE,), rows=(len(accuracy),))
    else:
        rows, oracle = accuracy, groups[names.index(ORACLE)]
    ends = (*groups, oracle)
    means = mean_over_seeds(rows.mean(axis=1), ends)
    resampled = resample_seeds(resamples.means(rows), ends, resamples)
    low = names.index(NO_ACT)
    return _shares((means[:-1], means[low], means[-1]), (resampled[:-1], resampled[low], resampled[-1]), resamples)


def _kept(
    groups: Sequence[PlannerGroup],
    accuracy: FloatArray,
    resamples: Resamples,
    on_ideal: Mapping[str, EpisodeRecords] | None,
) -> tuple[FloatArray, FloatArray]:
    """Return accuracy kept (P,) and its intervals (P, 2); NaN without a run on the ideal track.

    The arguments are those of `_gaps`. Each training is compared with itself: a resample draws the same trainings in
    flight and on the ideal track. A planner is compared only if all of its trainings ran there.
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
    means = tuple(mean_over_seeds(values.mean(axis=1), compared) for values in (flown, low, high))
    resampled = tuple(resample_seeds(resamples.means(values), compared, resamples) for values in (flown, low, high))
    kept[rows], ends[rows] = _shares(means, resampled, resamples)
    return kept, ends


def _shares(
    means: tuple[FloatArray, ...], resampled: tuple[FloatArray, ...], resamples: Resamples
) -> tuple[FloatArray, FloatArray]:
    """Return the shares of a gap (P,) and their intervals (P, 2), from accuracies: the planner's, low and high.

    Args:
        means: (P,) or one number each.
        resampled: the same in every row of the resamples, (P, rows) or (rows,).
        resamples: the resamples.
    """
    share = gap_closed(*means)
    # To first order a share varies as this does, which exists where a resample has no gap.
    acc, low, high = resampled
    linear = acc - low - np.nan_to_num(share)[:, None] * (high - low)
    return share, resamples.interval(share, gap_closed(*resampled), linear=linear)
