"""Curves and differences are those of the answers, and their intervals those of the resamples."""

from dataclasses import replace

import numpy as np
import pytest

from eval.records.episodes import EpisodeRecords, join_records
from eval.scores.deciding.curves import RULES, SPRT, DecidingOnce, deciding_once, fit_rules
from eval.scores.deciding.fit import seen_in
from eval.scores.deciding.rules import FixedTime, Rule, decide, waited, words_of_records
from eval.scores.planner_accuracy import draw_resamples
from eval.scores.resampling.training_seeds import group_planners
from tests.helpers.made_records import make_records

TWO_PRICES = (1.0, 50.0)
SECONDS = 0.5


def of_planners() -> dict[str, EpisodeRecords]:
    kinds = {"no-act": 0.0, "nbv/0": 1.0, "nbv/1": 2.0, "oracle": 3.0}
    return {
        name: make_records(row, skill=skill, episodes=60, people=6) for row, (name, skill) in enumerate(kinds.items())
    }


def fitted(*records: EpisodeRecords, prices: tuple[float, ...] = TWO_PRICES) -> dict[str, tuple[Rule, ...]]:
    return fit_rules(seen_in(join_records(records), SECONDS), prices)


def found_in(
    records: dict[str, EpisodeRecords], rules: dict[str, tuple[Rule, ...]], *, tested: tuple[str, ...] = ()
) -> DecidingOnce:
    seen = {name: seen_in(held, SECONDS) for name, held in records.items()}
    resamples = draw_resamples(list(records.values()), group_planners(records))
    return deciding_once(seen, rules, resamples, TWO_PRICES, against="no-act", tested=tested)


def test_a_curve_is_the_mean_over_episodes_and_trainings() -> None:
    records = of_planners()
    rules = {"fixed time": (FixedTime(3), FixedTime(0))}
    found = found_in(records, rules, tested=("nbv",))
    assert [(curve.planner, curve.rule) for curve in found.curves] == [
        ("no-act", "fixed time"),
        ("nbv", "fixed time"),
        ("oracle", "fixed time"),
    ]
    late, early = found.curves[1].points
    trainings = [records["nbv/0"], records["nbv/1"]]
    assert late.accuracy == pytest.approx(100 * np.mean([held.correct[:, -1].mean() for held in trainings]))
    assert early.accuracy == pytest.approx(100 * np.mean([held.correct[:, 0].mean() for held in trainings]))
    assert (late.seconds, early.seconds) == (2.0, 0.5)
    assert late.worth == pytest.approx(late.accuracy - 2.0)
    assert late.accuracy_ci95 is not None and late.accuracy_ci95[0] < late.accuracy < late.accuracy_ci95[1]


def test_differences_are_paired_and_corrected_together() -> None:
    records = of_planners()
    rules = fitted(make_records(9, skill=1.0, episodes=60))
    found = found_in(records, rules, tested=("nbv",))
    worth = {(curve.planner, curve.rule, point.price): point.worth for curve in found.curves for point in curve.points}
    assert [difference.price for difference in found.rules["nbv"]] == list(TWO_PRICES) * 4
    for difference in (*found.rules["nbv"], *found.planners["nbv"]):
        assert difference.points == pytest.approx(
            worth[*difference.one, difference.price] - worth[*difference.other, difference.price]
        )
        assert (
            difference.ci95_corrected is not None
            and difference.ci95_corrected[0] <= difference.points <= difference.ci95_corrected[1]
        )
    assert {(difference.one, difference.other) for difference in found.planners["nbv"]} == {
        (("nbv", rule), ("no-act", rule)) for rule in RULES
    }


def test_a_planner_that_knows_more_is_worth_more_by_the_same_rule() -> None:
    records = {"no-act": make_records(1, episodes=200, people=20)}
    records["nbv"] = make_records(2, skill=3.0, episodes=200, people=20)
    rules = fitted(make_records(5, skill=1.0, episodes=200))
    for difference in found_in(records, rules, tested=("nbv",)).planners["nbv"]:
        assert difference.ci95_corrected is not None and difference.ci95_corrected[0] > 0


def test_rules_are_fitted_on_all_planners_together() -> None:
    one, other = make_records(1, skill=0.5), make_records(2, skill=2.0)
    rules = fitted(one, other, prices=(30.0,))
    (fixed,) = rules["fixed time"]
    assert isinstance(fixed, FixedTime)
    worths = [
        100 * np.mean([one.correct[:, at].mean(), other.correct[:, at].mean()]) - 15.0 * (at + 1) for at in range(4)
    ]
    assert fixed.frame == int(np.argmax(worths))
    assert waited(decide(fixed, words_of_records(one)), SECONDS)[0] == SECONDS * (fixed.frame + 1)


def test_without_the_second_class_there_is_no_sprt() -> None:
    old = replace(make_records(0), second_probability=None)
    rules = fitted(old)
    assert set(rules) == set(RULES) - {SPRT}
    found = found_in({"nbv": old}, rules)
    assert {difference.one[1] for difference in found.rules["nbv"]} == {"induction"}
    assert found.planners == {}


def test_one_sequence_has_no_intervals() -> None:
    records = make_records(0, episodes=2)
    rules = {"fixed time": (FixedTime(0), FixedTime(1)), "induction": (FixedTime(1), FixedTime(1))}
    found = found_in({"nbv": records}, rules)
    assert found.no_intervals is not None
    assert found.curves[0].points[0].accuracy_ci95 is None
    assert found.rules["nbv"][0].ci95_corrected is None
