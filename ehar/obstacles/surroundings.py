"""What stands and walks around the people of some episodes, frame by frame."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray, in_brief, read_only
from ehar.obstacles.shapes import MARGIN, Obstacles, cylinder_cuts
from ehar.viewpoint import cartesian

_OF_PASSERS = ("place", "low", "high", "tracked")  # their arrays
Frames = int | slice  # one frame, of arrays (B, ...); or several, of arrays (B, T, ...)


@dataclass(frozen=True, eq=False, repr=False)
class Passers:
    """People who walk past those that are watched: upright cylinders.

    Args:
        place: (B, L, W, 2) where they are in each frame, relative to people's centre [m].
        low: (B, W) height of their feet [m].
        high: (B, W) height of the top of their heads [m].
        radius: their radius [m].
        tracked: (B, L, W, 4) what planners are told in each frame: where they are thought to be [m] and how fast they
            walk [m/s], each along x and y.
    """

    place: FloatArray
    low: FloatArray
    high: FloatArray
    radius: float
    tracked: FloatArray

    __repr__ = in_brief


@dataclass(frozen=True, eq=False, repr=False)
class Surroundings:
    """What stands and walks around the people of B episodes of L frames.

    Viewpoints and joints are relative to people's centre. In streams the centre follows people, and obstacles stay
    where they are.

    Args:
        obstacles: what stands there, in the frame whose origin is the centre in the first frame.
        moved: (B, L, 3) how far the centre has moved since the first frame [m]; None if it stays.
        passers: who walks past; None if nobody does.
    """

    obstacles: Obstacles
    moved: FloatArray | None = None
    passers: Passers | None = None

    __repr__ = in_brief

    def hide(self, viewpoint: FloatArray, joints: FloatArray, frames: Frames) -> BoolArray:
        """Return which joints are hidden from cameras, (..., P, J).

        Args:
            viewpoint: (B, ..., 3) of one frame, or (B, T, 3) of several.
            joints: (B, ..., P, J, 3) [m]; its leading axes broadcast against those of the viewpoints.
            frames: the frame, or the frames.
        """
        cameras = cartesian(viewpoint)
        moved = self._moved(frames, cameras)
        hidden = self.obstacles.hide(cameras + moved, joints + moved[..., None, None, :])
        if self.passers is not None:
            hidden |= _hidden_by(self.passers, cameras, joints, frames)
        return hidden

    def clearance(self, viewpoint: FloatArray, frames: Frames) -> FloatArray:
        """Return how far cameras are from the nearest obstacle [m], in the shape of the viewpoints; see `hide`."""
        cameras = cartesian(viewpoint)
        return self.obstacles.clearance(cameras + self._moved(frames, cameras))

    def select(self, rows: IntArray | slice, frames: int | None = None) -> "Surroundings":
        """Return those of some of the episodes, cut to their first frames; None keeps all frames."""
        moved = None if self.moved is None else self.moved[rows, :frames]
        passers = self.passers
        if passers is not None:
            place, tracked = passers.place[rows, :frames], passers.tracked[rows, :frames]
            passers = replace(passers, place=place, low=passers.low[rows], high=passers.high[rows], tracked=tracked)
        return Surroundings(self.obstacles, moved, passers)

    @staticmethod
    def joined(pieces: "Sequence[Surroundings | None]") -> "Surroundings | None":
        """Return those of several batches of one world, one after another; None in an open one."""
        held = [piece for piece in pieces if piece is not None]
        if not held:
            return None
        moved = [piece.moved for piece in held if piece.moved is not None]
        walkers = [piece.passers for piece in held if piece.passers is not None]
        passers = held[0].passers
        if passers is not None:
            place, low, high, tracked = (
                np.concatenate([getattr(one, name) for one in walkers]) for name in _OF_PASSERS
            )
            passers = Passers(place, low, high, passers.radius, tracked)
        return Surroundings(held[0].obstacles, np.concatenate(moved) if moved else None, passers)

    @property
    def arrays(self) -> dict[str, FloatArray]:
        """All arrays, by name."""
        held = {} if self.moved is None else {"moved": self.moved}
        if self.passers is not None:
            held |= {f"passers' {name}": getattr(self.passers, name) for name in _OF_PASSERS}
        return held

    def protected(self) -> "Surroundings":
        """Return a copy that nobody can write into."""
        passers = self.passers
        if passers is not None:
            place, low, high, tracked = (read_only(getattr(passers, name)) for name in _OF_PASSERS)
            passers = Passers(place, low, high, passers.radius, tracked)
        return Surroundings(self.obstacles, None if self.moved is None else read_only(self.moved), passers)

    def _moved(self, frames: Frames, cameras: FloatArray) -> FloatArray:
        """Return how far the centre has moved in the frames of cameras (B, ..., 3), in a shape that broadcasts."""
        return np.zeros(3) if self.moved is None else _as_wide(self.moved[:, frames], cameras.ndim)


def too_near(clearance: FloatArray) -> BoolArray:
    """Return which clearances [m] are less than the margin; rounding does not count."""
    near: BoolArray = clearance < MARGIN - 1e-6
    return near


def _hidden_by(passers: Passers, cameras: FloatArray, joints: FloatArray, frames: Frames) -> BoolArray:
    """Return which joints are hidden from cameras by people who pass."""
    begin, end = cameras[..., None, None, :].astype(np.float32), joints.astype(np.float32, copy=False)
    hidden = np.zeros(np.broadcast_shapes(begin.shape, end.shape)[:-1], dtype=bool)
    for walker in range(passers.place.shape[2]):
        at = np.zeros((*passers.place[:, frames].shape[:-2], 3), dtype=np.float32)
        at[..., :2] = passers.place[:, frames, walker]
        at = _as_wide(at, cameras.ndim)[..., None, None, :]
        low, high = (
            height[:, walker].astype(np.float32).reshape(-1, *[1] * (begin.ndim - 2))
            for height in (passers.low, passers.high)
        )
        hidden |= cylinder_cuts(begin - at, end - at, low, high, passers.radius)
    return hidden


def _as_wide(array: FloatArray, axes: int) -> FloatArray:
    """Return an array (B, 3) or (B, T, 3) with axes of length 1 before the last, so that it has `axes` of them."""
    return array.reshape(*array.shape[:-1], *[1] * (axes - array.ndim), array.shape[-1])
