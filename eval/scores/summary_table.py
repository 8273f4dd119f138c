"""The tables of a summary: one row per planner, paired differences, and the paper's rows."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from ehar.obstacles.shapes import MARGIN
from eval.render.tables import (
    NONE,
    PRIVILEGED,
    Table,
    interval_text,
    no_interval_footnotes,
    share_text,
)
from eval.scores.differences import Difference
from eval.scores.metrics import ACC_AT, Metric
from eval.scores.planner_metrics import METRICS
from eval.scores.planner_summary import ENERGY, NO_ACT, ORACLE, FlightCost, PlannerSummary, known_costs
from eval.scores.resampling.resamples import Basis

TOGETHER = "Intervals of differences are corrected together: all of them cover in 95 of 100 such tables."
_SPREAD = "±"
_KEPT = ("kept % [95 %]",)
CONTACTS = ("frames near", "hit")
CONTACTS_NOTE = f"Frames near: all those in which a camera was less than {MARGIN:g} m from an obstacle; hit: in it."
_FLIGHT = ("peak [m/s]", "[m/s^2]", "[m/s^3]", "effort [m^2/s^3]", "at limit %")


class BasisLines(NamedTuple):
    """What a table says about its intervals.

    Attributes:
        notice: a line that a reader must not miss; empty if intervals rest on enough people.
        footnotes: the same without urgency, or why there are no intervals.
    """

    notice: str
    footnotes: tuple[str, ...]


def basis_lines(basis: Basis, no_intervals: str | None) -> BasisLines:
    """Return what a table says about its intervals.

    Args:
        basis: the people and sequences that they rest on.
        no_intervals: why there are none; None if there are.
    """
    if no_intervals is not None:
        return BasisLines("", tuple(no_interval_footnotes(no_intervals)))
    return BasisLines(basis.sentence, ()) if basis.few else BasisLines("", (basis.sentence,))


def summary_tables(
    title: str,
    data: str,
    planners: Sequence[PlannerSummary],
    differences: Sequence[Difference],
    basis: BasisLines,
) -> list[Table]:
    """Return the table of a summary and, if they exist, the tables of differences and of the paper's rows.

    Args:
        title: title of the first table.
        data: title of the data.
        planners: planners of the summary, one row each.
        differences: paired differences between them.
        basis: what tables say about their intervals.
    """
    tables = (
        benchmark_table(title, planners, basis),
        differences_table(planners, differences, basis),
        paper_table(data),
    )
    return [table for table in tables if table is not None]


def benchmark_table(title: str, planners: Sequence[PlannerSummary], basis: BasisLines) -> Table:
    """Return the table with one row per planner, accuracies and gaps in percent; flights have more columns."""
    header = ("planner", *(f"acc@{percent}" for percent in ACC_AT), "mean acc [95 %]", "gap closed % [95 %]")
    flown = any(planner.flight is not None for planner in planners)
    compared = any(planner.accuracy_kept is not None for planner in planners)
    beside = any(planner.contacts is not None for planner in planners)
    costs = known_costs(planners)
    own = (*(CONTACTS * beside), *(_FLIGHT * flown), *(cost.header for cost in costs), "ms/step")
    return Table(
        title=title,
        header=(*header, *(_KEPT * compared), *(metric.header for metric in METRICS), *own),
        rows=tuple(_row(planner, compared, costs) for planner in planners),
        footnotes=(*basis.footnotes, *_footnotes(planners, flown=flown, compared=compared)),
        notice=basis.notice,
    )


def of_ideal_oracle(planners: Sequence[PlannerSummary]) -> bool:
    """Return whether gaps reach up to the ideal track's oracle: an oracle of this run would close all of its own."""
    closed = {planner.name: planner.gap_closed for planner in planners if planner.gap_closed is not None}
    return bool(closed) and closed.get(ORACLE) != 1


def _footnotes(planners: Sequence[PlannerSummary], *, flown: bool, compared: bool) -> Iterator[str]:
    """Yield what a reader of the table has to know."""
    names = {planner.name for planner in planners}
    yield from _training_footnotes(planners)
    if any(planner.privileged for planner in planners):
        yield f"{PRIVILEGED} privileged: is handed the label and the future."
    if any(planner.gap_closed is None for planner in planners):
        if {NO_ACT, ORACLE} <= names:
            yield "No gap to close: the oracle is no better than no-act here."
        else:
            yield f"Gap closed needs both {NO_ACT} and {ORACLE} among the planners."
    if flown and ORACLE in names:
        yield (
            "The oracle tries moves of the grid and heads for where the best leads: in flight it is no upper bound. "
            "Compared with a run on the ideal track, the gap reaches up to its oracle."
        )
    elif of_ideal_oracle(planners):
        yield "Gap closed reaches up to the oracle of the run on the ideal track."
    if flown:
        yield (
            "Peaks are Cartesian, the largest of all episodes; effort is the mean integral of the squared "
            "acceleration; at limit is the share of frames in which 99 % of some limit is used."
        )
    if ENERGY in known_costs(planners):
        yield (
            "Flown, energy and noise are of a mean episode: metres in the world's frame; the energy that a model of "
            "the vehicle's rotors takes; and the equivalent sound level at the centre of the people."
        )
    if any(planner.contacts is not None for planner in planners):
        yield CONTACTS_NOTE
    if compared:
        yield (
            "Kept: (accuracy in flight - N) / (accuracy on the ideal track - N), with N that of no-act on the ideal "
            "track."
        )
    for planner in planners:
        if planner.tracking_error_median is not None and planner.tracking_error_p95 is not None:
            yield (
                f"{planner.name}: flown {planner.tracking_error_median:.3f} m from its paths in the median, "
                f"{planner.tracking_error_p95:.3f} m in the 95th percentile of frames."
            )
        if planner.solves is not None and planner.solves.fallbacks:
            counts = ", ".join(f"{status} {count}" for status, count in planner.solves.counts.items())
            yield f"{planner.name}: {planner.solves.fallbacks} of {planner.solves.total} plans fell back ({counts})."


def _training_footnotes(planners: Sequence[PlannerSummary]) -> Iterator[str]:
    """Yield how to read the numbers of planners with training seeds."""
    several = [planner for planner in planners if len(planner.training_seeds) > 1]
    one = [planner for planner in planners if len(planner.training_seeds) == 1]
    if several:
        counts = ", ".join(f"{planner.name} {len(planner.training_seeds)}" for planner in several)
        yield (
            f"Training seeds: {counts}. Numbers are means over seeds, behind {_SPREAD} stands the standard deviation "
            "over seeds; their intervals draw these seeds too."
        )
    if one:
        names = ", ".join(f"{planner.name} ({planner.training_seeds[0]})" for planner in one)
        yield f"One training seed: {names}; its intervals do not say what another training would give."


def _row(planner: PlannerSummary, compared: bool, costs: Sequence[FlightCost]) -> tuple[str, ...]:
    flight: tuple[str, ...] = ()
    if planner.flight is not None:
        peaks = (planner.flight.peak_speed, planner.flight.peak_acceleration, planner.flight.peak_jerk)
        last = (f"{planner.flight.effort:.1f}", f"{100 * planner.flight.limit_share:.1f}")
        flight = (*(f"{peak:.2f}" for peak in peaks), *last)
    spread = "" if planner.acc_mean_seed_sd is None else f" {_SPREAD} {planner.acc_mean_seed_sd:.1f}"
    return (
        planner.name + PRIVILEGED * planner.privileged,
        *(f"{planner.acc[str(percent)]:.1f}" for percent in ACC_AT),
        f"{planner.acc_mean:.1f}{spread} {interval_text(planner.acc_mean_ci95)}",
        share_text(planner.gap_closed, planner.gap_closed_ci95),
        *((share_text(planner.accuracy_kept, planner.accuracy_kept_ci95),) * compared),
        *(_metric(planner, metric) for metric in METRICS),
        *(() if planner.contacts is None else map(str, vars(planner.contacts).values())),
        *flight,
        *(_number(cost.of(planner), cost.digits) for cost in costs),
        f"{planner.step_ms:.3f}",
    )


def _metric(planner: PlannerSummary, metric: Metric) -> str:
    """Return a metric as text; a run of an older version may lack it."""
    return _number(planner.metrics.get(metric.key), metric.digits)


def _number(value: float | None, digits: int) -> str:
    return NONE if value is None else f"{value:.{digits}f}"


def differences_table(
    planners: Sequence[PlannerSummary], differences: Sequence[Difference], basis: BasisLines
) -> Table | None:
    """Return how much more accurate each planner of interest is (columns) than each other one (rows), or None."""
    if not differences:
        return None
    found = {(pair.other, pair.planner): pair for pair in differences}
    columns = tuple(dict.fromkeys(pair.planner for pair in differences))
    rows = [planner.name for planner in planners if any((planner.name, column) in found for column in columns)]
    cells = [[found.get((row, column)) for column in columns] for row in rows]
    return Table(
        title="Mean accuracy of the column's planner minus that of the row's, on the same episodes, in points [95 %]",
        header=("planner", *columns),
        rows=tuple(
            (
                name,
                *("" if pair is None else f"{pair.acc_mean:+.1f} {interval_text(pair.ci95_corrected)}" for pair in row),
            )
            for name, row in zip(rows, cells, strict=True)
        ),
        footnotes=(f"Bold: the interval excludes zero. {TOGETHER}", *basis.footnotes, *smallest_footnotes(differences)),
        bold=frozenset(
            (row, column)
            for row, found_there in enumerate(cells)
            for column, pair in enumerate(found_there, 1)
            if pair is not None and pair.is_clear
        ),
        notice=basis.notice,
    )


def smallest_footnotes(found: Sequence[Difference]) -> Iterator[str]:
    """Yield the smallest true differences that would have shown."""
    smallest = sorted(pair.smallest for pair in found if pair.smallest is not None)
    if smallest:
        low, high = f"{smallest[0]:.1f}", f"{smallest[-1]:.1f}"
        span = f"{low} points" if low == high else f"{low} to {high} points, depending on the pair"
        yield f"Smallest difference that a run like this shows 8 times in 10: {span}."


class PaperRow(NamedTuple):
    """One planner's accuracies in the paper [%]; for learned planners, the mean of 5 training runs.

    The paper's recogniser, scenarios and unpublished choices are not ours, so our numbers need not equal these.
    """

    name: str
    acc: tuple[float, float, float, float, float, float]
    acc_mean: float


_EXPI = (  # Table 1
    PaperRow("oracle", (55.56, 67.41, 80.74, 89.63, 93.33, 94.81), 77.53),
    PaperRow("no-act", (49.63, 47.41, 51.85, 57.04, 61.48, 62.96), 52.79),
    PaperRow("towards", (48.89, 42.96, 50.37, 57.78, 59.26, 59.26), 50.64),
    PaperRow("h-rotate", (44.44, 48.15, 55.56, 46.67, 33.33, 29.63), 45.23),
    PaperRow("v-rotate", (45.19, 48.15, 57.04, 62.22, 60.74, 60.00), 54.52),
    PaperRow("random", (49.93, 45.78, 51.26, 56.74, 60.59, 62.07), 52.45),
    PaperRow("ppo", (46.07, 50.52, 62.07, 67.11, 65.63, 65.48), 58.51),
    PaperRow("il", (49.33, 53.04, 63.70, 65.33, 65.78, 63.70), 59.61),
    PaperRow("il-ppo", (50.81, 56.30, 66.37, 71.70, 74.81, 74.96), 64.27),
)
_AISTPP = (  # Table 2
    PaperRow("oracle", (21.24, 40.71, 57.52, 60.18, 69.91, 69.03), 51.22),
    PaperRow("no-act", (20.35, 30.97, 37.17, 41.59, 40.71, 43.36), 32.68),
    PaperRow("towards", (19.47, 29.20, 36.28, 35.39, 39.82, 42.48), 31.86),
    PaperRow("h-rotate", (19.47, 27.43, 35.39, 39.82, 40.70, 44.24), 32.77),
    PaperRow("v-rotate", (16.81, 23.01, 33.63, 34.51, 37.17, 39.82), 28.08),
    PaperRow("random", (18.89, 27.14, 36.87, 38.94, 37.61, 41.15), 32.06),
    PaperRow("ppo", (17.88, 35.04, 46.90, 53.81, 58.58, 59.47), 42.59),
    PaperRow("il", (17.26, 31.42, 42.04, 45.58, 45.13, 43.58), 36.38),
    PaperRow("il-ppo", (19.25, 37.61, 50.00, 58.41, 63.72, 67.04), 46.06),
)
PAPER_ROWS = {"expi": _EXPI, "aistpp": _AISTPP}  # by the name of the data


def paper_gap_closed(rows: tuple[PaperRow, ...], name: str) -> float:
    """Return the gap that a row of the paper closes, computed from its table."""
    acc = {row.name: row.acc_mean for row in rows}
    return (acc[name] - acc["no-act"]) / (acc["oracle"] - acc["no-act"])


def paper_table(data: str) -> Table | None:
    """Return the paper's own rows if the data is one of its two sets, or None."""
    rows = PAPER_ROWS.get(data)
    if rows is None:
        return None
    return Table(
        title=f"The paper's rows on {data}, with its recogniser and its scenarios",
        header=("planner", *(f"acc@{percent}" for percent in ACC_AT), "mean acc", "gap closed %"),
        rows=tuple(_paper_row(row, rows) for row in rows),
        footnotes=(f"{PRIVILEGED} privileged.",),
    )


def _paper_row(row: PaperRow, rows: tuple[PaperRow, ...]) -> tuple[str, ...]:
    return (
        row.name + PRIVILEGED * (row.name == ORACLE),
        *(f"{acc:.1f}" for acc in row.acc),
        f"{row.acc_mean:.1f}",
        f"{100 * paper_gap_closed(rows, row.name):.1f}",
    )
