import numpy as np
import pytest

from eval.scores.metrics import acc_at
from eval.scores.predictability import (
    NO_EPISODE,
    RATIOS,
    class_levels,
    class_means,
    correct_at_ratios,
    episode_levels,
    predictability,
)
from tests.helpers.made_records import make_records

# Right after 10, 50 and 100 % of the frames.
AT = np.array([[1, 1, 1], [0, 1, 1], [0, 0, 1], [0, 0, 0], [1, 0, 1], [1, 1, 0]], dtype=bool)
LABEL = np.array([0, 0, 2, 2, 3, 3])


def test_an_episode_is_as_predictable_as_the_ratio_from_which_on_it_is_right() -> None:
    # One that is right, wrong and right again is late; one that ends wrong is never predictable.
    assert episode_levels(AT).tolist() == [0, 1, 2, 3, 2, 3]


@pytest.mark.parametrize("length", [1, 4, 10, 30, 59, 60])
def test_ratios_are_those_of_the_accuracies(length: int) -> None:
    correct = np.random.default_rng(0).random((20, length)) < 0.5
    at = correct_at_ratios(correct)
    assert at.mean(axis=0).tolist() == [acc_at(correct, percent) for percent in RATIOS]


def test_means_by_class_by_hand() -> None:
    expected = [[0.5, 1.0, 1.0], [np.nan] * 3, [0.0, 0.0, 0.5], [1.0, 0.5, 0.5]]
    np.testing.assert_array_equal(class_means(AT, LABEL, 4), expected)


def test_half_of_a_class_is_enough_and_later_ratios_do_not_matter() -> None:
    accuracy = np.array([[0.5, 1, 1], [0.49, 0.5, 0.2], [0, 0, 0.5], [0.4, 0.4, 0.4], [0.6, 0, 0], [np.nan] * 3])
    assert class_levels(accuracy).tolist() == [0, 1, 2, 3, 0, NO_EPISODE]


def test_the_levels_of_a_run_by_class() -> None:
    episodes = make_records(0, skill=1.0, episodes=40, length=10)
    found = predictability(episodes, 4)  # of 4 classes the last has no episode
    assert found.class_level[3] == NO_EPISODE and np.isnan(found.share[3]).all()
    np.testing.assert_allclose(found.share[:3].sum(axis=1), 1)
    assert found.total.sum() == pytest.approx(1)
    counts = np.bincount(episodes.label, minlength=3)[:3]
    np.testing.assert_allclose(found.total, (found.share[:3] * counts[:, None]).sum(axis=0) / len(episodes))
    # An episode of the last level is wrong after its last frame.
    assert 1 - found.total[3] == pytest.approx(episodes.correct[:, -1].mean())
    written = found.to_json(("a", "b", "c", "d"))
    assert list(written["by_class"]) == ["a", "b", "c"]
    assert sorted(name for names in written["classes"].values() for name in names) == ["a", "b", "c"]
