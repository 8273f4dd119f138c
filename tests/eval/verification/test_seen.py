"""What counts as seen again: noise does, and so does what rounded viewpoints leave open."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from ehar.arrays import FloatArray, IntArray
from ehar.rollout import Record
from ehar.sensors.perfect import PerfectSensor
from ehar.sensors.sensor import Sensed, SensorNoise
from ehar.viewpoint import AZIMUTH
from eval.records.episodes import DIGITS, EpisodeRecords, record_episodes
from eval.verification.seen import PROBABILITY, seen_difference
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
    def look(nudges: FloatArray) -> Record:
        raise AssertionError("no joint is on an edge")

    return seen_difference("nbv", kept, rows, record, tiny_batch(episodes=1, length=2), PerfectSensor(), look)[0]


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


class Beside(PerfectSensor):
    """Sees the first joint from one side of an azimuth alone."""

    def sense(
        self, positions: FloatArray, viewpoint: FloatArray, noise: SensorNoise, hidden: FloatArray | None = None
    ) -> Sensed:
        joints, confidence = super().sense(positions, viewpoint, noise)
        seen = np.broadcast_to((viewpoint[..., AZIMUTH] > EDGE)[..., None], confidence.shape[:-1])
        return Sensed(joints, np.concatenate([confidence[..., :1] * seen[..., None], confidence[..., 1:]], axis=-1))


EDGE = 1.0
LENGTH = 6
MISS = 10.0**-DIGITS / 2  # rounding puts a camera on the other side


def way_near_edges(frames: Sequence[int], beside: float = MISS) -> FloatArray:
    way = np.tile([8.0, 2.0, 1.2], (2, LENGTH, 1))
    way[1, frames, AZIMUTH] = EDGE + beside
    return way


def recognised(viewpoints: FloatArray) -> Record:
    """Return what is recognised: from a frame on that is seen from below the edge, something else."""
    below = (viewpoints[..., AZIMUTH] <= EDGE) & (viewpoints[..., AZIMUTH] > EDGE / 2)
    others = np.cumsum(below * 2.0 ** np.arange(LENGTH), axis=1)
    first = 0.4 + others / 200
    return Record(viewpoints, np.log(np.stack([first, 1 - first], axis=-1)), 0.0)


def seen_again(truth: FloatArray, way: FloatArray) -> tuple[str | None, FloatArray]:
    """Return what is said of a run that was seen from a true way and recorded on another."""
    kept = record_episodes(
        recognised(truth),
        sequence=["walk", "kick"],
        first=np.array([3, 0]),
        start=truth[:, 0],
        label=np.array([1, 0]),
        subjects=np.array([[-1], [-1]]),
    )
    kept = replace(kept, viewpoint=way)
    batch = tiny_batch(episodes=2, length=LENGTH)
    return seen_difference(
        "nbv", kept, np.arange(2), recognised(way), batch, Beside(), lambda nudges: recognised(way + nudges)
    )


@pytest.mark.parametrize("frames", [[4], [2, 4], [0, 1, 2, 3, 4, 5]])
def test_where_a_joint_is_on_an_edge_one_side_has_to_be_as_recorded(frames: list[int]) -> None:
    truth, way = way_near_edges(frames, -MISS), way_near_edges(frames)
    said, nudges = seen_again(truth, way)
    assert said is None
    assert np.argwhere(nudges.any(axis=2)).tolist() == [[1, frame] for frame in frames]
    np.testing.assert_allclose(nudges, 0, atol=10.0**-DIGITS)
    one_side = truth.copy()
    one_side[1, frames[0]] = way[1, frames[0]]
    said, nudges = seen_again(one_side, way)
    assert said is None and np.argwhere(nudges.any(axis=2)).tolist() == [[1, frame] for frame in frames[1:]]


def test_what_is_seen_from_no_side_of_an_edge_is_a_difference() -> None:
    way = way_near_edges([2])
    other = way.copy()
    other[1, 4, AZIMUTH] = EDGE - MISS  # what was recorded from here on is seen from nowhere on the way
    way[1, 4, AZIMUTH] = EDGE + 1e-4
    said, nudges = seen_again(other, way)
    assert said is not None and "nbv, episode 1 ('kick' from frame 0), frame 4: true_probability: got" in said
    assert not nudges.any()
