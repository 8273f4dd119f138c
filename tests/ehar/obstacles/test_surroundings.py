"""What stands and walks around episodes: it hides joints where it should, in every frame and for every fork."""

import numpy as np
import pytest

from ehar import EharError, EstimatorSensor, GridMotion, PerfectSensor
from ehar.batch import Batch
from ehar.data.streams.data import StreamData
from ehar.data.streams.scenario import StreamScenarios
from ehar.data.surroundings import surroundings_of
from ehar.obstacles import Box, Cylinder, Obstacles, Surroundings
from ehar.rollout import rollout
from ehar.sensors.sensing import sense
from ehar.sensors.sensor import draw_noise
from ehar.viewpoint import cartesian
from ehar.world import CROWD, PAPER, ROOM
from planners.heuristic import HRotate, NoAct
from tests.helpers.fakes import SKELETON, FakeRecogniser, tiny_batch, tiny_context, tiny_data, tiny_scenarios
from tests.helpers.passers import walking

PILLAR = Obstacles(cylinders=(Cylinder(centre=(2.5, 0.0, 0.0), radius=0.6, height=6.0),))
BEHIND, ASIDE = np.array([6.0, 0.0, np.pi / 2]), np.array([6.0, np.pi / 2, np.pi / 2])


def batch_with(around: Surroundings, starts: np.ndarray, length: int = 5) -> Batch:
    made = tiny_batch(episodes=len(starts), length=length)
    return Batch(made.positions, made.labels, starts, made.noise, made.names, around)


@pytest.mark.parametrize("sensor", [PerfectSensor(), EstimatorSensor(skeleton=SKELETON)])
def test_a_hidden_joint_is_missing_for_every_sensor(sensor: PerfectSensor | EstimatorSensor) -> None:
    batch = tiny_batch(episodes=2)
    viewpoint, joints = np.stack([BEHIND, ASIDE]), batch.positions[:, 0]
    hidden = Surroundings(PILLAR).hide(viewpoint, joints, 0)
    assert hidden[0].all() and not hidden[1].any()
    seen = sense(sensor, joints, viewpoint, batch.noise.frame(0), hidden=hidden)
    assert (seen.confidence[0] == 0).all() and (seen.joints_2d[0] == [640, 360]).all()
    plain = sense(sensor, joints, viewpoint, batch.noise.frame(0))
    np.testing.assert_array_equal(seen.confidence[1], plain.confidence[1])
    np.testing.assert_array_equal(seen.joints_2d[1], plain.joints_2d[1])


def test_a_swap_does_not_give_away_where_a_hidden_joint_is() -> None:
    sensor = EstimatorSensor(skeleton=SKELETON, swap_probability=1.0, swap_width=1e9)
    noise = draw_noise(np.random.default_rng(0), (1,), 1, 6)
    joints = tiny_batch(episodes=1).positions[:, 0]
    hidden = np.zeros((1, 1, 6), dtype=bool)
    hidden[0, 0, 1] = True  # the left shoulder, which the sensor calls the right one
    seen = sense(sensor, joints, ASIDE[None], noise, hidden=hidden)
    assert (seen.confidence[0, 0] > 0).tolist()[:3] == [True, True, False]


def test_the_loop_hides_what_obstacles_hide_and_oracles_imagine_it() -> None:
    starts = np.stack([BEHIND, ASIDE])
    batch = batch_with(Surroundings(PILLAR), starts)
    seen = []

    class Looks(NoAct):
        privileged = True

        def act(self, observation):  # type: ignore[no-untyped-def]
            imagined = observation.truth.sense(observation.frame + 1, np.repeat(starts[None], 2, axis=0))
            seen.append((observation.confidence, imagined.confidence))
            return observation.viewpoint

    context = tiny_context(episodes=2, length=5)
    rollout(Looks(), batch, FakeRecogniser(), PerfectSensor(), GridMotion(), context)
    for confidence, imagined in seen:
        assert confidence[:, 0].max(axis=1).tolist() == [0, 1]
        assert imagined[:, :, 0].max(axis=2).tolist() == [[0, 1], [0, 1]]


def test_an_episode_that_begins_too_near_is_refused_and_no_camera_flies_into_a_pillar() -> None:
    around = Surroundings(Obstacles(cylinders=(Cylinder(centre=(6.0, 0.0, 0.0), radius=0.6, height=6.0),)))
    context = tiny_context(episodes=2, length=25)
    near = batch_with(around, np.array([[6.5, 0.1, np.pi / 2], ASIDE]), 25)
    with pytest.raises(EharError, match=r"'episode-0': expected a start viewpoint at least 0\.3 m from obstacles"):
        rollout(NoAct(), near, FakeRecogniser(), PerfectSensor(), GridMotion(), context)
    start = PAPER.workspace.from_cells(np.array([[10, 90, 25], [10, 30, 25]]))
    record = rollout(HRotate(), batch_with(around, start, 25), FakeRecogniser(), PerfectSensor(), GridMotion(), context)
    assert (around.clearance(record.viewpoints, slice(None)) >= 0.3).all()


def test_in_a_stream_obstacles_stay_where_they_are() -> None:
    moved = np.zeros((1, 3, 3))
    moved[0, :, 0] = [0, 3, 9]
    around = Surroundings(PILLAR, moved)
    joints = np.zeros((1, 1, 1, 3))
    by_frame = [bool(around.hide(BEHIND[None], joints, frame).all()) for frame in range(3)]
    assert by_frame == [True, False, False]  # people walk past the pillar, and their camera with them
    both = around.hide(np.repeat(BEHIND[None, None], 3, axis=1), joints[:, None], slice(None))
    assert both[0, :, 0, 0].tolist() == by_frame
    assert around.clearance(BEHIND[None], 1)[0] == pytest.approx(3.0 + 3.5 - 0.6)
    part = around.select(np.array([0, 0]), 2)
    assert part.moved is not None and part.moved.shape == (2, 2, 3)


def test_passers_by_whom_cameras_may_meet_are_as_near_as_a_cylinder() -> None:
    """One walks 1 m a second along x; people, and the camera with them, rise 3 m between the two frames."""
    passers = walking(np.array([[[5.0, 0.0], [-9.0, 0.0]]]), np.array([[[1.0, 0.0], [0.0, 0.0]]]), 2, 2.0)
    level, above = np.array([[7.0, 0.0, np.pi / 2]]), np.array([[5.0, 0.0, 0.0]])
    moved = np.array([[[0.0, 0.0, 0.0], [4.0, 0.0, 3.0]]])
    around = Surroundings(Obstacles(), None, passers)
    assert around.clearance(level, 0) == pytest.approx(7 - 5 - 0.25)
    assert around.clearance(level, 1) == pytest.approx(7 - 5.5 - 0.25)
    assert around.clearance(above, 0) == pytest.approx(np.hypot(4.75, 5 - 0.75))
    risen = Surroundings(Obstacles(), moved, passers)
    assert risen.clearance(level, 0) == pytest.approx(7 - 5 - 0.25)
    assert risen.clearance(level, 1) == pytest.approx(np.hypot(7 - 5.5 - 0.25, 3 - 0.75))
    both = np.repeat(level[:, None], 2, axis=1)
    np.testing.assert_allclose(risen.clearance(both, slice(None))[0], [risen.clearance(level, at)[0] for at in (0, 1)])
    seven = np.repeat(level[:, None], 7, axis=1)
    np.testing.assert_allclose(risen.clearance(seven, 1)[0], np.full(7, risen.clearance(level, 1)[0]))
    inside = Surroundings(PILLAR, None, passers).clearance(np.array([[5.1, 0.0, np.pi / 2]]), 0)
    assert inside == pytest.approx(-0.15)


def test_the_centre_of_a_stream_moves_as_people_do() -> None:
    data = tiny_data(sequences=2, frames=40)
    walking = data.positions.copy()
    walking[..., 0] += np.tile(np.linspace(0, 2, 40), 2).astype(np.float32)[:, None, None]
    segments = np.array([[2, 30, 0], [42, 70, 1]])
    fields = ("name", "offsets", "class_names", "sequence_names", "fps", "skeleton", "is_test", "subjects")
    streams = StreamData(
        positions=walking,
        segments=segments,
        missing=np.zeros(80, dtype=bool),
        **{name: getattr(data, name) for name in fields},
    )
    scenarios = StreamScenarios(streams, 30, np.arange(2), np.zeros(2, dtype=np.int64))
    around = surroundings_of(scenarios, np.arange(2), ROOM, np.random.default_rng(0))
    assert around is not None and around.moved is not None
    np.testing.assert_allclose(around.moved[:, 0], 0)
    np.testing.assert_allclose(around.moved[:, -1, 0], 2 * 29 / 39, atol=0.3)


def test_an_open_world_has_no_surroundings_and_draws_nothing() -> None:
    rng = np.random.default_rng(0)
    assert surroundings_of(tiny_scenarios(), np.arange(3), PAPER, rng) is None
    assert surroundings_of(tiny_scenarios(), np.arange(3), CROWD, rng) is not None
    assert rng.bit_generator.state == np.random.default_rng(0).bit_generator.state


def test_a_box_far_away_hides_nothing() -> None:
    away = Surroundings(Obstacles(boxes=(Box(centre=(-9.0, 0.0, 0.0), size=(1.0, 1.0, 1.0)),)))
    joints = tiny_batch(episodes=2).positions[:, 0]
    assert not away.hide(np.stack([BEHIND, ASIDE]), joints, 0).any()
    assert cartesian(BEHIND)[0] == pytest.approx(6.0)
