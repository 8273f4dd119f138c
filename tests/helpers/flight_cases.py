"""Random flights, to see whether limits are kept: of any vehicle, from any state, to any target."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ehar.arrays import FloatArray
from ehar.flight.limits import limit_shares
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import Vehicle
from ehar.viewpoint import Workspace

FLIGHTS = 50  # with one vehicle
FRAMES = 40  # of each flight
SAMPLE_RATE = 1000  # [Hz]


@dataclass(frozen=True)
class Excess:
    """The worst of many frames of flight."""

    cases: int  # frames, each with a state, a target and limits of its own
    limits: float  # by how much the worst sample exceeds a limit, relative to the limit; below 0 if none does
    workspace: float  # how far the worst sample is out of the workspace [m] or [rad]; below 0 if none is


def random_vehicle(rng: np.random.Generator) -> Vehicle:
    """Return a vehicle from sluggish to agile; each limit is drawn by itself."""

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    return Vehicle(
        name="random",
        speed=between(0.5, 30),
        acceleration=between(0.5, 20),
        jerk=between(1, 60),
        climb_speed=between(0.3, 10),
        descent_speed=between(0.3, 10),
        yaw_rate=between(0.2, 3.5),
    )


def random_viewpoints(rng: np.random.Generator, count: int, workspace: Workspace) -> FloatArray:
    """Return viewpoints (count, 3), a fifth of them on the workspace's bounds, straight above included."""
    low = np.array([workspace.distance_min, -np.pi, workspace.polar_min])
    high = np.array([workspace.distance_max, np.pi, workspace.polar_max])
    drawn = low + (high - low) * rng.random((count, 3))
    bound = np.where(rng.random((count, 3)) < 0.5, low, high)
    return np.where(rng.random((count, 1)) < 0.2, bound, drawn)


def worst_excess(
    rng: np.random.Generator,
    cases: int,
    *,
    workspace: Workspace | None = None,
    draw_vehicle: Callable[[np.random.Generator], Vehicle] = random_vehicle,
) -> Excess:
    """Fly at least so many frames, at 25, 30 or 60 to a second, and return the worst excess at 1 kHz.

    A third of the targets jump in every frame, a third drift, and a third are held for a while.
    """
    flown, limits, out = 0, -np.inf, -np.inf
    workspace = workspace or Workspace()
    while flown < cases:
        vehicle, frame_time = draw_vehicle(rng), 1 / rng.choice([25, 30, 60])
        motion = FlightMotion(vehicle=vehicle, workspace=workspace)
        motion.reset(random_viewpoints(rng, FLIGHTS, workspace), frame_time)
        target = random_viewpoints(rng, FLIGHTS, workspace)
        kind = np.arange(FLIGHTS) % 3
        times = np.append(np.arange(0, frame_time, 1 / SAMPLE_RATE), frame_time)
        for _ in range(FRAMES):
            jumps = (kind == 0) | ((kind == 2) & (rng.random(FLIGHTS) < 0.05))
            target = np.where(jumps[:, None], random_viewpoints(rng, FLIGHTS, workspace), target)
            target = np.where((kind == 1)[:, None], target + rng.normal(0, 0.03, target.shape), target)
            motion.advance(target)
            state = motion.sample(times)
            limits = max(limits, float(limit_shares(vehicle, state).max()) - 1)
            distance, _, polar = np.moveaxis(state.viewpoint, -1, 0)
            beyond = (
                workspace.distance_min - distance,
                distance - workspace.distance_max,
                workspace.polar_min - polar,
                polar - workspace.polar_max,
            )
            out = max(out, float(np.max(beyond)))
        flown += FLIGHTS * FRAMES
    return Excess(flown, limits, out)
