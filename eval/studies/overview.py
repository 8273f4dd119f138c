"""Several runs side by side: one column a run, one row a planner, from their summary.json."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ehar.errors import DataError, UsageError
from eval.records.config import read_config
from eval.records.json_object import read_object
from eval.records.run_files import SUMMARY
from eval.render.tables import Table, interval_text, no_interval_footnotes
from eval.scores.statistics import Interval
from eval.scores.summary import NO_ACT, ORACLE
from eval.scores.training_seeds import group_planners

CONDITIONS = ("sensor", "views", "track", "readout")  # named in a column where the runs differ in them


@dataclass(frozen=True)
class RunOverview:
    """What an overview shows of a run.

    Args:
        title: data, and the conditions in which the runs differ.
        planners: what summary.json says of each, by name.
        differences: what it says of pairs, by (minuend, subtrahend).
        episodes: how many there are.
        no_intervals: why intervals cannot be had, or None.
    """

    title: str
    planners: Mapping[str, Mapping[str, Any]]
    differences: Mapping[tuple[str, str], Mapping[str, Any]]
    episodes: int
    no_intervals: str | None


def read_overview(directories: Sequence[Path]) -> list[RunOverview]:
    """Read the summaries of runs.

    Raises:
        UsageError: there are none, or a folder holds no run, one of another schema, or one without summary.json.
        DataError: a summary is not one that `ehar benchmark` has written, or a run is incomplete.
    """
    if not directories:
        raise UsageError("overview: expected at least one folder of a run")
    configs = [read_config(directory) for directory in directories]
    held = [read_object(directory / SUMMARY, "a finished run of ehar benchmark") for directory in directories]
    differing = [name for name in CONDITIONS if len({summary.get(name) for summary in held}) > 1]
    runs = [
        _overview(summary, differing, directory / SUMMARY) for summary, directory in zip(held, directories, strict=True)
    ]
    for directory, config, run in zip(directories, configs, runs, strict=True):
        ran = [group.name for group in group_planners(planner.name for planner in config.planners)]
        absent = [name for name in ran if name not in run.planners]
        if absent:
            raise DataError(
                f"{directory / SUMMARY}: this run is incomplete, expected figures of {', '.join(absent)} too"
            )
    return runs


def _overview(summary: Mapping[str, Any], differing: Sequence[str], path: Path) -> RunOverview:
    try:
        planners = {str(planner["name"]): planner for planner in summary["planners"]}
        for planner in planners.values():
            float(planner["acc_mean"]), bool(planner["privileged"]), planner["gap_closed"]
        return RunOverview(
            title=" ".join((str(summary["data"]).split(" (")[0], *(str(summary[name]) for name in differing))),
            planners=planners,
            differences={(of["planner"], of["other"]): of for of in summary["differences"]},
            episodes=int(summary["episodes"]),
            no_intervals=summary.get("no_intervals"),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{path}: expected the summary that `ehar benchmark` writes, got {error!r}") from error


def gap_table(runs: Sequence[RunOverview]) -> Table:
    """Return the gap closed in percent: one row a planner, one column a run, the best without the truth in bold."""
    names = [name for name in _names(runs) if name not in (NO_ACT, ORACLE)]
    rows = [(name + "*" * _privileged(runs, name), *(_gap(run.planners.get(name)) for run in runs)) for name in names]
    bold = set()
    for column, run in enumerate(runs, 1):
        shares = {
            row: run.planners[name]["gap_closed"]
            for row, name in enumerate(names)
            if name in run.planners and not run.planners[name]["privileged"]
        }
        closed = {row: share for row, share in shares.items() if share is not None}
        if closed:
            bold.add((max(closed, key=lambda row: float(closed[row])), column))
    return Table(
        title="Gap closed between no-act (0) and the oracle (100), in percent [95 %]",
        header=("planner", *(run.title for run in runs)),
        rows=(
            *rows,
            ("no-act to oracle, mean acc", *(_ends(run) for run in runs)),
            ("episodes", *(str(run.episodes) for run in runs)),
        ),
        footnotes=(
            "Bold: the best planner without the truth. * privileged: is handed the label and the future.",
            *_no_interval_footnotes(runs),
        ),
        bold=frozenset(bold),
    )


def difference_table(runs: Sequence[RunOverview], planner: str) -> Table:
    """Return how much more accurate a planner is than each other, in points: one column a run.

    Raises:
        UsageError: no run has compared it with others.
    """
    others = [name for name in _names(runs) if any(_difference(run, planner, name) for run in runs)]
    if not others:
        compared = sorted({name for run in runs for pair in run.differences for name in pair})
        raise UsageError(
            f"no differences of {planner!r} in these runs; expected one of: {', '.join(compared) or 'none'}"
        )
    cells = [[_difference(run, planner, name) for run in runs] for name in others]
    return Table(
        title=f"Mean accuracy of {planner} minus that of the row's planner, on the same episodes, in points [95 %]",
        header=("planner", *(run.title for run in runs)),
        rows=tuple(
            (name, *("" if of is None else f"{of[0]:+.1f} {interval_text(of[1])}" for of in row))
            for name, row in zip(others, cells, strict=True)
        ),
        footnotes=("Bold: the interval excludes zero.", *_no_interval_footnotes(runs)),
        bold=frozenset(
            (row, column)
            for row, differences in enumerate(cells)
            for column, of in enumerate(differences, 1)
            if of is not None and of[1] is not None and not of[1][0] <= 0 <= of[1][1]
        ),
    )


def _no_interval_footnotes(runs: Sequence[RunOverview]) -> Iterator[str]:
    """Yield which runs have no intervals, and why."""
    for run in runs:
        yield from no_interval_footnotes(None if run.no_intervals is None else f"{run.title}, {run.no_intervals}")


def _names(runs: Sequence[RunOverview]) -> list[str]:
    return list(dict.fromkeys(name for run in runs for name in run.planners))


def _privileged(runs: Sequence[RunOverview], name: str) -> bool:
    return any(run.planners[name]["privileged"] for run in runs if name in run.planners)


def _gap(planner: Mapping[str, Any] | None) -> str:
    if planner is None or planner["gap_closed"] is None:
        return "-"
    ci95 = planner["gap_closed_ci95"]
    ends = None if ci95 is None else (100 * float(ci95[0]), 100 * float(ci95[1]))
    return f"{100 * planner['gap_closed']:.0f} {interval_text(ends, 0)}"


def _ends(run: RunOverview) -> str:
    """Return the accuracies at both ends of the gap, as far as they were run."""
    found = (f"{run.planners[name]['acc_mean']:.1f}" if name in run.planners else "-" for name in (NO_ACT, ORACLE))
    return " to ".join(found)


def _difference(run: RunOverview, planner: str, other: str) -> tuple[float, Interval | None] | None:
    """Return a difference and its interval [points]; a pair that was compared the other way round is turned."""
    if (planner, other) in run.differences:
        of, sign = run.differences[planner, other], 1
    elif (other, planner) in run.differences:
        of, sign = run.differences[other, planner], -1
    else:
        return None
    ends = None if of["ci95"] is None else (sign * float(of["ci95"][0]), sign * float(of["ci95"][1]))
    return sign * float(of["acc_mean"]), None if ends is None else (min(ends), max(ends))
