"""What episodes are made of: nobody writes into it unnoticed, and its pieces join to what they were cut from."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from ehar.batch import Batch
from ehar.localisation import CentreMotion
from ehar.obstacles import Box, Obstacles, Surroundings
from ehar.obstacles.passers import Bodies, Passers
from ehar.sensors.perfect import PerfectSensor
from ehar.sensors.sensor import SensorNoise
from ehar.viewpoint import cartesian
from ehar.world import PAPER
from tests.helpers.fakes import SKELETON, tiny_batch

EPISODES, LENGTH = 3, 4


def busy_batch() -> Batch:
    """Return episodes in which everything is there that can be: obstacles, passers-by, a centre that moves."""
    made, rng = tiny_batch(episodes=EPISODES, length=LENGTH), np.random.default_rng(0)
    walking, centre = rng.normal(size=(EPISODES, LENGTH, 2, 4)), rng.normal(size=(4, EPISODES, LENGTH, 3))
    posture, bodies = (
        np.zeros((EPISODES, LENGTH, 2), dtype=np.int64),
        Bodies(np.zeros((9, 6, 3)), SKELETON.bone_indices, SKELETON.bone_radii()),
    )
    turn, lift = rng.normal(size=(EPISODES, LENGTH, 2)), rng.normal(size=(EPISODES, LENGTH, 2))
    passers = Passers(walking[..., :2].copy(), posture, turn, lift, walking, bodies)
    pillar = Obstacles(boxes=(Box(centre=(20.0, 0.0, 0.0), size=(1.0, 1.0, 1.0)),))
    around = Surroundings(pillar, rng.normal(size=(EPISODES, LENGTH, 3)), passers)
    gaze = 0.3 * rng.normal(size=(EPISODES, LENGTH, 3))
    return Batch(made.positions, made.labels, made.starts, made.noise, made.names, around, CentreMotion(*centre), gaze)


def arrays_of(batch: Batch) -> dict[str, npt.NDArray[np.generic]]:
    """Return all arrays that a batch holds, found by walking through it, by the name of each."""
    found: dict[str, npt.NDArray[np.generic]] = {}
    left: list[tuple[str, object]] = [("", batch)]
    while left:
        name, one = left.pop()
        if isinstance(one, np.ndarray):
            found[name] = one
        elif isinstance(one, SensorNoise | CentreMotion):
            left += [(f"{name} {key}", value) for key, value in one._asdict().items()]
        elif isinstance(one, Batch | Surroundings | Passers):
            left += [(f"{name} {key}", value) for key, value in vars(one).items()]
    return found


@pytest.mark.parametrize("name", sorted(arrays_of(busy_batch())))
def test_whatever_is_written_into_it_is_noticed(name: str) -> None:
    batch = busy_batch()
    before = batch.protected()
    assert batch.first_change(before) is None
    array = arrays_of(batch)[name]
    array[-1] = ~array[-1] if array.dtype == bool else array[-1] + 1
    assert batch.first_change(before) is not None
    assert batch.first_change(before).split()[-1] == name.split()[-1]  # type: ignore[union-attr]


def test_nobody_can_write_into_a_protected_copy() -> None:
    batch = busy_batch()
    own, copies = arrays_of(batch), arrays_of(batch.protected())
    assert len(own) == len(copies) == 17
    for name, array in copies.items():
        np.testing.assert_array_equal(array, own[name])
        assert not np.shares_memory(array, own[name])
        with pytest.raises(ValueError, match="cannot set WRITEABLE"):
            array.flags.writeable = True


def test_its_pieces_join_to_what_they_were_cut_from() -> None:
    batch = busy_batch()
    joined = Batch.joined([batch.select(slice(0, 1)), batch.select(np.array([1, 2]))])
    assert joined.first_change(batch) is None and joined.names == batch.names
    early = batch.select(slice(None), 2)
    for name, array in arrays_of(early).items():
        whole = arrays_of(batch)[name]
        np.testing.assert_array_equal(array, whole if array.shape == whole.shape else whole[:, :2])


def test_a_camera_looks_at_people_from_where_its_vehicle_is() -> None:
    batch, rng = busy_batch(), np.random.default_rng(1)
    assert batch.gaze is not None and batch.surroundings is not None
    for viewpoint in (PAPER.sample_starts(rng, EPISODES), PAPER.sample_starts(rng, 7 * EPISODES).reshape(-1, 7, 3)):
        own = (slice(None), None) if viewpoint.ndim == 3 else slice(None)  # an axis for forks
        gaze, joints = batch.gaze[:, 2][own], batch.around_centre[:, 2][own]
        camera = cartesian(viewpoint)
        forwards = gaze - camera
        np.testing.assert_allclose(batch.seen_from(2, viewpoint)[..., 0], np.linalg.norm(forwards, axis=-1))
        forwards /= np.linalg.norm(forwards, axis=-1, keepdims=True)
        way = joints - camera[..., None, None, :]
        depth = (way * forwards[..., None, None, :]).sum(axis=-1)
        beside = np.linalg.norm(way - depth[..., None] * forwards[..., None, None, :], axis=-1)
        sensed = batch.sense(PerfectSensor(), 2, viewpoint)
        np.testing.assert_array_equal(sensed.confidence == 0, batch.surroundings.hide(viewpoint, joints, 2))
        seen = sensed.confidence > 0
        assert seen.any()
        from_middle = np.linalg.norm(sensed.joints_2d - [640, 360], axis=-1)
        np.testing.assert_allclose(from_middle[seen], (850 * beside / depth)[seen], atol=0.05)


def test_straight_above_people_the_image_does_not_roll() -> None:
    batch = replace(busy_batch(), surroundings=None)
    above = np.tile([9.0, 2.0, 0.0], (EPISODES, 1))
    images = [batch.sense(PerfectSensor(), 1, above + aside).joints_2d for aside in (0, 1e-6)]
    np.testing.assert_allclose(*images, atol=0.05)
    looked_at = replace(batch, gaze=0 * batch.gaze)  # type: ignore[operator]
    plain = replace(batch, gaze=None).sense(PerfectSensor(), 1, above).joints_2d
    np.testing.assert_allclose(looked_at.sense(PerfectSensor(), 1, above).joints_2d, plain, atol=0.01)


def test_without_a_gaze_cameras_look_at_the_centre() -> None:
    batch = tiny_batch(episodes=EPISODES, length=LENGTH)
    assert batch.seen_from(0, batch.starts) is batch.starts and batch.around_centre is batch.positions
