"""A recogniser has learned when twice the clips gain too little."""

import pytest

from recognition.training.stopping import (
    LEAST_CLIPS,
    SPREAD,
    Evaluation,
    conclude,
    doubling_gain,
    enough_clips,
    has_learned,
    next_evaluation,
)


def evaluated(*accuracies: float) -> list[Evaluation]:
    """Return evaluations after 8, 16, 24, ... clips."""
    return [Evaluation(i, 8 * i, 1.0, 1.0, accuracy) for i, accuracy in enumerate(accuracies, 1)]


def test_the_gain_of_a_doubling_is_that_of_the_best_over_the_best_at_half_as_many() -> None:
    assert doubling_gain(evaluated(0.2)) is None
    assert doubling_gain(evaluated(0.2, 0.5)) == pytest.approx(0.3)
    assert doubling_gain(evaluated(0.2, 0.5, 0.9)) == pytest.approx(0.7)  # 12 clips are half of 24
    assert doubling_gain(evaluated(0.2, 0.6, 0.5, 0.5)) == 0.0
    assert doubling_gain(evaluated(0.6, 0.5, 0.7, 0.5)) == pytest.approx(0.1)


def learning(*accuracies: float) -> list[Evaluation]:
    """Return evaluations after as many clips as a training has at least, after twice, three times as many, ..."""
    return [Evaluation(i, i * LEAST_CLIPS, 1.0, 1.0, accuracy) for i, accuracy in enumerate(accuracies, 1)]


def test_has_learned_once_a_doubling_gains_little_but_not_before_the_least_clips() -> None:
    assert not has_learned([])
    assert not has_learned(evaluated(0.5, 0.5, 0.5))
    assert not has_learned(learning(0.5, 0.506))
    assert has_learned(learning(0.5, 0.504))
    assert not has_learned(learning(0.5, 0.6, 0.604))  # three times as many: half of them is less than twice
    assert has_learned(learning(0.5, 0.6, 0.604, 0.604))


def test_says_how_many_clips_it_takes_if_nothing_gets_better() -> None:
    assert enough_clips([], 0) == LEAST_CLIPS
    assert enough_clips(learning(0.5, 0.6), 2 * LEAST_CLIPS) == 4 * LEAST_CLIPS
    assert enough_clips(learning(0.5, 0.6, 0.6, 0.604), 4 * LEAST_CLIPS) == 4 * LEAST_CLIPS
    assert enough_clips(evaluated(0.5), 8) == LEAST_CLIPS


def test_evaluations_lie_ever_farther_apart() -> None:
    assert next_evaluation([], 10) == 10
    assert next_evaluation([Evaluation(20, 1, 1.0, 1.0, 0.5)], 10) == 30
    assert next_evaluation([Evaluation(1000, 1, 1.0, 1.0, 0.5)], 10) == 1000 * SPREAD


def test_concludes_what_it_reached_and_why() -> None:
    found = conclude(learning(0.5, 0.6, 0.6, 0.55), 4 * LEAST_CLIPS, runs_to_end=False)
    assert (found.best.step, found.cut_short) == (3, False)  # of equal ones the last
    assert found.reason == "it had learned: twice the clips, 40,000 to 80,000, gained 0.0 points on validation"
    went_on = conclude(learning(0.5, 0.6, 0.6, 0.55), 4 * LEAST_CLIPS, runs_to_end=False, begun=True)
    assert went_on.reason == f"{found.reason}, counted from the weights that it began with"
    short = conclude(learning(0.5, 0.6), 2 * LEAST_CLIPS, runs_to_end=False)
    assert (
        short.cut_short
        and short.reason == "cut short at 40,000 clips: twice the clips, 20,000 to 40,000, gained 10.0 points"
    )
    assert conclude(evaluated(0.5), 8, runs_to_end=False).reason.endswith("too few to tell what more bring")
    assert not conclude(learning(0.5, 0.6), 2 * LEAST_CLIPS, runs_to_end=True).cut_short
