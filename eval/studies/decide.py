"""Deciding once: when each activity of a finished run is best answered, if waiting costs."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ehar.arrays import FloatArray
from ehar.data.recordings import UNKNOWN_SUBJECT
from ehar.data.source import load_data
from ehar.errors import DataError, UsageError
from ehar.files import write_text
from eval.records.episodes import EpisodeRecords
from eval.render.figures import clean, save_figure
from eval.render.palette import BLUE, GREEN, LIGHT, LINE, STRONG, THIN, VERMILION
from eval.render.tables import PRIVILEGED, Table, html, interval_text, markdown, text
from eval.running.run import Run, read_run
from eval.scores.deciding.curves import (
    FIXED_TIME,
    INDUCTION,
    SPRT,
    THRESHOLD,
    Curve,
    DecidingOnce,
    WorthDifference,
    deciding_once,
    fit_rules,
    without_second,
)
from eval.scores.differences import NBV, excludes_zero
from eval.scores.planner_summary import NO_ACT, ORACLE
from eval.scores.resampling.training_seeds import curves as accuracy_curves
from eval.scores.resampling.training_seeds import group_planners
from eval.scores.summary_table import TOGETHER, BasisLines, basis_lines
from eval.studies.same_episodes import label, shown

DEFAULTS = (NO_ACT, NBV, ORACLE)  # as far as they ran
SAME_WORDS = (  # what decides what is said in a frame, beside part, starts and seed
    *("data_sha256", "recogniser_sha256", "sensor", "sensor_sha256", "views", "form", "readout", "track"),
    *("track_sha256", "length", "fps", "world"),
)
COLOURS = {FIXED_TIME: LIGHT.text, THRESHOLD: BLUE, SPRT: GREEN, INDUCTION: VERMILION}
MARKERS = {FIXED_TIME: "o", THRESHOLD: "s", SPRT: "^", INDUCTION: "D"}


@dataclass(frozen=True, repr=False)
class Deciding:
    """What deciding once is worth in a run; it prints as tables, in a notebook as HTML.

    Args:
        run: the run.
        fitted_on: the run that the rules were fitted on.
        fitted_with: names of the planners whose episodes they were fitted on.
        planners: whether each planner that is shown was handed the truth, by name.
        accuracy: accuracy of each after every frame (L,), 0 to 1.
        seconds: duration of a frame [s].
        found: what was found.
    """

    run: Run
    fitted_on: Run
    fitted_with: tuple[str, ...]
    planners: dict[str, bool]
    accuracy: dict[str, FloatArray]
    seconds: float
    found: DecidingOnce

    def tables(self) -> list[Table]:
        """Return the tables: for each planner its answers and how rules differ, and then how planners differ."""
        basis = basis_lines(self.found.basis, self.found.no_intervals)
        tables = []
        for planner in self.planners:
            tables += [self._answers(planner, basis), self._rules(planner, basis)]
        return [*tables, *self._planners(basis)]

    def _named(self, planner: str) -> str:
        return planner + PRIVILEGED * self.planners[planner]

    def _answers(self, planner: str, basis: BasisLines) -> Table:
        """Return accuracy and time of a planner at every price."""
        of_rule = {curve.rule: curve for curve in self.found.curves if curve.planner == planner}
        rows = zip(*(curve.points for curve in of_rule.values()), strict=True)
        return Table(
            title=f"{self.run.config.title}: {self._named(planner)} decides once, accuracy in percent [95 %] and time",
            header=("points/s", *of_rule),
            rows=tuple(
                (
                    f"{points[0].price:g}",
                    *(
                        f"{point.accuracy:.1f} {interval_text(point.accuracy_ci95)} in {point.seconds:.2f} s"
                        for point in points
                    ),
                )
                for points in rows
            ),
            footnotes=(
                *basis.footnotes,
                "A row is a price of waiting, for which each rule is fitted. The time is the mean over episodes.",
                *self._footnotes(),
            ),
            notice=basis.notice,
        )

    def _rules(self, planner: str, basis: BasisLines) -> Table:
        """Return how much more the last rules are worth than the first ones."""
        found = self.found.rules[planner]
        pairs = list(dict.fromkeys((of.one[1], of.other[1]) for of in found))
        return _differences_table(
            f"{self._named(planner)}: what answers of one rule are worth more than those of another, in points [95 %]",
            tuple(f"{one} - {other}" for one, other in pairs),
            found,
            basis,
        )

    def _planners(self, basis: BasisLines) -> Iterator[Table]:
        """Yield how much more each planner is worth than no-act."""
        for planner, found in self.found.planners.items():
            yield _differences_table(
                f"What answers of {planner} are worth more than those of {NO_ACT}, by the same rule, in points [95 %]",
                tuple(dict.fromkeys(of.one[1] for of in found)),
                found,
                basis,
            )

    def _footnotes(self) -> Iterator[str]:
        """Yield on whom the rules were fitted."""
        episodes = sum(len(self.fitted_on.episodes(name)) for name in self.fitted_with)
        yield (
            f"Rules were fitted on {episodes} episodes of {' and '.join(self.fitted_with)} on the "
            f"{self.fitted_on.conditions.part} part, and are the same for every planner."
        )
        people, known = (_people(run) for run in (self.run, self.fitted_on))
        if people is None or known is None:
            yield "The data do not say whether other people performed there."
        elif people & known:
            yield f"{len(people & known)} of the {len(people)} people performed there too."
        if SPRT not in {curve.rule for curve in self.found.curves}:
            yield f"Without {SPRT}: a run is from before the second most probable class was recorded."
        if any(self.planners.values()):
            yield f"{PRIVILEGED} privileged: is handed the label and the future."

    def draw(self, stem: Path) -> None:
        """Draw accuracy against time, a panel for each planner, as `stem`.png and .svg."""
        figure = Figure(figsize=(0.9 + 3.2 * len(self.planners), 3.6), layout="constrained")
        panels: Any = figure.subplots(1, len(self.planners), sharex=True, sharey=True, squeeze=False)[0]
        for axes, planner in zip(panels, self.planners, strict=True):
            frames = self.seconds * np.arange(1, len(self.accuracy[planner]) + 1)
            axes.plot(
                frames, 100 * self.accuracy[planner], color=LIGHT.neutral, linewidth=THIN, label="after each frame"
            )
            for curve in self.found.curves:
                if curve.planner == planner:
                    _draw_curve(axes, curve)
            axes.set_title(planner + " (privileged)" * self.planners[planner], fontsize=9)
            axes.set_xlabel("mean time of an answer [s]")
            clean(axes)
        panels[0].set_ylabel("right answers [%]")
        panels[-1].legend(frameon=False, fontsize=8, loc="lower right")
        figure.suptitle(self.run.config.title, fontsize=9, x=0.01, ha="left")
        save_figure(figure, stem)

    def __repr__(self) -> str:
        """Return one line: the planners, and the run that rules were fitted on."""
        return f"Deciding({self.run.config.title}: {', '.join(self.planners)}; fitted on {self.fitted_on.directory})"

    def __str__(self) -> str:
        """Return the tables."""
        return text(*self.tables())

    def _repr_html_(self) -> str:
        """Return the tables for a notebook."""
        return "".join(map(html, self.tables()))


def decide(
    run: str | Path,
    *,
    fitted_on: str | Path,
    planners: Sequence[str] = (),
    data: str | Path | None = None,
    out: str | Path | None = None,
) -> Deciding:
    """Say when each activity of a finished run is best answered, if it is answered once and waiting costs.

    Args:
        run: folder of a finished run.
        fitted_on: folder of a run on another part of the same data, whose episodes the rules are fitted on.
        planners: planners to show; none takes no-act, nbv and oracle as far as they ran.
        data: path of the run's data; None takes the path in config.json.
        out: folder for table.md and the picture.

    Raises:
        UsageError: a folder holds no run, a planner did not run, or the runs are of the same part or of other
            conditions.
        DataError: files cannot be read, or the data are not those of the run.
    """
    scored, fitted = read_run(run), read_run(fitted_on)
    _check_other_part(scored, fitted)
    seconds = 1 / _frame_rate(scored, data)
    privileged = {planner.name: planner.privileged for planner in scored.summary.planners}
    chosen = tuple(planners) or tuple(name for name in DEFAULTS if name in privileged) or tuple(privileged)
    for name in chosen:
        scored.episodes(name)  # names the planners of the run if this is none of them
    told = {planner.name for planner in fitted.summary.planners if planner.privileged}
    learners = tuple(group.name for group in group_planners(fitted.records) if group.name not in told)
    if not learners:
        raise UsageError(
            f"{fitted.folder}: expected a planner without the truth to fit rules on, got {', '.join(told)}"
        )
    shown_records = _records_of(scored, chosen)
    fitting = [fitted.episodes(name) for name in learners]
    second = all(held.second_probability is not None for held in (*shown_records.values(), *fitting))
    if not second:
        shown_records = {name: without_second(held) for name, held in shown_records.items()}
    tested = [name for name in chosen if name != NO_ACT and not privileged[name]] if NO_ACT in chosen else []
    found = Deciding(
        run=scored,
        fitted_on=fitted,
        fitted_with=learners,
        planners={name: privileged[name] for name in chosen},
        accuracy=accuracy_curves(shown_records),
        seconds=seconds,
        found=deciding_once(
            shown_records, fit_rules(fitting, seconds, second=second), seconds, against=NO_ACT, tested=tested
        ),
    )
    if out is not None:
        write_text(Path(out) / "table.md", [markdown(*found.tables())])
        found.draw(Path(out) / "deciding")
    return found


def _check_other_part(scored: Run, fitted: Run) -> None:
    """Raise a UsageError unless rules can be fitted on one run and scored on the other."""
    where = f"{scored.directory} and {fitted.directory}"
    in_scored, in_fitted = scored.config.to_json(), fitted.config.to_json()
    differing = [name for name in SAME_WORDS if in_scored[name] != in_fitted[name]]
    if differing:
        got = ", ".join(f"{label(name)} ({shown(name, in_scored)}, {shown(name, in_fitted)})" for name in differing)
        raise UsageError(f"{where}: expected runs on two parts of the same data; they differ in {got}")
    if in_scored["part"] == in_fitted["part"]:
        part = in_scored["part"]
        raise UsageError(
            f"{where}: expected rules to be fitted on another part than they are scored on, got {part} twice"
        )
    names = [set(next(iter(run.records.values())).sequence) for run in (scored, fitted)]
    if names[0] & names[1]:
        raise DataError(f"{where}: expected parts that share no sequence, got {min(names[0] & names[1])!r} in both")


def _frame_rate(run: Run, source: str | Path | None) -> float:
    """Return the frames per second of a run: what it was told, or else that of its data."""
    told = run.conditions
    if told.fps is not None:
        return told.fps
    place = told.data if source is None else source
    held = load_data(str(place))
    if held.sha256 != run.config.data_sha256:
        raise DataError(f"{place}: expected the data of {run.folder}, got others")
    return held.fps


def _records_of(run: Run, planners: Sequence[str]) -> dict[str, EpisodeRecords]:
    """Return the records of planners, by record name, in the order of the planners."""
    groups = {group.name: group.records for group in group_planners(run.records)}
    names = [name for planner in planners for name in groups.get(planner, (planner,))]
    return {name: run.records[name] for name in names}


def _people(run: Run) -> set[int] | None:
    """Return who performs in a run; None if the data do not name everybody."""
    people = set(next(iter(run.records.values())).subjects.ravel().tolist())
    return None if UNKNOWN_SUBJECT in people else people


def _differences_table(
    title: str, header: tuple[str, ...], found: Sequence[WorthDifference], basis: BasisLines
) -> Table:
    """Return a table of differences: a row for each price, a column for each kind, in the order of the differences."""
    prices = list(dict.fromkeys(of.price for of in found))
    columns = [found[start : start + len(prices)] for start in range(0, len(found), len(prices) or 1)]
    return Table(
        title=title,
        header=("points/s", *header),
        rows=tuple(
            (
                f"{price:g}",
                *(f"{column[at].points:+.1f} {interval_text(column[at].ci95_corrected)}" for column in columns),
            )
            for at, price in enumerate(prices)
        ),
        footnotes=(
            "Worth: accuracy in percent, less the price of the mean time. Bold: the interval excludes zero. "
            f"{TOGETHER}",
            *basis.footnotes,
        ),
        bold=frozenset(
            (at, number)
            for number, column in enumerate(columns, 1)
            for at, of in enumerate(column)
            if of.ci95_corrected is not None and excludes_zero(of.ci95_corrected)
        ),
        notice=basis.notice,
    )


def _draw_curve(axes: Any, curve: Curve) -> None:
    """Draw a curve with the intervals of its points."""
    time, accuracy = (np.array([getattr(point, name) for point in curve.points]) for name in ("seconds", "accuracy"))
    ends = [point.accuracy_ci95 for point in curve.points]
    colour = COLOURS[curve.rule]
    if all(of is not None for of in ends):
        axes.vlines(time, *np.array(ends).T, color=colour, linewidth=THIN, alpha=0.35)
    axes.plot(
        time,
        accuracy,
        color=colour,
        marker=MARKERS[curve.rule],
        markersize=4,
        linewidth=STRONG if curve.rule == INDUCTION else LINE,
        linestyle="" if curve.rule == FIXED_TIME else "-",
        label=curve.rule,
    )
