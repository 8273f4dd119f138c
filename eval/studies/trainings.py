"""Several trainings of recogniser and gain field in one table: the same episodes and conditions, other weights."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from ehar.errors import UsageError
from ehar.files import json_text, write_text
from eval.records.run_files import SUMMARY
from eval.render.tables import NONE, PRIVILEGED, Table, html, interval_text, markdown, p_text, text
from eval.running.run import Run, read_run
from eval.scores.differences import NBV
from eval.scores.summary_table import TOGETHER, basis_lines
from eval.scores.trainings import TrainedDifference, TrainedPlanner, TrainingsSummary, summarise_trainings
from eval.studies.same_episodes import SAME_CONDITIONS, check_same_episodes

LEAST = 3  # trainings behind a claim


@dataclass(frozen=True, repr=False)
class Trainings:
    """Several trainings of recogniser and gain field; it prints as a table, in a notebook as HTML.

    Args:
        folders: folders of the runs, one for each training.
        title: data, conditions and episodes of the runs.
        planner: the planner that is compared with the others.
        summary: the results.
    """

    folders: tuple[Path, ...]
    title: str
    planner: str
    summary: TrainingsSummary

    def tables(self) -> list[Table]:
        """Return the table of the trainings."""
        return [trainings_table(self)]

    def __repr__(self) -> str:
        """Return one line: the runs, and the number of planners."""
        return f"Trainings({', '.join(map(str, self.folders))}: {len(self.summary.planners)} planners)"

    def __str__(self) -> str:
        """Return the table."""
        return text(*self.tables())

    def _repr_html_(self) -> str:
        """Return the table for a notebook."""
        return "".join(map(html, self.tables()))


def trainings(runs: Sequence[str | Path], *, planner: str = NBV, out: str | Path | None = None) -> Trainings:
    """Take runs of several trainings together: means, intervals that cover trainings, and the spread over them.

    Args:
        runs: folders of finished runs, one for each training of recogniser and gain field.
        planner: the planner that is compared with each other one.
        out: folder for table.md and summary.json.

    Raises:
        UsageError: a folder holds no run; the runs have other episodes or conditions, or the same weights; or the
            planner did not run in all of them.
        DataError: files cannot be read, or their episodes are not those of config.json.
    """
    if len(runs) < 2:
        raise UsageError(f"trainings: expected at least 2 folders of runs, got {len(runs)}")
    read = [read_run(folder) for folder in runs]
    for row, run in enumerate(read):
        for before in read[:row]:
            check_same_episodes(before, run, also=SAME_CONDITIONS)
            if before.config.recogniser_sha256 == run.config.recogniser_sha256:
                raise UsageError(
                    f"{before.directory} and {run.directory}: expected other trainings of the recogniser, got the same"
                )
    privileged = {planner.name: planner.privileged for run in read for planner in run.summary.planners}
    found = Trainings(
        folders=tuple(run.folder for run in read),
        title=_title(read),
        planner=planner,
        summary=summarise_trainings([run.scored for run in read], privileged, planner),
    )
    if out is not None:
        held = {"folders": [str(folder) for folder in found.folders], "title": found.title, "planner": planner}
        write_text(Path(out) / SUMMARY, [json_text({**held, **asdict(found.summary)})])
        write_text(Path(out) / "table.md", [markdown(*found.tables())])
    return found


def _title(runs: Sequence[Run]) -> str:
    return f"{runs[0].summary.title}, {len(runs)} trainings of recogniser and gain field"


def trainings_table(found: Trainings) -> Table:
    """Return a row for each planner: accuracy, gap closed and the difference to the compared planner."""
    summary, planner = found.summary, found.planner
    differences = {of.difference.other: of for of in summary.differences}
    basis = basis_lines(summary.basis, summary.no_intervals)
    few = f"Only {summary.trainings} trainings: a claim takes at least {LEAST}." if summary.trainings < LEAST else ""
    column = 3
    return Table(
        title=found.title,
        header=("planner", "mean acc [95 %]", "gap closed % [95 %]", f"{planner} minus it [95 %]", "p"),
        rows=tuple(_row(one, differences.get(one.name)) for one in summary.planners),
        footnotes=(*basis.footnotes, *_footnotes(summary)),
        bold=frozenset(
            (row, column)
            for row, one in enumerate(summary.planners)
            if one.name in differences and differences[one.name].difference.is_clear
        ),
        notice=" ".join(filter(None, (basis.notice, few))),
    )


def _row(planner: TrainedPlanner, of: TrainedDifference | None) -> tuple[str, ...]:
    """Return the cells of a planner."""
    gap = NONE
    if planner.gap_closed is not None and planner.gap_closed_sd is not None:
        ends = planner.gap_closed_ci95
        scaled = None if ends is None else (100 * ends[0], 100 * ends[1])
        gap = f"{100 * planner.gap_closed:.1f} ± {100 * planner.gap_closed_sd:.1f} {interval_text(scaled)}"
    return (
        planner.name + PRIVILEGED * planner.privileged,
        f"{planner.acc_mean:.1f} ± {planner.acc_mean_sd:.1f} {interval_text(planner.acc_mean_ci95)}",
        gap,
        ""
        if of is None
        else f"{of.difference.acc_mean:+.1f} ± {of.sd:.1f} {interval_text(of.difference.ci95_corrected)}",
        "" if of is None else p_text(of.difference.p_corrected),
    )


def _footnotes(summary: TrainingsSummary) -> Iterator[str]:
    """Yield what the numbers are."""
    yield (
        f"Numbers are means over {summary.trainings} trainings, behind ± stands the standard deviation over them. "
        "Intervals draw people, sequences and trainings."
    )
    yield f"Bold: the interval excludes zero. {TOGETHER} So is p, the chance of such a difference if there is none."
    if any(planner.privileged for planner in summary.planners):
        yield f"{PRIVILEGED} privileged: is handed the label and the future."
