"""People who walk past those that are watched: recorded bodies that are carried along straight ways."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ehar.arrays import BoolArray, FloatArray, IntArray, in_brief, read_only
from ehar.obstacles.shapes import cylinder_clearance, passes_by, passes_through

# The upright cylinder that stands for a passer-by, as nobody tells how they hold their limbs.
FLOOR = -0.95  # [m], below the middle of people who stand
PASSER_TOP = FLOOR + 1.7  # [m], of the head
PASSER_RADIUS = 0.25  # [m]

THICKEST = 0.15  # [m], more than the radius of any bone
UNDETECTED = 0.5  # share of a person's joints; who has more hidden by one passer-by is not detected beside them
ALIKE = 1.5  # a track takes nobody who appears more than so many times as large as whom it has watched

Frames = int | slice  # one frame, of arrays (B, ...); or several, of arrays (B, T, ...)


@dataclass(frozen=True, eq=False, repr=False)
class Bodies:
    """Recorded bodies, as capsules around their bones. Batches share them, so nobody may write into them.

    Args:
        joints: (F, J, 3) joints of one person in each frame of a recording [m].
        bones: (bones, 2) pairs of joints.
        radii: (bones,) radius of the capsule around each bone [m].
    """

    joints: FloatArray
    bones: IntArray
    radii: FloatArray

    __repr__ = in_brief


@dataclass(frozen=True, eq=False, repr=False)
class Passers:
    """W people who walk past, in each of B episodes of L frames.

    Args:
        place: (B, L, W, 2) the mean of their joints, relative to the centre of those that are watched [m].
        posture: (B, L, W) the frame of `bodies` that shows their posture.
        turn: (B, L, W) how far they are turned from what was recorded, from x towards y [rad].
        lift: (B, L, W) how much higher they are than what was recorded, relative to the centre in that frame [m].
        tracked: (B, L, W, 4) what planners are told in each frame: where they are thought to be [m] and how fast they
            walk [m/s], each along x and y.
        bodies: the postures.
        mistakable: whether a track may take them for those that are watched.
        met: whether they walk to where cameras may be.
    """

    place: FloatArray
    posture: IntArray
    turn: FloatArray
    lift: FloatArray
    tracked: FloatArray
    bodies: Bodies
    mistakable: bool = False
    met: bool = False

    __repr__ = in_brief

    @property
    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """All arrays of the episodes, by name."""
        return {name: getattr(self, name) for name in ("place", "posture", "turn", "lift", "tracked")}

    def select(self, rows: IntArray | slice, frames: int | None = None) -> "Passers":
        """Return those of some of the episodes, cut to their first frames; None keeps all frames."""
        return self._with(lambda name: getattr(self, name)[rows, :frames])

    @staticmethod
    def joined(pieces: "Sequence[Passers]") -> "Passers":
        """Return those of several batches of one recording, one after another."""
        return pieces[0]._with(lambda name: np.concatenate([getattr(one, name) for one in pieces]))

    def protected(self) -> "Passers":
        """Return a copy that nobody can write into."""
        return self._with(lambda name: read_only(getattr(self, name)))

    def _with(self, changed: Callable[[str], npt.NDArray[Any]]) -> "Passers":
        """Return a copy in which each array, by its name, is another."""
        arrays: dict[str, Any] = {name: changed(name) for name in self.arrays}
        return replace(self, **arrays)

    def joints(self, frames: Frames) -> FloatArray:
        """Return their joints in a frame, (B, W, J, 3), or in frames, (B, T, W, J, 3): float32 [m]."""
        posture, turn = self.bodies.joints[self.posture[:, frames]], self.turn[:, frames, :, None]
        posture = posture - posture.mean(axis=-2, keepdims=True) * np.array([1, 1, 0], dtype=posture.dtype)
        x, y = posture[..., 0], posture[..., 1]
        placed = np.empty(posture.shape, dtype=np.float32)
        placed[..., 0] = np.cos(turn) * x - np.sin(turn) * y + self.place[:, frames, :, None, 0]
        placed[..., 1] = np.sin(turn) * x + np.cos(turn) * y + self.place[:, frames, :, None, 1]
        placed[..., 2] = posture[..., 2] + self.lift[:, frames, :, None]
        return placed

    def clearance(self, cameras: FloatArray, frames: Frames, risen: FloatArray | float = 0.0) -> FloatArray:
        """Return how far cameras are from the nearest passer-by [m], (B, ...); see `passing_clearance`.

        Args:
            cameras: (B, ..., 3) of one frame, or (B, T, 3) of several.
            frames: the frame, or the frames.
            risen: (B, ...) how far the centre has risen by then [m].
        """
        places = np.moveaxis(self.place[:, frames], -2, 0)
        wide = *places.shape[:-1], *[1] * (cameras.ndim - places.ndim + 1), places.shape[-1]
        return passing_clearance(cameras, places.reshape(wide), risen)

    def taken_for(
        self, cameras: FloatArray, joints: FloatArray, hiding: BoolArray, frame: int
    ) -> tuple[BoolArray, FloatArray]:
        """Return which people a track takes a passer-by for, (..., P), and that one's joints, (..., P, J, 3) [m].

        A track goes on with the body that it finds where it expects one. It takes the passer-by who hides most of a
        person, if these are more than `UNDETECTED` of the joints, and the passer-by, who is nearer, appears at most
        `ALIKE` times as large. When the person is seen again, the track has them again. Joints of people whom it takes
        nobody for have no meaning.

        Args:
            cameras: (B, ..., 3) [m].
            joints: (B, ..., P, J, 3) [m].
            hiding: (..., P, J, W), a result of `hiding`.
            frame: the frame.
        """
        bodies = self.joints(frame)
        bodies = bodies.reshape(len(bodies), *[1] * (cameras.ndim - 2), *bodies.shape[1:])  # (B, ..., W, J, 3)
        far = np.linalg.norm(joints.mean(axis=-2) - cameras[..., None, :], axis=-1)
        near = np.linalg.norm(bodies.mean(axis=-2) - cameras[..., None, :], axis=-1)
        share = hiding.mean(axis=-2) * (far[..., None] <= ALIKE * near[..., None, :])
        who = share.argmax(axis=-1)[..., None, None]
        bodies = np.broadcast_to(bodies, (*who.shape[:-3], *bodies.shape[-3:]))
        return share.max(axis=-1) > UNDETECTED, np.take_along_axis(bodies, who, axis=-3)

    def hiding(self, cameras: FloatArray, joints: FloatArray, frames: Frames) -> BoolArray:
        """Return who hides which joints from cameras, (..., P, J, W): a bone's capsule is in the way.

        Args:
            cameras: (B, ..., 3) of one frame, or (B, T, 3) of several [m].
            joints: (B, ..., P, J, 3) [m]; its leading axes broadcast against those of the cameras.
            frames: the frame, or the frames.
        """
        begin = cameras[..., None, None, None, :].astype(np.float32)
        end = joints[..., None, :].astype(np.float32, copy=False)
        bodies = self.joints(frames)  # (B, W, J, 3) or (B, T, W, J, 3)
        *leading, walkers, _, _ = bodies.shape
        place = self.place[:, frames].astype(np.float32)
        reach = np.linalg.norm(bodies[..., :2] - place[..., None, :], axis=-1).max(axis=-1) + THICKEST
        wide = *leading, *[1] * (begin.ndim - len(leading) - 2), walkers  # as lines of sight: (B, ..., 1, 1, W)
        near = passes_by(begin, end, place.reshape(*wide, 2), reach.reshape(wide))
        body = np.broadcast_to(np.arange(bodies[..., 0, 0].size).reshape(wide), near.shape)[near]
        begin, end = (np.broadcast_to(ends, (*near.shape, 3))[near][:, None] for ends in (begin, end))
        first, last = np.moveaxis(bodies.reshape(-1, *bodies.shape[-2:])[body][:, self.bodies.bones], 2, 0)
        near[near] = passes_through(begin, end, first, last, self.bodies.radii).any(axis=1)
        return near


def passing_clearance(cameras: FloatArray, places: Iterable[FloatArray], risen: FloatArray | float = 0.0) -> FloatArray:
    """Return how far cameras are from the nearest passer-by [m], (...,), who is taken for an upright cylinder.

    All are as tall, so the nearest is who is nearest as seen from above.

    Args:
        cameras: (..., 3), relative to people's centre [m].
        places: where each passer-by is, (..., 2), relative to it [m].
        risen: (...,) how far the centre has risen since the first frame: passers-by stay on the floor [m].
    """
    x, y, z = (cameras[..., axis] for axis in range(3))
    nearest = np.full(cameras.shape[:-1], np.inf)
    for place in places:
        nearest = np.minimum(nearest, (x - place[..., 0]) ** 2 + (y - place[..., 1]) ** 2)
    middle, half = (PASSER_TOP + FLOOR) / 2, (PASSER_TOP - FLOOR) / 2
    return cylinder_clearance(np.sqrt(nearest), z + risen - middle, half, PASSER_RADIUS)
