"""What is left to win, the longer the recogniser learned: runs that differ in the recogniser's clips, side by side."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from ehar.errors import DataError, UsageError
from ehar.files import parse_json, read_json, write_text
from eval.records.run_files import TABLE, check_no_run
from eval.render.figures import clean, save_figure
from eval.render.palette import BLUE, LIGHT, VERMILION
from eval.render.tables import Table, html, interval_text, markdown, text
from eval.running.run import Run, read_run_of_clips
from eval.scores.differences import NBV
from eval.scores.planner_summary import NO_ACT, ORACLE, PlannerSummary
from eval.scores.summary_table import basis_lines
from eval.studies.same_episodes import SAME_CONDITIONS, check_same_episodes
from planners.registry import needs_gain_model
from recognition.storage import LATER, SHIPPED, RecogniserDescription, recogniser_path, recogniser_sha256
from recognition.training.stopping import Evaluation
from recognition.weight_files import check_files, description_path


@dataclass(frozen=True)
class Learned:
    """A run, and how long its recogniser learned.

    Args:
        clips: clips of the training whose weights were kept.
        validation: accuracy of these weights on the validation clips, in [0, 1].
        rule: the best planner without a gain field or a policy, apart from `no-act`; None if there is none.
        run: the run.
    """

    clips: int
    validation: float
    rule: PlannerSummary | None
    run: Run

    def planner(self, name: str) -> PlannerSummary:
        """Return a planner's summary.

        Raises:
            UsageError: it did not run.
        """
        for planner in self.run.summary.planners:
            if planner.name == name:
                return planner
        names = ", ".join(planner.name for planner in self.run.summary.planners)
        raise UsageError(f"{self.run.folder}: expected a run with {name}, got {names}")


@dataclass(frozen=True, repr=False)
class LearningCurve:
    """Runs in the order of their recognisers' clips; it prints as a table, in a notebook as HTML.

    Args:
        planner: the planner that is shown beside `no-act`, the best rule and the oracle.
        runs: the runs.
    """

    planner: str
    runs: tuple[Learned, ...]

    def tables(self) -> list[Table]:
        """Return the table."""
        summary = self.runs[0].run.summary
        basis = basis_lines(summary.basis, summary.no_intervals)
        return [
            Table(
                title=f"{summary.title}: what is left to win, the longer the recogniser learned",
                header=(
                    *("clips", "validation", NO_ACT, "best rule", self.planner, ORACLE, f"{NO_ACT} to {ORACLE}"),
                    f"{self.planner} minus {NO_ACT} [95 %]",
                    f"{self.planner}: gap closed % [95 %]",
                ),
                rows=tuple(self._row(learned) for learned in self.runs),
                footnotes=(
                    *basis.footnotes,
                    "Clips are those of the weights that were kept, validation is their accuracy there. All accuracies "
                    "are means over frames in percent. A rule has neither a gain field nor a policy: fixed-best too.",
                    "The interval of the difference is corrected together with all pairs of its run.",
                ),
                notice=basis.notice,
            )
        ]

    def _row(self, learned: Learned) -> tuple[str, ...]:
        """Return the cells of a run."""
        planner, no_act, oracle = (learned.planner(name) for name in (self.planner, NO_ACT, ORACLE))
        pairs = {(pair.planner, pair.other): pair for pair in learned.run.summary.differences}
        pair = pairs.get((self.planner, NO_ACT))
        gap, ends = planner.gap_closed, planner.gap_closed_ci95
        return (
            f"{learned.clips:,}",
            f"{100 * learned.validation:.1f}",
            f"{no_act.acc_mean:.1f}",
            "-" if learned.rule is None else f"{learned.rule.acc_mean:.1f} ({learned.rule.name})",
            f"{planner.acc_mean:.1f}",
            f"{oracle.acc_mean:.1f}",
            f"{oracle.acc_mean - no_act.acc_mean:.1f}",
            f"{planner.acc_mean - no_act.acc_mean:+.1f}" + (f" {interval_text(pair.ci95_corrected)}" if pair else ""),
            "-"
            if gap is None
            else f"{100 * gap:.0f} {interval_text(None if ends is None else (100 * ends[0], 100 * ends[1]), 0)}",
        )

    def draw(self, stem: Path) -> None:
        """Draw accuracies against clips as `stem`.png and .svg."""
        figure = Figure(figsize=(5.6, 3.6), layout="constrained")
        axes: Any = figure.add_subplot()
        clips = [learned.clips for learned in self.runs]
        lines = (
            (f"{ORACLE} (privileged)", [learned.planner(ORACLE).acc_mean for learned in self.runs], LIGHT.text, "--"),
            (self.planner, [learned.planner(self.planner).acc_mean for learned in self.runs], VERMILION, "-"),
            (
                "best rule",
                [None if learned.rule is None else learned.rule.acc_mean for learned in self.runs],
                BLUE,
                "-",
            ),
            (NO_ACT, [learned.planner(NO_ACT).acc_mean for learned in self.runs], LIGHT.neutral, "-"),
        )
        for label, accuracies, colour, style in lines:
            axes.plot(clips, accuracies, style, marker="o", markersize=4, color=colour, label=label)
        axes.set_xscale("log", base=2)
        axes.set_xticks(clips, [f"{count / 1000:.0f}k" for count in clips])
        axes.minorticks_off()
        axes.set_xlabel("training clips of the recogniser")
        axes.set_ylabel("mean accuracy [%]")
        axes.legend(frameon=False, fontsize=8)
        clean(axes)
        axes.set_title(self.runs[0].run.summary.title, fontsize=9)
        save_figure(figure, stem)

    def __repr__(self) -> str:
        """Return one line: the clips of the runs."""
        return f"LearningCurve({self.planner}: {', '.join(f'{learned.clips:,}' for learned in self.runs)} clips)"

    def __str__(self) -> str:
        """Return the table."""
        return text(*self.tables())

    def _repr_html_(self) -> str:
        """Return the table for a notebook."""
        return "".join(map(html, self.tables()))


def learning(runs: Sequence[str | Path], *, planner: str = NBV, out: str | Path | None = None) -> LearningCurve:
    """Show what is left to win, the longer the recogniser learned.

    Args:
        runs: folders of finished runs with the same episodes and conditions, whose recognisers saw more or fewer clips.
        planner: the planner to show.
        out: folder for table.md and the picture.

    Raises:
        UsageError: a folder holds no run, the runs have other episodes or conditions, a planner is missing, or a
            recogniser's training went on from other weights; or `out` holds a run.
        DataError: files cannot be read, or a recogniser's file is not the one of the run.
    """
    if out is not None:
        check_no_run(Path(out))
    if len(runs) < 2:
        raise UsageError(f"learning: expected at least 2 folders of runs, got {len(runs)}")
    read = [read_run_of_clips(folder) for folder in runs]
    for run in read[1:]:
        check_same_episodes(read[0], run, also=SAME_CONDITIONS)
    found = LearningCurve(planner, tuple(sorted(map(_learned, read), key=lambda learned: learned.clips)))
    tables = found.tables()  # says which planner is missing before anything is written
    if out is not None:
        found.draw(Path(out) / "learning")
        write_text(Path(out) / TABLE, [markdown(*tables)])
    return found


def _learned(run: Run) -> Learned:
    """Return a run with how long its recogniser learned, from the description beside the recogniser's weights."""
    conditions = run.conditions
    if conditions.recogniser is not None:
        raise UsageError(f"{run.folder}: expected a recogniser of ehar, got {conditions.recogniser}")
    folder = conditions.directory or SHIPPED / run.config.data.split(" (")[0]
    path = recogniser_path(folder, conditions)
    check_files(path, f"the recogniser of {run.folder}")
    description = read_json(description_path(path), RecogniserDescription, "a recogniser's description", optional=LATER)
    if recogniser_sha256(path, description.temperature) != run.config.recogniser_sha256:
        raise DataError(f"{path}: expected the recogniser of {run.folder}, got another one: it was trained since")
    if description.training.get("run", {}).get("init_sha256") is not None:
        raise UsageError(
            f"{path}: expected a training that began at nothing, got one that went on from other weights (--init): "
            f"how many clips those had seen is not known"
        )
    held = json.dumps(description.training.get("evaluations", []))
    evaluations = parse_json(held, tuple[Evaluation, ...], str(path), "the evaluations of a training")
    if not evaluations:
        raise DataError(f"{path}: expected the evaluations of the training, got none")
    top = max(one.accuracy for one in evaluations)
    best = next(one for one in reversed(evaluations) if one.accuracy == top)
    rules = [one for one in run.summary.planners if not (one.privileged or one.training_seeds or one.name == NO_ACT)]
    rules = [one for one in rules if not needs_gain_model(one.name)]
    return Learned(best.clips, top, max(rules, key=lambda one: one.acc_mean, default=None), run)
