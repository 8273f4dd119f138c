from dataclasses import replace

import numpy as np
import pytest

from eval.records.episodes import EpisodeRecords
from eval.scores.seed_accuracy import accuracy_over_seeds, pool_seeds, seeds_of
from tests.helpers.made_records import make_records


def right_from(frame: int) -> EpisodeRecords:
    episodes = make_records(0, episodes=4, length=10)
    predicted = np.where(np.arange(10) >= frame, episodes.label[:, None], episodes.label[:, None] + 1)
    return replace(episodes, predicted=predicted)


def test_the_spread_over_seeds_by_hand() -> None:
    # Right from the first frame, and from the fifth: 100 and 0 % after 10 %, 100 % after 50 %, means 100 and 60 %.
    row = accuracy_over_seeds("il-ppo", [right_from(0), right_from(4)])
    assert row.seeds == 2
    assert row.acc["10"].mean == 50 and row.acc["10"].std == pytest.approx(100 / np.sqrt(2))
    assert row.acc["50"] == row.acc["100"] == (100, 0)
    assert row.acc_mean.mean == pytest.approx(80) and row.acc_mean.std == pytest.approx(40 / np.sqrt(2))


def test_one_seed_has_no_spread() -> None:
    row = accuracy_over_seeds("il", [right_from(5)])
    assert row.acc_mean == (pytest.approx(50), None)


def test_the_trainings_of_a_planner_are_taken_together() -> None:
    records = {"no-act": right_from(9), "il-ppo/0": right_from(0), "il-ppo/1": right_from(4)}
    assert {name: len(seeds) for name, seeds in seeds_of(records).items()} == {"no-act": 1, "il-ppo": 2}
    pooled = pool_seeds(records)["il-ppo"]
    assert len(pooled) == 8
    assert pooled.correct.mean() == pytest.approx(0.8)
