"""The steps that a camera can make from frame to frame: a move of the grid, or a flight within a vehicle's limits."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.flight.vehicle import Vehicle
from ehar.motion import GridMotion, Motion
from ehar.viewpoint import AZIMUTH, Workspace, cartesian, neighbours, wrap_difference

LEAD = 2  # frames before the first step that a third difference needs


class BrokenStep(NamedTuple):
    """A step that the camera cannot have made by itself.

    Args:
        episode: index of the episode.
        step: index of the step; step 0 ends in the second frame.
        what: what was got, and what was expected.
    """

    episode: int
    step: int
    what: str


@dataclass(frozen=True)
class StepLimits:
    r"""The limits of a camera's steps.

    On the grid, a step is one of the 7 moves. In flight, the first, second and third difference of the camera's place
    keep the limits of speed, acceleration and jerk. This is exact: :math:`\Delta^n x / \Delta t^n` is a weighted mean
    of the n-th derivative in these frames, and a mean is never above the greatest value. Climb, descent and yaw rate
    are first differences too.

    Args:
        workspace: where the camera may be.
        frame_time: duration of a frame [s].
        vehicle: what carries the camera; None on the grid.
    """

    workspace: Workspace
    frame_time: float
    vehicle: Vehicle | None = None

    @staticmethod
    def of(motion: Motion, frame_time: float) -> "StepLimits | None":
        """Return a copy of the limits of a motion of ehar; None for your own motion, whose limits nobody knows."""
        if type(motion) is GridMotion:
            return StepLimits(replace(motion.workspace), frame_time)
        from ehar.flight.motion import FlightMotion  # imported here: Ruckig takes time to load

        if type(motion) is not FlightMotion:
            return None
        return StepLimits(replace(motion.workspace), frame_time, replace(motion.vehicle))

    def first_broken(self, way: FloatArray, error: float) -> BrokenStep | None:
        """Return the first step of the first episode that the camera cannot have made; None if there is none.

        Args:
            way: (B, `LEAD` + T, 3) viewpoints. The first `LEAD` frames lie before the first step; see `from_rest`.
            error: the error of each number in `way` [m], [rad].
        """
        found = []
        for rank, limit in enumerate(self._flown(way, error) if self.vehicle else self._moved(way, error)):
            if limit.off.any():
                episode, step = (int(index) for index in np.argwhere(limit.off)[0])
                found.append((episode, step, rank, limit))
        if not found:
            return None
        episode, step, _, limit = min(found, key=lambda one: one[:3])
        before, after = (way[episode, LEAD + step + frame].tolist() for frame in (0, 1))
        got = "" if limit.values is None else f" with {limit.name} {limit.values[episode, step]:.6g}"
        return BrokenStep(episode, step, f"got from {before} to {after}{got}, expected {limit.expected}")

    def _moved(self, way: FloatArray, error: float) -> Iterator["_Limit"]:
        before, after = way[:, LEAD:-1], way[:, LEAD + 1 :]
        off = neighbours(before, self.workspace) - after[..., None, :]
        off[..., AZIMUTH] = wrap_difference(off[..., AZIMUTH])
        yield _Limit(np.abs(off).max(axis=-1).min(axis=-1) > error, f"a move of the grid within {self.workspace}")

    def _flown(self, way: FloatArray, error: float) -> Iterator["_Limit"]:
        vehicle, time = self.vehicle, self.frame_time
        assert vehicle is not None
        places = cartesian(way)
        place_error = error * np.sqrt(1 + 2 * self.workspace.distance_max**2)

        def limit(values: FloatArray, name: str, greatest: float, slack: float) -> _Limit:
            expected = f"at most {greatest:.6g} of {vehicle.name!r}"
            return _Limit(values > greatest + slack, expected, name, values)

        for order, name in enumerate(("speed", "acceleration", "jerk"), 1):
            mean = np.diff(places, n=order, axis=1)[:, LEAD + 1 - order :] / time**order
            lengths = np.linalg.norm(mean, axis=-1)
            yield limit(lengths, name, getattr(vehicle, name), 2**order * place_error / time**order)
        upwards = np.diff(places[:, LEAD:, 2], axis=1) / time
        yield limit(upwards, "climb_speed", vehicle.climb_speed, 2 * place_error / time)
        yield limit(-upwards, "descent_speed", vehicle.descent_speed, 2 * place_error / time)
        turned = wrap_difference(np.diff(way[:, LEAD:, AZIMUTH], axis=1)) / time
        yield limit(np.abs(turned), "yaw_rate", vehicle.yaw_rate, 2 * error / time)
        inside = self.workspace.contains(way[:, LEAD + 1 :], tolerance=max(error, 1e-9))
        yield _Limit(~inside, f"a place within {self.workspace}")


def from_rest(way: FloatArray) -> FloatArray:
    """Return viewpoints (B, T, 3) of a camera that rests before the first frame, with the `LEAD` frames before."""
    return np.concatenate([np.repeat(way[:, :1], LEAD, axis=1), way], axis=1)


class _Limit(NamedTuple):
    off: BoolArray  # (B, T - 1), the steps that break it
    expected: str
    name: str = ""
    values: FloatArray | None = None  # (B, T - 1)
