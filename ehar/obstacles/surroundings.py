"""What stands and walks around the people of some episodes, frame by frame."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ehar.arrays import BoolArray, FloatArray, IntArray, in_brief, read_only
from ehar.obstacles.passers import Frames, Passers
from ehar.obstacles.shapes import MARGIN, Obstacles
from ehar.viewpoint import cartesian


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
            hidden |= self.passers.hiding(cameras, joints, frames).any(axis=-1)
        return hidden

    def show(
        self, viewpoint: FloatArray, joints: FloatArray, frame: int, gaze: FloatArray | None = None
    ) -> tuple[FloatArray, BoolArray]:
        """Return the joints that people are taken to have in a frame, and which of them are hidden.

        They are their own, but where a track takes a passer-by for somebody.

        Args:
            viewpoint: (B, ..., 3).
            joints: (B, ..., P, J, 3) [m], relative to what cameras look at.
            frame: the frame.
            gaze: (B, ..., 3), what they look at, from the centre [m]; None where it is the centre.
        """
        beside = None if gaze is None else gaze[..., None, None, :]
        around = joints if beside is None else joints + beside
        passers = self.passers
        if passers is None or not passers.mistakable:
            return joints, self.hide(viewpoint, around, frame)
        cameras = cartesian(viewpoint)
        hiding = passers.hiding(cameras, around, frame)
        taken, theirs = passers.taken_for(cameras, around, hiding, frame)
        moved, taken = self._moved(frame, cameras), taken[..., None]
        around = np.where(taken[..., None], theirs, around)
        hidden = self.obstacles.hide(cameras + moved, around + moved[..., None, None, :])
        joints = np.where(taken[..., None], theirs if beside is None else theirs - beside, joints)
        return joints.astype(np.float32), hidden | (hiding.any(axis=-1) & ~taken)

    @property
    def meets_passers(self) -> bool:
        """Whether passers-by walk to where cameras may be."""
        return self.passers is not None and self.passers.met

    @property
    def can_be_hit(self) -> bool:
        """Whether there is anything that a camera can come too near to."""
        return bool(self.obstacles) or self.meets_passers

    def clearance(self, viewpoint: FloatArray, frames: Frames) -> FloatArray:
        """Return how far cameras are from the nearest thing that they can hit [m], in the shape of the viewpoints.

        See `hide`.
        """
        cameras = cartesian(viewpoint)
        moved = self._moved(frames, cameras)
        clearance = self.obstacles.clearance(cameras + moved)
        if self.passers is None or not self.meets_passers:
            return clearance
        return np.minimum(clearance, self.passers.clearance(cameras, frames, moved[..., 2]))

    def select(self, rows: IntArray | slice, frames: int | None = None) -> "Surroundings":
        """Return those of some of the episodes, cut to their first frames; None keeps all frames."""
        moved = None if self.moved is None else self.moved[rows, :frames]
        passers = None if self.passers is None else self.passers.select(rows, frames)
        return Surroundings(self.obstacles, moved, passers)

    @staticmethod
    def joined(pieces: "Sequence[Surroundings | None]") -> "Surroundings | None":
        """Return those of several batches of one world, one after another; None in an open one."""
        held = [piece for piece in pieces if piece is not None]
        if not held:
            return None
        moved = [piece.moved for piece in held if piece.moved is not None]
        walking = [piece.passers for piece in held if piece.passers is not None]
        passers = Passers.joined(walking) if walking else None
        return Surroundings(held[0].obstacles, np.concatenate(moved) if moved else None, passers)

    @property
    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """All arrays, by name."""
        held: dict[str, npt.NDArray[Any]] = {} if self.moved is None else {"moved": self.moved}
        if self.passers is not None:
            held |= {f"passers' {name}": array for name, array in self.passers.arrays.items()}
        return held

    def protected(self) -> "Surroundings":
        """Return a copy that nobody can write into."""
        passers = None if self.passers is None else self.passers.protected()
        return Surroundings(self.obstacles, None if self.moved is None else read_only(self.moved), passers)

    def _moved(self, frames: Frames, cameras: FloatArray) -> FloatArray:
        """Return how far the centre has moved in the frames of cameras (B, ..., 3), in a shape that broadcasts."""
        return np.zeros(3) if self.moved is None else _as_wide(self.moved[:, frames], cameras.ndim)


def too_near(clearance: FloatArray) -> BoolArray:
    """Return which clearances [m] are less than the margin; rounding does not count."""
    near: BoolArray = clearance < MARGIN - 1e-6
    return near


def _as_wide(array: FloatArray, axes: int) -> FloatArray:
    """Return an array (B, 3) or (B, T, 3) with axes of length 1 before the last, so that it has `axes` of them."""
    return array.reshape(*array.shape[:-1], *[1] * (axes - array.ndim), array.shape[-1])
