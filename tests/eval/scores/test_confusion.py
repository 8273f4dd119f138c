from dataclasses import replace

import numpy as np
import pytest
from sklearn.metrics import confusion_matrix

from eval.scores.confusion import class_gains, confusion
from eval.scores.metrics import mean_acc
from tests.helpers.made_records import make_records


def test_confusion_is_that_of_scikit_learn() -> None:
    records = make_records(1, skill=1.0, episodes=30)
    truth = np.repeat(records.label, records.predicted.shape[1])
    expected = confusion_matrix(truth, records.predicted.ravel(), labels=range(3), normalize="true")
    np.testing.assert_allclose(confusion(records, 3), expected)


def test_a_class_without_episodes_has_no_row() -> None:
    shares = confusion(make_records(1), 4)
    assert np.isnan(shares[3]).all()
    np.testing.assert_allclose(shares[:3].sum(axis=1), 1)


def test_gains_are_differences_of_the_classes_accuracies() -> None:
    one, other = make_records(1, skill=2.0, episodes=40), make_records(2, episodes=40)
    gains = class_gains([one], [other], 4)
    for label in range(3):
        members = one.label == label
        expected = mean_acc(one.correct)[members].mean() - mean_acc(other.correct)[members].mean()
        assert gains.gain[label] == pytest.approx(expected)
        assert gains.ci95[label, 0] <= expected <= gains.ci95[label, 1]
    assert np.isnan(gains.gain[3])
    nothing = class_gains([one], [one], 3)
    assert (nothing.gain == 0).all() and (nothing.ci95 == 0).all()


def test_the_interval_is_that_of_a_bootstrap_over_the_classs_sequences() -> None:
    one, other = make_records(1, skill=1.0, episodes=60), make_records(2, episodes=60)
    gains = class_gains([one], [other], 3)
    members = one.label == 0
    gained = (mean_acc(one.correct) - mean_acc(other.correct))[members]
    names, which = np.unique(np.array(one.sequence)[members], return_inverse=True)
    groups = [gained[which == index] for index in range(len(names))]
    rng = np.random.default_rng(5)
    drawn = [
        np.concatenate([groups[index] for index in rng.integers(0, len(groups), len(groups))]).mean()
        for _ in range(4000)
    ]
    np.testing.assert_allclose(gains.ci95[0], np.percentile(drawn, [2.5, 97.5]), atol=0.02)


def test_one_sequence_of_a_class_has_a_gain_and_no_interval() -> None:
    records = replace(make_records(1), sequence=("only",) * 9)
    gains = class_gains([records, make_records(3, skill=1.0)], [make_records(2)], 3)
    assert np.isfinite(gains.gain).all() and np.isnan(gains.ci95).all()
