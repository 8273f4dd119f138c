"""What is known of an episode: where azimuths are counted from, what turns and what does not, when views count."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ehar.arrays import FloatArray
from ehar.batch import Batch
from ehar.data.scenario import windows
from ehar.flight.vehicle import load_vehicle
from ehar.motion import GridMotion
from ehar.planner import Context, Observation, Planner
from ehar.rollout import Record, rollout
from ehar.runner import Runner
from ehar.sensors.perfect import PerfectSensor
from ehar.viewpoint import wrap_difference
from planners.value.belief.clips import BeliefModel, readout
from planners.value.belief.streams import StreamBeliefModel
from planners.value.body_filter import BodyFilter
from planners.value.collection import Collection
from planners.value.fit import stream_situations
from planners.value.situation import (
    PARTS,
    STREAM_PARTS,
    Situation,
    Tracker,
    fading_gains,
    frame_gains,
    frames_to_come,
)
from planners.value.view_basis import PAPER_RANGE, basis_at, turned
from tests.helpers.fakes import CLASS_NAMES, FakeRecogniser, tiny_batch, tiny_context
from tests.helpers.gain_models import PAIRS, random_situation
from tests.helpers.streams import StreamRecogniser, raising_streams

KEPT = ("facing", "facing_std", "position", "embedding")  # of a situation, as rollouts keep them
BELIEF = BeliefModel(noise_weights=(0.5, 0.1, 0.2, 0.0, -0.3), process_noise=0.01, correlation=0.4)


def test_one_person_s_facing_is_the_reference() -> None:
    situation = random_situation(np.random.default_rng(0), persons=1)
    np.testing.assert_array_equal(situation.reference, situation.facing[:, 0])


def test_several_people_s_reference_is_the_way_from_the_first_to_the_second() -> None:
    position = np.array([[[1.0, 1, 0], [2, 1, 5], [9, 9, 9]], [[0, 0, 0], [0, -2, 1], [9, 9, 9]]])
    situation = random_situation(np.random.default_rng(0), episodes=2, persons=3, position=position)
    np.testing.assert_allclose(situation.reference, [0, -np.pi / 2], atol=1e-12)


@given(st.integers(0, 2**32 - 1), st.floats(-7, 7), st.integers(1, 3))
def test_features_stay_when_people_and_camera_turn(seed: int, angle: float, persons: int) -> None:
    situation = random_situation(np.random.default_rng(seed), persons=persons)
    cosine, sine = np.cos(angle), np.sin(angle)
    other = replace(
        situation,
        facing=wrap_difference(situation.facing + angle),
        position=situation.position @ np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]]),
        seen=turned(situation.seen, np.array(-angle)),
    )
    np.testing.assert_allclose(wrap_difference(other.reference - situation.reference - angle), 0, atol=1e-7)
    for part, columns in situation.features().items():
        np.testing.assert_allclose(other.features()[part], columns, atol=1e-7, err_msg=part)


def test_without_facing_the_history_is_as_it_was_seen() -> None:
    situation = random_situation(np.random.default_rng(0))
    features = situation.features(facing=False)
    np.testing.assert_array_equal(features["history"][:, :8], situation.seen[:, 1:9])
    assert list(features) == list(PARTS)
    assert [columns.shape for columns in features.values()] == [(5, 1), (5, 9), (5, 3), (5, 4), (5, 10)]


class Follower(Planner):
    """Moves at random and keeps the situation after every frame."""

    name = "follower"

    def __init__(self, belief: BeliefModel | StreamBeliefModel = BELIEF, lookahead: float = 2.0) -> None:
        self.tracker = Tracker(belief=belief, pairs=PAIRS, memory=0.3, lookahead=lookahead)

    def reset(self, context: Context) -> None:
        self.tracker.reset(context)
        self.rng, self.body = context.rng, BodyFilter(pairs=PAIRS, frame_time=context.frame_time)
        self.situations: list[Situation] = []
        self.embeddings: list[FloatArray] = []

    def act(self, observation: Observation) -> FloatArray:
        self.tracker.update(observation)
        self.situations.append(self.tracker.situation)
        self.embeddings.append(observation.embedding)
        return observation.viewpoint + self.rng.normal(size=observation.viewpoint.shape)


def follow(follower: Follower, batch: Batch | None = None, persons: int = 1) -> Record:
    batch = batch or tiny_batch(persons=persons)
    return rollout(follower, batch, FakeRecogniser(), PerfectSensor(), GridMotion(), tiny_context())


@pytest.mark.parametrize("persons", [1, 2])
def test_the_tracker_follows_a_rollout(persons: int) -> None:
    follower = Follower()
    record = follow(follower, persons=persons)
    believed = np.exp(readout(BELIEF, record.log_probs, record.viewpoints))
    assert len(follower.situations) == 9
    for frame, situation in enumerate(follower.situations):
        np.testing.assert_allclose(situation.ratio, (frame + 1) / 10)
        np.testing.assert_allclose(situation.belief, believed[:, frame], atol=1e-9)
        np.testing.assert_array_equal(situation.embedding, follower.embeddings[frame])
        np.testing.assert_allclose(
            situation.seen, basis_at(record.viewpoints[:, : frame + 1], PAPER_RANGE).mean(axis=1), atol=1e-12
        )
        assert situation.belief.shape == (6, len(CLASS_NAMES))
        assert situation.facing.shape == situation.facing_std.shape == (6, persons)
        assert situation.position.shape == (6, persons, 3)


def test_the_tracker_finds_where_people_are_and_face() -> None:
    # Everybody in the tiny data faces azimuth 0; the second person stands 0.8 m to the left of the first.
    follower = Follower()
    follow(follower, persons=2)
    last = follower.situations[-1]
    way = last.position[:, 1] - last.position[:, 0]
    np.testing.assert_allclose(way, np.tile([0, 0.8, 0], (6, 1)), atol=0.15)
    np.testing.assert_allclose(last.reference, np.pi / 2, atol=0.2)


@pytest.mark.parametrize("lookahead", [2.0, 6.0])
def test_the_tracker_follows_a_stream_as_the_fit_reads_it(lookahead: float) -> None:
    chain = StreamBeliefModel(
        follows=((0.0, 0.6, 0.4), (0.5, 0.0, 0.5), (0.2, 0.8, 0.0)),
        rates=(1.0, 0.5, 0.8),
        gap_share=(0.9, 0.8, 0.7),
        gap_rate=1.2,
        share=(0.2, 0.2, 0.2, 0.4),
        phases=2,
    )
    data, follower, rng = raising_streams(), Follower(chain, lookahead), np.random.default_rng(0)
    runner = Runner(data, StreamRecogniser(), PerfectSensor())
    batch = runner.batch(windows(data, np.arange(4), 30, 30), np.arange(4), runner.world.sample_starts(rng, 4), rng)
    record = runner.roll(follower, batch, rng)
    frame = np.array([0, 1, 9, 28])
    one = [follower.situations[at] for at in frame]
    kept = {name: np.stack([getattr(each, name)[row] for row, each in enumerate(one)]) for name in KEPT}
    nothing = np.zeros((4, 1))
    collection = Collection(
        log_probs=record.log_probs,
        viewpoints=record.viewpoints,
        labels=batch.labels,
        sequences=np.arange(4),
        episode=np.arange(4),
        frame=frame,
        frames=frame,
        worth=nothing,
        path=nothing,
        **kept,
    )
    read = stream_situations(collection, chain, fps=data.fps, memory=0.3, lookahead=lookahead).features()
    assert tuple(read) == STREAM_PARTS
    for part, columns in read.items():
        tracked = np.stack([each.features()[part][row] for row, each in enumerate(one)])
        np.testing.assert_allclose(tracked, columns, atol=1e-6, err_msg=part)
    other = stream_situations(collection, chain, fps=data.fps, memory=0.3, lookahead=4.0).features()
    assert abs(other["belief"] - read["belief"]).max() > 0.003  # more of what follows is expected


def test_a_reset_forgets() -> None:
    follower, fresh = Follower(), Follower()
    follow(follower, tiny_batch(seed=1))
    follow(follower)
    follow(fresh)
    for situation, expected in zip(follower.situations, fresh.situations, strict=True):
        for part, columns in situation.features().items():
            np.testing.assert_array_equal(columns, expected.features()[part], err_msg=part)


@given(st.integers(1, 80), st.integers(0, 80))
def test_early_views_weigh_more_and_all_weigh_one(remaining: int, frame: int) -> None:
    gains = frame_gains(frame, frame + 1 + remaining)
    assert gains.shape == (remaining,)
    assert gains.sum() == pytest.approx(1)
    assert (np.diff(gains) < 0).all()
    assert (gains > 0).all()


@pytest.mark.parametrize(("frames", "memory"), [(1, 5.0), (40, 5.0), (120, 60.0)])
def test_gains_in_a_stream_are_what_is_left_of_a_view_in_all_recognitions_to_come(frames: int, memory: float) -> None:
    age = np.arange(frames)[None, :] - np.arange(frames)[:, None]  # of the view in a row, at the frame in a column
    left = np.where(age >= 0, np.exp(-age / memory), 0).sum(axis=1)
    np.testing.assert_allclose(fading_gains(frames, memory), left / left.sum(), atol=1e-9)


@pytest.mark.parametrize(("frame", "length"), [(0, 2), (0, 10), (4, 10), (8, 10), (20, 60)])
def test_gains_are_the_slope_of_the_mean_over_frames_of_running_means(frame: int, length: int) -> None:
    def score(evidence: FloatArray) -> float:
        """Return the mean, over the frames to come, of what has been averaged over each one's past."""
        running = np.cumsum(evidence) / np.arange(1, length + 1)
        return float(running[frame + 1 :].mean())

    evidence = np.random.default_rng(0).normal(size=length)
    slopes = np.array([score(evidence + unit) - score(evidence) for unit in np.eye(length)[frame + 1 :]])
    np.testing.assert_allclose(frame_gains(frame, length), slopes / slopes.sum(), atol=1e-9)


def test_a_vehicle_looks_farther_ahead_in_a_stream_and_to_the_end_of_a_clip() -> None:
    clip = tiny_context(length=30)
    stream, flown = replace(clip, length=None), replace(clip, length=None, vehicle=load_vehicle("px4-auto"))
    assert frames_to_come(clip) == frames_to_come(replace(clip, vehicle=flown.vehicle)) == 29
    assert frames_to_come(flown) == 1.5 * frames_to_come(stream) == round(3 / clip.frame_time)
