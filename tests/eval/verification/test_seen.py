"""What counts as seen again: noise does, and so does what rounded viewpoints leave open."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.arrays import FloatArray, IntArray
from ehar.rollout import Record
from ehar.sensors.perfect import PerfectSensor
from ehar.sensors.sensor import Sensed, SensorNoise
from ehar.viewpoint import AZIMUTH
from eval.records.episodes import DIGITS, EpisodeRecords, record_episodes
from eval.verification import seen
from eval.verification.seen import PROBABILITY, first_edge, seen_difference
from tests.helpers.fakes import tiny_batch

PROBABILITIES = np.array([[[0.6, 0.3, 0.1], [0.45, 0.45 - PROBABILITY / 2, 0.1 + PROBABILITY / 2]]])


def recorded() -> tuple[EpisodeRecords, Record]:
    record = Record(np.tile([6.0, 0.0, 1.0], (1, 2, 1)), np.log(PROBABILITIES), 0.0)
    kept = record_episodes(
        record,
        sequence=["walk"],
        first=np.array([3]),
        start=np.array([[6.0, 0.0, 1.0]]),
        label=np.array([1]),
        subjects=np.array([[-1]]),
    )
    return kept, record


def difference(kept: EpisodeRecords, rows: IntArray, record: Record) -> str | None:
    return seen_difference("nbv", kept, rows, record, tiny_batch(episodes=1, length=2), PerfectSensor())[0]


def test_noise_is_no_difference() -> None:
    kept, record = recorded()
    rows = np.array([0])
    assert difference(kept, rows, record) is None
    noise = PROBABILITIES * (1 + np.array([1, -1, 1]) * PROBABILITY / 2)
    assert difference(kept, rows, replace(record, log_probs=np.log(noise))) is None
    tie = replace(kept, predicted=np.array([[0, 1]]))  # two classes that are nearly as probable
    assert difference(tie, rows, record) is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"predicted": np.array([[1, 0]])}, "frame 0: predicted: got 1, expected 0"),
        ({"predicted": np.array([[0, 2]])}, "frame 1: predicted: got 2, expected 0"),
        ({"true_probability": np.array([[0.3, 0.4]])}, "frame 1: true_probability: got 0.4, expected 0.4495"),
        ({"top_probability": np.array([[0.7, 0.7]])}, "frame 0: top_probability: got 0.7, expected 0.6"),
        ({"second_probability": np.array([[0.3, 0.2]])}, "frame 1: second_probability: got 0.2, expected 0.4495"),
    ],
)
def test_the_first_frame_that_was_seen_otherwise_is_named(changes: dict[str, np.ndarray], message: str) -> None:
    kept, record = recorded()
    found = difference(replace(kept, **changes), np.array([0]), record)
    assert found == f"episodes.jsonl: nbv, episode 0 ('walk' from frame 3), {message}"


def test_from_an_edge_on_an_episode_is_not_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    kept, record = recorded()
    rows, seen_by = np.array([0]), (tiny_batch(episodes=1, length=2), PerfectSensor())
    monkeypatch.setattr(seen, "first_edge", lambda batch, sensor, way, episode, last: 1 if last else None)
    late = replace(record, log_probs=record.log_probs[..., [[0, 1, 2], [2, 0, 1]]][:, [0, 1], [0, 1]])
    found, until = seen_difference("nbv", kept, rows, late, *seen_by)
    assert found is None and until.tolist() == [1]
    both = replace(record, log_probs=record.log_probs[..., [2, 0, 1]])
    found, until = seen_difference("nbv", kept, rows, both, *seen_by)
    assert found is not None and "frame 0" in found and until.tolist() == [2]


class Beside(PerfectSensor):
    """Sees the first joint from one side of an azimuth alone."""

    def sense(
        self, positions: FloatArray, viewpoint: FloatArray, noise: SensorNoise, hidden: FloatArray | None = None
    ) -> Sensed:
        joints, confidence = super().sense(positions, viewpoint, noise)
        seen = np.broadcast_to((viewpoint[..., AZIMUTH] > EDGE)[..., None], confidence.shape[:-1])
        return Sensed(joints, np.concatenate([confidence[..., :1] * seen[..., None], confidence[..., 1:]], axis=-1))


EDGE = 1.0


@pytest.mark.parametrize(("beside", "expected"), [(10.0**-DIGITS / 2, 4), (-(10.0**-DIGITS) / 2, 4), (1e-4, None)])
def test_a_joint_is_on_an_edge_if_rounding_may_hide_it(beside: float, expected: int | None) -> None:
    batch = tiny_batch(episodes=2, length=6)
    way = np.tile([8.0, 2.0, 1.2], (2, 6, 1))
    way[1, 4, AZIMUTH] = EDGE + beside
    assert first_edge(batch, Beside(), way, 1, 5) == expected
    assert first_edge(batch, Beside(), way, 1, 3) is None  # not yet
    assert first_edge(batch, Beside(), way, 0, 5) is None
