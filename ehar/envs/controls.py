"""The actions of the Gymnasium environments: grid moves, or a target to fly to."""

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from ehar.arrays import FloatArray
from ehar.envs.observations import scaled_velocity
from ehar.errors import EpisodeError
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import Vehicle
from ehar.motion import GridMotion, Motion
from ehar.viewpoint import AZIMUTH, DISTANCE, MOVES, POLAR, Workspace, apply_moves
from ehar.world import PAPER, World


class Controls(Protocol):
    """An action space, and the motion that carries out its actions."""

    @property
    def motion(self) -> Motion:
        """The motion that carries the camera."""
        ...

    @property
    def action_space(self) -> spaces.Space[Any]:
        """The actions of one episode."""
        ...

    @property
    def observation_spaces(self) -> dict[str, spaces.Space[Any]]:
        """The spaces of the arrays that these controls add to every observation."""
        ...

    def targets(self, actions: npt.NDArray[Any], viewpoint: FloatArray, where: str) -> FloatArray:
        """Return the targets (B, 3) of actions (B, ...) at viewpoints (B, 3).

        Raises:
            EpisodeError: an action is not in the action space; the message begins with `where`.
        """
        ...

    def observations(self) -> dict[str, FloatArray]:
        """Return the arrays that are added to the present observations, each (B, ...) in float32."""
        ...


class GridControls:
    """The paper's 7 moves, numbered as in `ehar.viewpoint.MOVES`; a move to where no camera may be has no effect.

    Args:
        world: where the camera may be, and what stands in its way.
        moving_centre: whether people walk about, as in streams. Obstacles move past then, so that no cell is free of
            them for good, and it is for the motion to keep clear.
    """

    def __init__(self, *, world: World = PAPER, moving_centre: bool = False) -> None:
        """Create the controls."""
        self._space = None if moving_centre else world.free_space
        self.motion = GridMotion(workspace=world.workspace)
        self.action_space = spaces.Discrete(len(MOVES))
        self.observation_spaces: dict[str, spaces.Space[Any]] = {}

    def targets(self, actions: npt.NDArray[Any], viewpoint: FloatArray, where: str) -> FloatArray:
        """Return the neighbouring cells (B, 3) that moves (B,) lead to."""
        check_moves(actions, len(viewpoint), where)
        if self._space is not None:
            return self._space.after(viewpoint, actions)
        return apply_moves(viewpoint, actions, self.motion.workspace)

    def observations(self) -> dict[str, FloatArray]:
        """Return nothing: the viewpoint says everything about a camera on the grid."""
        return {}


class FlightControls:
    """A target viewpoint for a vehicle, as four numbers from -1 to 1.

    The first number is the distance and the last is the polar angle, from the least to the greatest of the workspace.
    The two in between are a direction whose angle is the azimuth, sine first, as in the observed viewpoint. The length
    of the direction does not matter; a direction of length 0 keeps the azimuth. Numbers beyond -1 and 1 are clipped.

    Observations also have `velocity` (3,): the rates of distance, azimuth and polar angle, each divided by the greatest
    that the vehicle can reach.

    Args:
        vehicle: the vehicle that carries the camera.
        workspace: where the camera may be; the paper's by default.
        moving_centre: whether the vehicle also follows people, as it does in streams.
    """

    def __init__(self, *, vehicle: Vehicle, workspace: Workspace | None = None, moving_centre: bool = False) -> None:
        """Create the controls."""
        self.motion = FlightMotion(vehicle=vehicle, workspace=workspace, moving_centre=moving_centre)
        self.action_space = spaces.Box(-1, 1, (4,), np.float32)
        self.observation_spaces: dict[str, spaces.Space[Any]] = {"velocity": spaces.Box(-1, 1, (3,), np.float32)}

    def targets(self, actions: npt.NDArray[Any], viewpoint: FloatArray, where: str) -> FloatArray:
        """Return the target viewpoints (B, 3) that actions (B, 4) stand for."""
        if actions.shape != (len(viewpoint), 4) or not np.isfinite(actions).all():
            raise EpisodeError(f"{where}: expected {len(viewpoint)} times 4 finite numbers, got {actions.tolist()}")
        distance, sine, cosine, polar = np.clip(actions.astype(np.float64), -1, 1).T
        workspace = self.motion.workspace
        targets = np.empty(viewpoint.shape)
        targets[:, DISTANCE] = _between(workspace.distance_min, workspace.distance_max, distance)
        targets[:, POLAR] = _between(workspace.polar_min, workspace.polar_max, polar)
        directed = np.hypot(sine, cosine) > 1e-6
        targets[:, AZIMUTH] = np.where(directed, np.arctan2(sine, cosine), viewpoint[:, AZIMUTH])
        return targets

    def observations(self) -> dict[str, FloatArray]:
        """Return the velocities (B, 3)."""
        motion = self.motion
        return {"velocity": scaled_velocity(motion.velocity, motion.vehicle, motion.workspace)}


def _between(low: float, high: float, action: FloatArray) -> FloatArray:
    """Return actions from -1 to 1, scaled to [low, high]."""
    return low + (high - low) * (action + 1) / 2


def check_moves(actions: npt.NDArray[Any], count: int, where: str) -> None:
    """Raise an EpisodeError, whose message begins with `where`, if actions are not so many moves of the grid."""
    whole = actions.dtype.kind in "iu"
    if not whole or actions.shape != (count,) or ((actions < 0) | (actions >= len(MOVES))).any():
        raise EpisodeError(f"{where}: expected {count} whole moves from 0 to {len(MOVES) - 1}, got {actions.tolist()}")
