"""Accuracy against time over prices of waiting: a curve for each rule and planner, with intervals over people."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from eval.scores.deciding.fit import Seen, fit_fixed_time, fit_induction, fit_sprt, fit_threshold
from eval.scores.deciding.rules import ByFold, Rule, decide, waited, worth
from eval.scores.resampling.resamples import Basis, Resamples
from eval.scores.resampling.statistics import Interval, pair
from eval.scores.resampling.training_seeds import PlannerGroup, group_planners, resample_seeds

PRICES = (1.0, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0, 70.0, 100.0, 200.0)  # of waiting [points/s]
FIXED_TIME, THRESHOLD, SPRT, INDUCTION = "fixed time", "threshold", "sprt", "induction"
RULES: Mapping[str, Callable[[Seen, float], Rule]] = {
    FIXED_TIME: fit_fixed_time,
    THRESHOLD: fit_threshold,
    SPRT: fit_sprt,
    INDUCTION: fit_induction,
}
RIVALS = ((SPRT, FIXED_TIME), (SPRT, THRESHOLD), (INDUCTION, FIXED_TIME), (INDUCTION, THRESHOLD))


@dataclass(frozen=True)
class Point:
    """The answers of a rule that is fitted to a price.

    Args:
        price: of waiting [points/s].
        accuracy: share of right answers [%].
        accuracy_ci95: its 95 % interval over people, sequences and, where there are several, trainings; None without
            resamples.
        seconds: mean time of an answer [s].
        worth: accuracy less the price of the mean time [points].
    """

    price: float
    accuracy: float
    accuracy_ci95: Interval | None
    seconds: float
    worth: float


@dataclass(frozen=True)
class Curve:
    """One rule, one planner, all prices.

    Args:
        planner: name of the planner.
        rule: name of the rule.
        points: in the order of the prices.
    """

    planner: str
    rule: str
    points: tuple[Point, ...]


class AnswerCourse(NamedTuple):
    """The words of a planner frame by frame, if every activity is answered after the same one.

    Args:
        time: (T,) mean time of these answers [s]; an activity that has ended by then is answered at its end.
        right: (T,) share of right answers, 0 to 1.
    """

    time: FloatArray
    right: FloatArray


@dataclass(frozen=True)
class WorthDifference:
    """How much more one kind of answers is worth than another at a price, on the same episodes.

    Args:
        price: of waiting [points/s].
        one: planner and rule whose worth is the minuend.
        other: planner and rule whose worth is taken away.
        points: the difference of their worth [points].
        ci95_corrected: its 95 % interval, corrected together with all differences of its table; None without resamples.
    """

    price: float
    one: tuple[str, str]
    other: tuple[str, str]
    points: float
    ci95_corrected: Interval | None


@dataclass(frozen=True)
class DecidingOnce:
    """What deciding once is worth.

    Args:
        curves: planner by planner, rule by rule.
        courses: by planner, what its words are worth frame by frame.
        rules: by planner, what the first rule of each of `RIVALS` is worth more than the other.
        planners: by planner, what it is worth more, by the same rule, than the one that others are compared with.
        basis: the people and sequences that intervals rest on.
        no_intervals: why there are none; None if there are.
    """

    curves: tuple[Curve, ...]
    courses: Mapping[str, AnswerCourse]
    rules: Mapping[str, tuple[WorthDifference, ...]]
    planners: Mapping[str, tuple[WorthDifference, ...]]
    basis: Basis
    no_intervals: str | None


def fit_rules(seen: Seen, prices: Sequence[float] = PRICES) -> dict[str, tuple[Rule, ...]]:
    """Return the rules by name, each fitted to every price.

    Args:
        seen: activities of all planners together, so that every planner is judged by the same rule. If the second most
            probable class is not known, there is no `sprt`.
        prices: of waiting [points/s].
    """
    known = seen.words.second is not None
    return {name: tuple(fit(seen, price) for price in prices) for name, fit in RULES.items() if known or name != SPRT}


def fit_across(
    seen: Seen, fold: IntArray, scored: IntArray, prices: Sequence[float] = PRICES
) -> dict[str, tuple[Rule, ...]]:
    """Return rules by name for activities of folds, which are each answered by what the other folds taught.

    Args:
        seen: activities of all planners together; see `fit_rules`.
        fold: (B,) the fold of each.
        scored: (M,) the fold of each activity that is to be answered.
        prices: of waiting [points/s].
    """
    of_fold = [fit_rules(seen.select(fold != number), prices) for number in range(scored.max() + 1)]
    return {
        name: tuple(ByFold(rules, scored) for rules in zip(*(each[name] for each in of_fold), strict=True))
        for name in of_fold[0]
    }


def deciding_once(
    seen: Mapping[str, Seen],
    rules: Mapping[str, Sequence[Rule]],
    resamples: Resamples,
    prices: Sequence[float] = PRICES,
    *,
    against: str,
    tested: Sequence[str],
) -> DecidingOnce:
    """Return what the answers of rules are worth.

    Args:
        seen: what each planner saw of the same activities, by record name.
        rules: rules by name, one for each price.
        resamples: resamples of the people and sequences of these activities.
        prices: of waiting [points/s].
        against: name of the planner that others are compared with.
        tested: names of the planners that are compared with it.
    """
    curves, courses, worths = [], {}, {}
    for group in group_planners(seen):
        trainings = [seen[name] for name in group.records]
        courses[group.name] = _course(trainings)
        for rule, fitted in rules.items():
            answers = _answers(trainings, fitted)
            value = _over_people(worth(answers.right, answers.time, np.array(prices)[:, None, None]), group, resamples)
            curves.append(_curve(group, rule, prices, answers, value, resamples))
            worths[group.name, rule] = value
    rivals = [(one, other) for one, other in RIVALS if {one, other} <= rules.keys()]
    planners = dict.fromkeys(planner for planner, _ in worths)
    return DecidingOnce(
        curves=tuple(curves),
        courses=courses,
        rules={
            planner: _differences(
                [((planner, one), (planner, other)) for one, other in rivals], worths, prices, resamples
            )
            for planner in planners
        },
        planners={
            planner: _differences([((planner, rule), (against, rule)) for rule in rules], worths, prices, resamples)
            for planner in tested
        },
        basis=resamples.basis,
        no_intervals=resamples.why_none,
    )


class _Answers(NamedTuple):
    """The answers of the G trainings of a planner, by a rule that is fitted to each price."""

    right: BoolArray  # (prices, G, N)
    time: FloatArray  # (prices, G, N) [s]


class _Statistic(NamedTuple):
    """A mean over episodes and trainings at each price."""

    mean: FloatArray  # (prices,)
    resampled: FloatArray  # (prices, rows), the same in every row of the resamples


def _course(trainings: Sequence[Seen]) -> AnswerCourse:
    """Return the mean course over the activities of all trainings, which are the same."""
    words = trainings[0].words
    frame = np.minimum(np.arange(words.shown.shape[1]), words.last[:, None])
    right = [np.take_along_axis(seen.right, frame, axis=1).mean(axis=0) for seen in trainings]
    return AnswerCourse((frame + 1).mean(axis=0) * trainings[0].seconds, np.mean(right, axis=0))


def _answers(trainings: Sequence[Seen], rules: Sequence[Rule]) -> _Answers:
    """Return what the rules, one for each price, answer."""
    decided = [[(decide(rule, seen.words), seen) for seen in trainings] for rule in rules]
    return _Answers(
        np.array([[one.answer == seen.label for one, seen in of_price] for of_price in decided]),
        np.array([[waited(one, seen.seconds) for one, seen in of_price] for of_price in decided]),
    )


def _over_people(values: FloatArray, group: PlannerGroup, resamples: Resamples) -> _Statistic:
    """Return the mean of values (prices, G, N), and in every resample of people, sequences and trainings."""
    alone = replace(group, rows=tuple(range(values.shape[1])))
    resampled = [resample_seeds(of_price, [alone], resamples)[0] for of_price in resamples.means(values)]
    return _Statistic(values.mean(axis=(1, 2)), np.stack(resampled))


def _curve(
    group: PlannerGroup,
    rule: str,
    prices: Sequence[float],
    answers: _Answers,
    value: _Statistic,
    resamples: Resamples,
) -> Curve:
    """Return the curve of a planner and a rule."""
    accuracy = _over_people(100.0 * answers.right, group, resamples)
    ends = resamples.interval(accuracy.mean, accuracy.resampled, bounds=(0, 100))
    time = answers.time.mean(axis=(1, 2))
    points = [
        Point(price, float(accuracy.mean[at]), pair(ends[at]), float(time[at]), float(value.mean[at]))
        for at, price in enumerate(prices)
    ]
    return Curve(group.name, rule, tuple(points))


def _differences(
    pairs: Sequence[tuple[tuple[str, str], tuple[str, str]]],
    worths: Mapping[tuple[str, str], _Statistic],
    prices: Sequence[float],
    resamples: Resamples,
) -> tuple[WorthDifference, ...]:
    """Return how much more the first planner and rule of each pair are worth, at every price; corrected together."""
    if not pairs:
        return ()
    estimates = np.concatenate([worths[one].mean - worths[other].mean for one, other in pairs])
    resampled = np.concatenate([worths[one].resampled - worths[other].resampled for one, other in pairs])
    ends = resamples.together(estimates, resampled).ends if resamples.full else np.full((len(estimates), 2), np.nan)
    at = [(price, one, other) for one, other in pairs for price in prices]
    return tuple(
        WorthDifference(price, one, other, float(points), pair(interval))
        for (price, one, other), points, interval in zip(at, estimates, ends, strict=True)
    )
