"""The target of a camera in the direction of a move: the next cell, or for a vehicle a farther point."""

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.flight.vehicle import Vehicle
from ehar.motion import Motion
from ehar.obstacles.free_space import FreeSpace
from ehar.obstacles.shapes import Obstacles
from ehar.planner import Context, Observation
from ehar.viewpoint import AZIMUTH, DISTANCE, MOVES, apply_moves

HEADING_TIME = 1.0  # [s]; a vehicle brakes for its target, so it approaches a near one slowly
MOST_TURN = 0.9 * np.pi  # [rad] from an azimuth to the one to head for, for vehicles that turn farther in that time


def axis_ways(vehicle: Vehicle, viewpoint: FloatArray) -> FloatArray:
    """Return about how far a vehicle gets along each axis of viewpoints (..., 3) alone in a second [m], [rad], [rad].

    It says how far to head, and limits nothing: the motion does that. The rate of an angle is the speed divided by the
    distance, the azimuth's at most the yaw rate. So near the pole, where circles are small, the azimuth is faster than
    that, and where the polar angle climbs or sinks, the vehicle may be slower. An azimuth is never half a turn away:
    the motion goes the short way there.
    """
    speed = np.full(viewpoint.shape[:-1], vehicle.speed)
    rate = vehicle.speed / viewpoint[..., DISTANCE]
    ways = HEADING_TIME * np.stack([speed, np.minimum(rate, vehicle.yaw_rate), rate], axis=-1)
    ways[..., AZIMUTH] = np.minimum(ways[..., AZIMUTH], MOST_TURN)
    return ways


def free_space(context: Context) -> FreeSpace | None:
    """Return the cells that keep clear of obstacles; None if all do.

    In a stream they change with every frame: None too, as it takes too long to find them for each move.
    """
    obstacles = context.world.obstacles
    return FreeSpace.of(context.workspace, obstacles) if obstacles and context.length is not None else None


def known_obstacles(context: Context, observation: Observation) -> Obstacles:
    """Return the obstacles of a world; none if the centre moves, and nobody says where it is."""
    stays = context.length is not None
    return context.world.obstacles if stays or observation.centre is not None else Obstacles()


def moved(context: Context, viewpoint: FloatArray, moves: IntArray) -> FloatArray:
    """Return where moves (...,) lead from viewpoints (..., 3); one to where the camera cannot be has no effect."""
    space = free_space(context)
    return apply_moves(viewpoint, moves, context.workspace) if space is None else space.after(viewpoint, moves)


def carried(motion: Motion | None, context: Context, viewpoint: FloatArray, moves: IntArray) -> FloatArray:
    """Return where a motion of B x F cameras gets by moves (B, F) from viewpoints (B, F, 3).

    Without one it is where the moves lead: through what stands in the way, in streams.
    """
    there = moved(context, viewpoint, moves)
    return there if motion is None else motion.advance(there.reshape(-1, 3)).reshape(there.shape)


def move_target(context: Context, viewpoint: FloatArray, moves: IntArray) -> FloatArray:
    """Return targets (..., 3) in the direction of moves (...,): the next cell, or for a vehicle a second's way.

    Args:
        context: the episodes' context, which names the track.
        viewpoint: (..., 3), the cameras' viewpoints.
        moves: indices into `MOVES`.
    """
    if context.vehicle is None:
        return moved(context, viewpoint, moves)
    return context.workspace.clip(viewpoint + MOVES[moves] * axis_ways(context.vehicle, viewpoint))
