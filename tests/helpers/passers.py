"""People who stand in the way."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.obstacles.passers import Bodies, Passers
from tests.helpers.fakes import POSE, SKELETON


def standing(place: FloatArray, length: int = 1, turn: float = 0.0) -> Passers:
    """Return one episode in which W people stand still at places (W, 2), for `length` frames."""
    shape = (1, length, len(place))
    places = np.broadcast_to(place, (*shape, 2)).astype(np.float64)
    tracked = np.concatenate([places, np.zeros_like(places)], axis=-1)
    turned, lift = np.full(shape, turn), np.zeros(shape)
    bodies = Bodies(POSE[None], SKELETON.bone_indices, SKELETON.bone_radii())
    return Passers(places, np.zeros(shape, dtype=np.int64), turned, lift, tracked, bodies)


def walking(
    place: FloatArray, velocity: FloatArray, length: int, fps: float, noise: FloatArray | float = 0.0
) -> Passers:
    """Return B episodes in which W people walk straight on from places (B, W, 2), and cameras may meet them.

    `noise` (B, L, W, 4) is what they are tracked with.
    """
    shape = (len(place), length, place.shape[1])
    time = np.arange(length)[:, None, None] / fps
    places = place[:, None] + time * velocity[:, None]
    tracked = np.concatenate([places, np.broadcast_to(velocity[:, None], places.shape)], axis=-1) + noise
    bodies = Bodies(POSE[None], SKELETON.bone_indices, SKELETON.bone_radii())
    return Passers(places, np.zeros(shape, dtype=np.int64), np.zeros(shape), np.zeros(shape), tracked, bodies, met=True)
