from dataclasses import replace

import numpy as np

from eval.scores.planner_accuracy import accuracy_bands, draw_resamples
from eval.scores.resampling.training_seeds import curves, group_planners
from tests.helpers.made_records import make_records, three_planners


def test_bands_are_a_bootstrap_over_sequences_around_the_curves() -> None:
    records = {"mine": make_records(2, skill=1.0, episodes=60)}
    band = accuracy_bands(records, draw_resamples(list(records.values()), group_planners(records)))["mine"]
    record = records["mine"]
    names, which = np.unique(record.sequence, return_inverse=True)
    groups = [np.flatnonzero(which == index) for index in range(len(names))]
    rng = np.random.default_rng(1)
    drawn = [
        record.correct[np.concatenate([groups[index] for index in rng.integers(0, len(groups), len(groups))])].mean(
            axis=0
        )
        for _ in range(4000)
    ]
    np.testing.assert_allclose(band, np.percentile(drawn, [2.5, 97.5], axis=0).T, atol=0.02)


def test_trainings_are_one_planner_whose_band_holds_its_curve() -> None:
    records = {**three_planners(), "il-ppo/0": make_records(4, skill=1.0), "il-ppo/1": make_records(5, skill=2.0)}
    bands = accuracy_bands(records, draw_resamples(list(records.values()), group_planners(records)))
    assert list(bands) == ["no-act", "mine", "oracle", "il-ppo"]
    for name, curve in curves(records).items():
        assert ((bands[name][:, 0] <= curve + 1e-9) & (curve <= bands[name][:, 1] + 1e-9)).all()


def test_one_sequence_has_no_band() -> None:
    records = {"mine": replace(make_records(2), sequence=("only",) * 9)}
    assert np.isnan(
        accuracy_bands(records, draw_resamples(list(records.values()), group_planners(records)))["mine"]
    ).all()
