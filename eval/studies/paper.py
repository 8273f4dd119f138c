"""The paper's tables of a finished run, for every planner that ran, from its records; and where its figures are."""

from collections.abc import Sequence
from pathlib import Path
from shlex import quote

from ehar.errors import UsageError
from ehar.files import write_text
from eval.render.tables import PRIVILEGED, Table, interval_text, markdown
from eval.running.progress import ConsoleReporter, Reporter
from eval.running.run import Run, class_names, read_run_of_clips
from eval.scores.metrics import ACC_AT, frame_at
from eval.scores.planner_accuracy import accuracy_bands, draw_resamples, planner_accuracy
from eval.scores.predictability import predictability
from eval.scores.resampling.statistics import pair
from eval.scores.resampling.training_seeds import group_planners
from eval.scores.seed_accuracy import TABLE_3, accuracy_over_seeds, pool_seeds, seeds_of
from eval.studies.behaviour.analyse import FOLDER
from eval.studies.behaviour.analysis import (
    MOVES_MADE,
    POSITIONS,
    STATES,
    class_accuracy_table,
    classes_table,
    seeds_table,
    spread_text,
)

CURVES = "accuracy.png"  # in the run's folder


def paper(
    runs: Sequence[str | Path], *, out: str | Path | None = None, reporter: Reporter | None = None
) -> list[Table]:
    """Return the paper's tables of some runs, one run after another.

    Args:
        runs: folders of finished runs: one for each data set, and one with the agents of Table 3.
        out: Markdown file to write too.
        reporter: receives notes; None reports on standard error.

    Raises:
        EharError: one line that says what was got and what was expected.
    """
    reporter = reporter or ConsoleReporter()
    if not runs:
        raise UsageError("paper: expected at least one folder of a run")
    finished = [read_run_of_clips(run) for run in runs]
    tables = [table for run in finished for table in paper_tables(run, class_names(run, reporter.note))]
    if out is not None:
        write_text(Path(out), [markdown(*tables)])
    return tables


def paper_tables(run: Run, names: tuple[str, ...]) -> list[Table]:
    """Return Tables 1 or 2, 3 and 4 of a run, as far as their planners ran, and the places of Figures 5 to 7."""
    seeds = seeds_of(run.records)
    ablated = [accuracy_over_seeds(name, seeds[name]) for name in TABLE_3 if name in seeds]
    predictable = {name: predictability(episodes, len(names)) for name, episodes in pool_seeds(run.records).items()}
    return [
        accuracy_table(run),
        *([seeds_table(ablated)] if len(ablated) > 1 else []),
        classes_table(predictable, names),
        class_accuracy_table(predictable, names),
        figures_table(run),
    ]


def accuracy_table(run: Run) -> Table:
    """Return Table 1 or 2: the accuracy of every planner at each observation ratio, and the mean over frames."""
    resamples = draw_resamples(list(run.records.values()), group_planners(run.records))
    bands = accuracy_bands(run.records, resamples)
    seeds = seeds_of(run.records)
    privileged = {planner.name for planner in run.config.planners if planner.privileged}
    rows = []
    for group in group_planners(run.records):
        held = accuracy_over_seeds(group.name, seeds[group.name], at=ACC_AT)
        means = planner_accuracy(group, run.records, resamples)
        length = bands[group.name].shape[0]
        ends = [100 * bands[group.name][frame_at(percent, length)] for percent in ACC_AT]
        cells = (
            f"{spread_text(held.acc[str(percent)])} {interval_text(pair(end))}"
            for percent, end in zip(ACC_AT, ends, strict=True)
        )
        around = resamples.interval(means.mean, means.resampled, bounds=(0, 1))
        mean = f"{spread_text(held.acc_mean)} {interval_text(pair(100 * around))}"
        mark = PRIVILEGED * any(record in privileged for record in group.records)
        rows.append((group.name + mark, str(len(group.records)), *cells, mean))
    return Table(
        title=f"{run.config.title}: accuracy against observation ratio (Tables 1 and 2), in percent [95 %]",
        header=("planner", "trainings", *(f"acc@{percent}" for percent in ACC_AT), "mean acc"),
        rows=tuple(rows),
        footnotes=(
            "Behind ± stands the standard deviation over trainings, as in the paper; intervals are a bootstrap over "
            "people, their sequences and, where there are several, trainings.",
            f"{PRIVILEGED} privileged: is handed the label and the future.",
            *([f"No intervals: {resamples.why_none}."] if resamples.why_none else []),
        ),
    )


def figures_table(run: Run) -> Table:
    """Return where Figures 5 to 7 of a run are, or the command that draws them."""
    folder = run.folder
    learned = [name for name in run.records if "/" in name]
    shown = next((name for name in learned if name.startswith("il-ppo/")), learned[0] if learned else None)
    options = "" if shown is None or run.flown else f" --planners {shown.partition('/')[0]} --states {shown}"
    command = f"`ehar study analyse {quote(str(folder))}{options}`"
    figures = (
        ("5: accuracy against observation ratio", folder / CURVES, "`ehar benchmark`"),
        ("6: distance, azimuth, polar angle", folder / FOLDER / POSITIONS, command),
        ("7a-d: moves, by stage", folder / FOLDER / MOVES_MADE, command),
        ("7e: states of a learned planner", folder / FOLDER / STATES, command),
    )
    return Table(
        title=f"{run.config.title}: Figures 5 to 7",
        header=("figure", "file"),
        rows=tuple((name, str(path) if path.is_file() else f"made by {made}") for name, path, made in figures),
        footnotes=(),
        words=frozenset({1}),
    )
