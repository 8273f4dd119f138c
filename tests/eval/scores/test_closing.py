"""The last two sentences of a benchmark say what was found and how sure it is, whatever happened."""

from dataclasses import replace

import numpy as np
import pytest

from eval.records.config import FoldConfig
from eval.records.episodes import EpisodeRecords
from eval.running.run import Run
from eval.scores.closing import closing_sentences
from eval.scores.resampling.resamples import Basis
from eval.scores.summary import Summary
from tests.helpers.made_records import config_of_run, make_records, summary_of

MANY = Basis(sequences=60, groups=9, people=9, together=1)
NINE = "The intervals rest on 9 people and on one training of the recogniser: another training may move them by more."


def right(*shares: float, people: int = 9) -> EpisodeRecords:
    """Return 60 sequences of 4 frames each with a share of right answers, which differs from one to the next."""
    base = make_records(0, episodes=120, people=people)
    frames = np.resize(np.array(shares) * 4, 60)[np.arange(120) // 2]
    return replace(base, predicted=base.label[:, None] + (np.arange(4) >= frames[:, None]))


LOW, MIDDLE, HIGH = right(0.25, 0.5), right(0.5, 0.5, 0.75), right(1.0, 0.75)


def of(**records: EpisodeRecords) -> Summary:
    return summary_of({name.replace("_", "-"): held for name, held in records.items()})


def interval(summary: Summary, name: str) -> str:
    ends = summary.planner(name).gap_closed_ci95
    assert ends is not None
    return f"[{100 * ends[0]:.0f}, {100 * ends[1]:.0f}]"


def test_a_clear_winner() -> None:
    summary = of(no_act=LOW, h_rotate=right(0.25, 0.5, 0.5), nbv=MIDDLE, oracle=HIGH)
    assert closing_sentences(summary) == (
        f"nbv closes 42 % of the gap to the oracle {interval(summary, 'nbv')} and is clearly above every other planner "
        f"without the truth. {NINE}"
    )


def test_a_tie_is_no_win() -> None:
    twin = right(0.5, 0.75, 0.5)
    summary = of(no_act=LOW, nbv=MIDDLE, h_rotate=twin, oracle=HIGH)
    assert " and is clearly above no-act, but not above h-rotate. " in closing_sentences(summary)
    level = of(no_act=right(0.5, 0.5, 0.5, 0.75), nbv=MIDDLE, h_rotate=twin, oracle=HIGH)
    assert ", but is not clearly above any other planner without the truth. " in closing_sentences(level)


def test_a_leader_is_compared_where_it_is_the_other_of_a_pair() -> None:
    summary = of(no_act=LOW, spiral=right(0.75), nbv=MIDDLE, oracle=HIGH)
    said = f"spiral closes 75 % of the gap to the oracle {interval(summary, 'spiral')}"
    assert closing_sentences(summary).startswith(said)
    assert " and is clearly above nbv. " in closing_sentences(summary)


def test_a_leader_that_is_level_with_nbv_leaves_the_word_to_it() -> None:
    # The leader has one pair alone, with nbv; nbv has a pair with everybody.
    summary = of(no_act=LOW, spiral=right(0.5, 0.75, 0.5, 0.75), nbv=MIDDLE, h_rotate=LOW, oracle=HIGH)
    assert summary.lead == "spiral"
    said = closing_sentences(summary)
    assert said.startswith("nbv closes ")
    assert " and is clearly above no-act and h-rotate, but not above spiral. " in said


def test_many_planners_are_counted_and_not_listed() -> None:
    twins = {f"rule-{row}": right(*np.roll([0.5, 0.5, 0.75], row)) for row in range(6)}
    summary = summary_of({"no-act": LOW, **twins, "nbv": right(0.5, 0.75, 0.75), "oracle": HIGH})
    said = closing_sentences(summary)
    assert said.startswith("nbv closes") and said.count("rule-") <= 3


def test_a_loser_below_no_act() -> None:
    clear = of(no_act=MIDDLE, nbv=LOW, oracle=HIGH)
    assert closing_sentences(clear) == (
        f"No planner beats a camera that stays: the best, nbv, is 20.8 points below no-act, and clearly so. {NINE}"
    )
    unclear = of(no_act=right(0.5, 0.75, 0.5, 0.75), nbv=right(0.75, 0.5, 0.5, 0.5, 0.75, 0.5), oracle=HIGH)
    assert "is 4.2 points below no-act, though not clearly. " in closing_sentences(unclear)


def test_no_gap_to_close() -> None:
    said = closing_sentences(of(no_act=MIDDLE, nbv=HIGH, oracle=LOW))
    assert said.startswith(
        "There is no gap to close, as the oracle is no better than no-act; nbv is right in 87.5 % of"
    )
    assert " and is clearly above every other planner without the truth. " in said


def test_without_the_oracle_accuracy_is_told() -> None:
    assert closing_sentences(of(no_act=LOW, nbv=HIGH)).startswith("nbv is right in 87.5 % of all frames [")


def test_no_intervals() -> None:
    records = {"no-act": LOW, "nbv": MIDDLE, "oracle": HIGH}
    summary = summary_of({name: replace(held, sequence=("only",) * 120) for name, held in records.items()})
    assert closing_sentences(summary) == (
        "nbv closes 42 % of the gap to the oracle, more than any other planner without the truth. "
        "How sure that is cannot be said: all episodes are windows of one sequence, so there is nothing to resample."
    )


@pytest.mark.parametrize(
    ("basis", "expected"),
    [
        (MANY, NINE),
        (
            Basis(sequences=56, groups=4, people=8, together=2),
            "The intervals rest on only 4 couples and on one training of the recogniser: "
            "other people or another training may move them by more.",
        ),
        (
            Basis(sequences=56),
            "The intervals rest on 56 sequences of people whom the data do not name and on one training of the "
            "recogniser: other people or another training may move them by more.",
        ),
    ],
)
def test_few_and_unknown_people_are_told(basis: Basis, expected: str) -> None:
    said = closing_sentences(replace(of(no_act=LOW, nbv=MIDDLE, oracle=HIGH), basis=basis))
    assert said.endswith(f". {expected}")


def test_planners_that_are_equal_are_not_told_apart() -> None:
    found = replace(of(no_act=MIDDLE, nbv=MIDDLE), no_intervals="one sequence")
    assert ", as often as no-act. How sure" in closing_sentences(found)


def test_several_trainings_and_folds_are_told() -> None:
    found = replace(of(no_act=LOW, nbv=MIDDLE, oracle=HIGH), basis=MANY)
    trained = replace(found, config=replace(found.config, trainings=("a", "b", "c")))
    assert closing_sentences(trained).endswith("The intervals rest on 9 people and on 3 trainings of the recogniser.")
    fold = FoldConfig("a", "tiny.npz", "1", 3)
    folds = replace(found, config=replace(found.config, folds=(fold, fold)))
    assert closing_sentences(folds).endswith(
        "The intervals rest on 9 people and on one training of the recogniser, another one in each fold: another "
        "training may move them by more."
    )


def test_one_planner_alone() -> None:
    assert closing_sentences(of(nbv=MIDDLE)).startswith("nbv is right in 58.3 % of all frames [")
    assert "; no other planner without the truth ran. " in closing_sentences(of(nbv=MIDDLE, oracle=HIGH))
    only = closing_sentences(of(no_act=LOW, oracle=HIGH))
    assert only.startswith("Only no-act ran without the truth, and is right in 37.5 % of all frames [")
    assert closing_sentences(of(oracle=HIGH)).startswith("Only planners that are handed the truth ran")


def test_who_is_compared_with_a_camera_that_stays() -> None:
    said = closing_sentences(of(no_act=LOW, spiral=MIDDLE, oracle=HIGH))
    assert " and is clearly above every other planner without the truth. " in said


def test_a_camera_that_stays_is_never_who_closes_the_gap() -> None:
    # Neither nbv nor an agent ran, so only no-act is compared with everybody; nobody is clearly above it.
    level = right(0.5, 0.75, 0.5, 0.75)
    summary = of(no_act=level, spiral=right(0.75, 0.5, 0.75, 0.75, 0.5, 0.5, 0.75), front=LOW, oracle=HIGH)
    said = closing_sentences(summary)
    assert summary.lead == "spiral"
    assert said.startswith("spiral closes ") and ", but is not clearly above no-act. " in said


def test_planners_that_are_compared_in_no_pair() -> None:
    said = closing_sentences(of(front=LOW, spiral=MIDDLE, oracle=HIGH))
    assert ", more than any other planner without the truth, but no pair was tested. " in said


def test_a_run_ends_with_them() -> None:
    records = {"no-act": LOW, "nbv": MIDDLE, "oracle": HIGH}
    run = Run(config_of_run(), records, made=summary_of(records))
    assert str(run).rstrip().endswith(closing_sentences(run.summary))
    assert run._repr_html_().endswith(f"<p>{closing_sentences(run.summary)}</p>")
