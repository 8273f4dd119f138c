"""Several runs side by side: a column for each run and a row for each planner, from their summary.json."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ehar.errors import UsageError
from ehar.files import write_text
from eval.render.tables import NONE, Table, interval_text, markdown, no_interval_footnotes, share_text
from eval.running.run import read_run
from eval.scores.differences import excludes_zero
from eval.scores.planner_summary import NO_ACT, ORACLE, PlannerSummary
from eval.scores.resampling.statistics import Interval
from eval.scores.summary import Summary
from planners.registry import is_rule

TOLD = ("sensor", "views", "track", "onset")  # a column names these conditions if the runs differ in them


@dataclass(frozen=True)
class RunOverview:
    """A run in an overview.

    Args:
        title: the data, and the conditions in which the runs differ.
        summary: the content of its summary.json.
    """

    title: str
    summary: Summary

    @property
    def planners(self) -> Mapping[str, PlannerSummary]:
        """The planners by name."""
        return {planner.name: planner for planner in self.summary.planners}


def overview(runs: Sequence[str | Path], *, planner: str | None = None, out: str | Path | None = None) -> list[Table]:
    """Return the tables of several runs side by side.

    Args:
        runs: folders of finished runs.
        planner: a planner; its paired differences from the others are shown too, and how far it is above each run's
            best rule.
        out: Markdown file to write too.

    Raises:
        EharError: one line that says what was got and what was expected.
    """
    read = read_overview(runs)
    measured = any(planner.gap_closed is not None for run in read for planner in run.summary.planners)
    tables = [
        gap_table(read) if measured else accuracy_table(read),
        *([] if planner is None else [difference_table(read, planner)]),
    ]
    if planner is not None and any(map(_best_rule, read)):
        tables.append(rule_table(read, planner))
    if out is not None:
        write_text(Path(out), [markdown(*tables)])
    return tables


def read_overview(directories: Sequence[str | Path]) -> list[RunOverview]:
    """Read the summaries of runs.

    Raises:
        UsageError: there is no folder; or a folder holds no run, a run of another schema, or no summary.json.
        DataError: a summary was not written by `ehar benchmark`, or a run is incomplete.
    """
    if not directories:
        raise UsageError("overview: expected at least one folder of a run")
    runs = [read_run(directory) for directory in directories]
    told = [
        {name: str(getattr(run.conditions, name)) for name in TOLD}
        | {"world": run.conditions.world_name, "readout": run.config.readout}
        for run in runs
    ]
    differing = [name for name in told[0] if len({held[name] for held in told}) > 1]
    return [
        RunOverview(
            " ".join((re.sub(r" \(.*?\)", "", run.config.data), *(held[name] for name in differing))), run.summary
        )
        for run, held in zip(runs, told, strict=True)
    ]


def accuracy_table(runs: Sequence[RunOverview]) -> Table:
    """Return the mean accuracy [%]: a row for each planner, a column for each run. The best is bold."""
    names = _names(runs)
    bold = {
        (names.index(max(free, key=lambda name: run.planners[name].acc_mean)), column)
        for column, run in enumerate(runs, 1)
        if (free := [planner.name for planner in run.summary.planners if not planner.privileged])
    }
    return Table(
        title="Mean accuracy, in percent [95 %]",
        header=("planner", *(run.title for run in runs)),
        rows=(
            *(
                (name + "*" * _privileged(runs, name), *(_accuracy(run.planners.get(name)) for run in runs))
                for name in names
            ),
            ("episodes", *(str(run.summary.episodes) for run in runs)),
        ),
        footnotes=(
            "Bold: the best planner without the truth. * privileged: is handed the label and the future.",
            *_basis_footnotes(runs),
        ),
        bold=frozenset(bold),
    )


def gap_table(runs: Sequence[RunOverview]) -> Table:
    """Return the gap closed [%]: a row for each planner, a column for each run. The best unprivileged one is bold."""
    names = [name for name in _names(runs) if name not in (NO_ACT, ORACLE)]
    rows = [(name + "*" * _privileged(runs, name), *(_gap(run.planners.get(name)) for run in runs)) for name in names]
    bold = set()
    for column, run in enumerate(runs, 1):
        shares = {
            row: run.planners[name].gap_closed
            for row, name in enumerate(names)
            if name in run.planners and not run.planners[name].privileged
        }
        closed = {row: share for row, share in shares.items() if share is not None}
        if closed:
            bold.add((max(closed, key=lambda row: closed[row]), column))
    return Table(
        title="Gap closed between no-act (0) and the oracle (100), in percent [95 %]",
        header=("planner", *(run.title for run in runs)),
        rows=(
            *rows,
            ("no-act to oracle, mean acc", *(_ends(run) for run in runs)),
            ("episodes", *(str(run.summary.episodes) for run in runs)),
        ),
        footnotes=(
            "Bold: the best planner without the truth. * privileged: is handed the label and the future.",
            *_basis_footnotes(runs),
        ),
        bold=frozenset(bold),
    )


def difference_table(runs: Sequence[RunOverview], planner: str) -> Table:
    """Return the accuracy of a planner minus that of each other planner, in points: a column for each run.

    Raises:
        UsageError: no run has compared the planner with others.
    """
    others = [name for name in _names(runs) if any(_difference(run, planner, name) for run in runs)]
    if not others:
        compared = sorted(
            {name for run in runs for pair in run.summary.differences for name in (pair.planner, pair.other)}
        )
        raise UsageError(
            f"no differences of {planner!r} in these runs; expected one of: {', '.join(compared) or 'none'}"
        )
    cells = [[_difference(run, planner, name) for run in runs] for name in others]
    return Table(
        title=f"Mean accuracy of {planner} minus that of the row's planner, on the same episodes, in points [95 %]",
        header=("planner", *(run.title for run in runs)),
        rows=tuple(
            (name, *("" if found is None else f"{found[0]:+.1f} {interval_text(found[1])}" for found in row))
            for name, row in zip(others, cells, strict=True)
        ),
        footnotes=(
            "Bold: the interval excludes zero. Intervals are corrected together with all pairs of their run.",
            *_basis_footnotes(runs),
        ),
        bold=frozenset(
            (row, column)
            for row, differences in enumerate(cells)
            for column, found in enumerate(differences, 1)
            if found is not None and found[1] is not None and excludes_zero(found[1])
        ),
    )


def rule_table(runs: Sequence[RunOverview], planner: str) -> Table:
    """Return a planner beside a camera that stays and beside the best rule of each run: a row for each run."""
    ruled = [(run, rule) for run in runs if planner in run.planners and (rule := _best_rule(run))]
    flown = any(run.planners[planner].accuracy_kept is not None for run, _ in ruled)
    hitting = any(run.planners[planner].contacts is not None for run, _ in ruled)
    rows: list[tuple[str, ...]] = []
    bold = set()
    for run, rule in ruled:
        scored = run.planners[planner]
        found = [_difference(run, planner, name) for name in (NO_ACT, rule)]
        bold |= {(len(rows), 4 + i) for i, one in enumerate(found) if one and one[1] and excludes_zero(one[1])}
        contacts = scored.contacts
        rows.append(
            (
                run.title,
                f"{run.planners[NO_ACT].acc_mean:.1f}" if NO_ACT in run.planners else NONE,
                f"{rule} {run.planners[rule].acc_mean:.1f}",
                f"{scored.acc_mean:.1f}",
                *(NONE if one is None else f"{one[0]:+.1f} {interval_text(one[1])}" for one in found),
                *([share_text(scored.accuracy_kept, scored.accuracy_kept_ci95)] if flown else []),
                *([NONE if contacts is None else str(contacts.hit_frames)] if hitting else []),
            )
        )
    kept_column, hit_column = ["kept % [95 %]"] if flown else [], ["frames hit"] if hitting else []
    return Table(
        title=f"{planner} against a camera that stays and against each run's best rule, in percent and points [95 %]",
        header=(
            *("run", NO_ACT, "best rule", planner, f"{planner} - {NO_ACT}", f"{planner} - best rule"),
            *(*kept_column, *hit_column),
        ),
        rows=tuple(rows),
        footnotes=(
            "The best rule is that with the highest accuracy in the run itself, a camera that stays included.",
            "Bold: the interval excludes zero. Intervals are corrected together with all pairs of their run.",
        ),
        bold=frozenset(bold),
        words=frozenset({2}),
    )


def _best_rule(run: RunOverview) -> str | None:
    """Return the rule of a run with the highest accuracy; None if no rule ran."""
    rules = [planner for planner in run.summary.planners if is_rule(planner.name)]
    return max(rules, key=lambda planner: planner.acc_mean).name if rules else None


def _basis_footnotes(runs: Sequence[RunOverview]) -> Iterator[str]:
    """Yield a footnote that says what the intervals of runs rest on, or why there are none; once for like runs."""
    titles: dict[str, list[str]] = {}
    for run in runs:
        if run.summary.no_intervals is None:
            titles.setdefault(run.summary.basis.sentence, []).append(run.title)
        else:
            yield from no_interval_footnotes(f"{run.title}, {run.summary.no_intervals}")
    for sentence, like in titles.items():
        yield f"{', '.join(like)}: {sentence}"


def _names(runs: Sequence[RunOverview]) -> list[str]:
    return list(dict.fromkeys(name for run in runs for name in run.planners))


def _privileged(runs: Sequence[RunOverview], name: str) -> bool:
    return any(run.planners[name].privileged for run in runs if name in run.planners)


def _accuracy(planner: PlannerSummary | None) -> str:
    return "-" if planner is None else f"{planner.acc_mean:.1f} {interval_text(planner.acc_mean_ci95)}"


def _gap(planner: PlannerSummary | None) -> str:
    if planner is None or planner.gap_closed is None:
        return "-"
    ci95 = planner.gap_closed_ci95
    ends = None if ci95 is None else (100 * ci95[0], 100 * ci95[1])
    return f"{100 * planner.gap_closed:.0f} {interval_text(ends, 0)}"


def _ends(run: RunOverview) -> str:
    """Return the accuracies of no-act and the oracle; `-` for one that did not run."""
    found = (f"{run.planners[name].acc_mean:.1f}" if name in run.planners else "-" for name in (NO_ACT, ORACLE))
    return " to ".join(found)


def _difference(run: RunOverview, planner: str, other: str) -> tuple[float, Interval | None] | None:
    """Return a difference and its interval [points]; their signs change if the run compared the pair the other way."""
    for difference in run.summary.differences:
        ends = difference.ci95_corrected
        if (difference.planner, difference.other) == (planner, other):
            return difference.acc_mean, ends
        if (difference.planner, difference.other) == (other, planner):
            return -difference.acc_mean, None if ends is None else (-ends[1], -ends[0])
    return None
