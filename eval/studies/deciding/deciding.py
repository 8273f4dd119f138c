"""What deciding once is worth in a run, as tables."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ehar.data.recordings import UNKNOWN_SUBJECT
from eval.render.tables import PRIVILEGED, Table, html, interval_text, text
from eval.running.run import Run
from eval.scores.deciding.curves import SPRT, DecidingOnce, WorthDifference
from eval.scores.differences import excludes_zero
from eval.scores.planner_summary import NO_ACT
from eval.scores.summary_table import TOGETHER, BasisLines, basis_lines


@dataclass(frozen=True, repr=False)
class Deciding:
    """What deciding once is worth in a run; it prints as tables, in a notebook as HTML.

    Args:
        run: the run.
        fitted_on: the run that the rules were fitted on; None of folds, each of which has the others.
        fitted_with: names of the planners whose episodes they were fitted on.
        fitted_activities: number of activities that they were fitted on, clips or activities of streams.
        planners: whether each planner that is shown was handed the truth, by name.
        found: what was found.
    """

    run: Run
    fitted_on: Run | None
    fitted_with: tuple[str, ...]
    fitted_activities: int
    planners: dict[str, bool]
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
                "A row is a price of waiting, for which each rule is fitted. The time is the mean over "
                f"{self._activities}.",
                *self._footnotes(),
            ),
            notice=basis.notice,
        )

    def _rules(self, planner: str, basis: BasisLines) -> Table:
        """Return how much more the last rules are worth than the first ones."""
        found = self.found.rules[planner]
        pairs = list(dict.fromkeys((difference.one[1], difference.other[1]) for difference in found))
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
                tuple(dict.fromkeys(difference.one[1] for difference in found)),
                found,
                basis,
            )

    @property
    def _activities(self) -> str:
        return "activities" if self.run.of_streams else "episodes"

    def _footnotes(self) -> Iterator[str]:
        """Yield on whom the rules were fitted."""
        *others, last = self.fitted_with
        learners, count = (
            " and ".join(filter(None, (", ".join(others), last))),
            f"{self.fitted_activities} {self._activities}",
        )
        where = "" if self.fitted_on is None else f" on the {self.fitted_on.conditions.part} part"
        yield f"Rules were fitted on {count} of {learners}{where}, and are the same for every planner."
        if self.run.of_streams:
            told = " is told it too" * (self.run.conditions.onset == "known") or " is not told"
            yield (
                f"Rules count from an activity's onset, which they know; the recogniser{told}. While its word is no "
                "activity, a rule waits. Who has not answered when the activity ends is told so, and answers with the "
                "last word; if that is no activity, nothing is answered."
            )
        people, known = (None if run is None else _people(run) for run in (self.run, self.fitted_on))
        if self.fitted_on is None:
            yield "The rules of each fold were fitted on the others."
        elif people is None or known is None:
            yield "The data do not say whether other people performed there."
        elif people & known:
            yield f"{len(people & known)} of the {len(people)} people performed there too."
        if SPRT not in {curve.rule for curve in self.found.curves}:
            yield f"Without {SPRT}: a run is from before the second most probable class was recorded."
        if any(self.planners.values()):
            yield f"{PRIVILEGED} privileged: is handed the label and the future."

    def __repr__(self) -> str:
        """Return one line: the planners, and the run that rules were fitted on."""
        on = "other folds" if self.fitted_on is None else self.fitted_on.directory
        return f"Deciding({self.run.config.title}: {', '.join(self.planners)}; fitted on {on})"

    def __str__(self) -> str:
        """Return the tables."""
        return text(*self.tables())

    def _repr_html_(self) -> str:
        """Return the tables for a notebook."""
        return "".join(map(html, self.tables()))


def _people(run: Run) -> set[int] | None:
    """Return who performs in a run; None if the data do not name everybody."""
    people = set(next(iter(run.records.values())).subjects.ravel().tolist())
    return None if UNKNOWN_SUBJECT in people else people


def _differences_table(
    title: str, header: tuple[str, ...], found: Sequence[WorthDifference], basis: BasisLines
) -> Table:
    """Return a table of differences: a row for each price, a column for each kind, in the order of the differences."""
    prices = list(dict.fromkeys(difference.price for difference in found))
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
            for at, difference in enumerate(column)
            if difference.ci95_corrected is not None and excludes_zero(difference.ci95_corrected)
        ),
        notice=basis.notice,
    )
