"""The summary of one planner."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

from ehar.errors import DataError
from ehar.files import parse_json
from eval.records.contacts import CONTACTS, ContactSummary, contact_numbers
from eval.records.flights import COSTS, KEYS, FlightSummary, flight_numbers
from eval.records.solves import Solves
from eval.scores.metrics import ACC_AT
from eval.scores.planner_metrics import METRICS
from eval.scores.resampling.statistics import Interval
from eval.scores.streams.scores import StreamScores

NO_ACT, ORACLE = "no-act", "oracle"  # the two ends of the gap


@dataclass(frozen=True)
class PlannerSummary:
    """The results of one planner; with several training seeds, every number is the mean over them.

    Args:
        name: name of the planner, without seeds.
        privileged: whether it was handed the truth.
        training_seeds: its training seeds, in ascending order; empty for a planner whose name has none.
        acc: accuracy [%] after 10 to 100 % of the frames.
        acc_mean: accuracy [%], the mean over all frames.
        acc_mean_ci95: its 95 % interval, bootstrap over people, their sequences and, where there are several, training
            seeds; None, like all intervals, if there can be no intervals.
        acc_mean_seed_sd: standard deviation (ddof 1) of `acc_mean` over training seeds [percentage points]; None below
            two seeds.
        acc_iqm: accuracy [%], the interquartile mean over sequences and training seeds, each sequence counting once.
        acc_iqm_ci95: its 95 % interval.
        gap_closed: the share of the way from no-act to the oracle; flights that are compared with the ideal track use
            its oracle. None if no-act or the oracle did not run, or the oracle was no better.
        gap_closed_ci95: its 95 % interval.
        metrics: means over trainings, by the keys of `METRICS`.
        step_ms: planning time of one frame of one episode [ms]; like `solves`, it is not in the records.
        flight: the demands of its flights on the vehicle, over all seeds; None on the ideal track.
        accuracy_kept: the gap closed in flight divided by the gap closed on the ideal track. Both are shares of the
            ideal track's gap, so the oracle cancels: (acc in flight - acc of no-act) / (acc on the ideal track - acc of
            no-act), mean accuracies over frames, those of no-act on the ideal track. None if not all of its seeds ran
            on the ideal track, or if the planner gained nothing there.
        accuracy_kept_ci95: its 95 % interval, over the resamples in which the planner gained on the ideal track.
        tracking_error_median: how far cameras were from the planner's paths [m], the median over all frames but the
            first; None for a planner that gave none.
        tracking_error_p95: the 95th percentile.
        solves: counts of its plans by status, over all seeds; None for a planner that does not count them.
        streams: scores of streams, over all seeds; None in clips, whose summary.json has no such key.
        contacts: frames in which its cameras were too near to obstacles, over all seeds; None in a world without any.
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
    metrics: dict[str, float]
    step_ms: float
    flight: FlightSummary | None = None
    accuracy_kept: float | None = None
    accuracy_kept_ci95: Interval | None = None
    tracking_error_median: float | None = None
    tracking_error_p95: float | None = None
    solves: Solves | None = None
    streams: StreamScores | None = None
    contacts: ContactSummary | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the planner's flat object in summary.json; its keys are the same for every planner and track.

        In a world without obstacles there are no contacts, and on the ideal track no costs of flights.
        """
        values: dict[str, Any] = {}
        for name, value in asdict(self).items():
            if name == "metrics":
                values |= value
            elif name not in ("flight", "solves", "contacts") and not (name == "streams" and value is None):
                values[name] = value
        return {
            **values,
            **flight_numbers(self.flight),
            **contact_numbers(self.contacts),
            "solves": None if self.solves is None else self.solves.counts,
            "fallback_share": None if self.solves is None else self.solves.fallback_share,
        }


class FlightCost(NamedTuple):
    """A column of what flights cost.

    Attributes:
        key: of `FlightSummary`.
        header: of the column, with its unit.
        unit: in SI units.
        digits: behind the decimal point.
    """

    key: str
    header: str
    unit: float
    digits: int

    def of(self, planner: PlannerSummary) -> float | None:
        """Return the cost of a planner's flights in the column's unit; None if nobody knows."""
        held = None if planner.flight is None else getattr(planner.flight, self.key)
        return None if held is None else held / self.unit


ENERGY = FlightCost("energy", "energy [kJ]", 1000.0, 2)
FLIGHT_COSTS = (FlightCost("distance", "flown [m]", 1.0, 1), ENERGY, FlightCost("noise", "noise [dB(A)]", 1.0, 1))


def known_costs(planners: Sequence[PlannerSummary]) -> list[FlightCost]:
    """Return the costs that are known of any of the planners' flights."""
    return [cost for cost in FLIGHT_COSTS if any(cost.of(planner) is not None for planner in planners)]


def parse_planner(held: dict[str, Any], where: str) -> PlannerSummary:
    """Parse a planner's object in summary.json; the numbers of flights and plans are flat beside the others.

    Raises:
        DataError: the object is not a result of `PlannerSummary.to_json`; the error names `where` and the field.
    """
    metrics = {metric.key: held[metric.key] for metric in METRICS if metric.key in held}
    flown = {key: held.get(key) for key in (*KEYS, *COSTS) if key in KEYS or key in held}
    solves = held.get("solves")
    flat = (*KEYS, *COSTS, *CONTACTS, *metrics)
    nested: dict[str, Any] = {name: value for name, value in held.items() if name not in flat}
    nested["contacts"] = {key: held.get(key) for key in CONTACTS} if CONTACTS[0] in held else None
    nested["metrics"] = metrics
    nested["flight"] = None if all(value is None for value in flown.values()) else flown
    if isinstance(solves, dict):  # the file has the share of plans that fell back, not their number
        share = held.get("fallback_share")
        plans = sum(count for count in solves.values() if isinstance(count, int))
        fallbacks = round(share * plans) if isinstance(share, float) and 0 <= share <= 1 else share
        nested["solves"] = {"counts": solves, "fallbacks": fallbacks}
    text = json.dumps(nested)  # numbers that are not finite are refused below
    planner = parse_json(text, PlannerSummary, where, "a planner's summary", unknown=True, defaults=True)
    missing = [str(percent) for percent in ACC_AT if str(percent) not in planner.acc]
    if missing:
        raise DataError(f"{where}: acc: missing {', '.join(missing)}; expected {', '.join(map(str, ACC_AT))}")
    return planner
