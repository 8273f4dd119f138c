"""Random flights, to see whether limits are kept: of any vehicle, from any state, to any target."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BPoly

from ehar.arrays import FloatArray
from ehar.flight.centre import centre_limits
from ehar.flight.limits import limit_shares
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import Vehicle
from ehar.localisation import CentreMotion, Localisation, smoothed
from ehar.obstacles import Obstacles, Surroundings
from ehar.viewpoint import AZIMUTH, Workspace, cartesian

FLIGHTS = 50  # with one vehicle
FRAMES = 40  # of each flight
SAMPLE_RATE = 1000  # [Hz]
REPLAN = 8  # frames between new paths
PATH_FRAMES = 60  # of a path


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


def random_paths(rng: np.random.Generator, motion: FlightMotion, target: FloatArray, frame_time: float) -> FloatArray:
    """Return quintics from the present states to rest at targets (B, 3), slow and far too fast ones, (B, F, 3, 3).

    A third begins a little off.
    """
    state, rows = motion.sample(np.array([frame_time])), np.arange(len(target))
    place, velocity, acceleration = (part[:, 0] for part in state[:3])
    place = place + rng.normal(0, 0.02, target.shape) * (rng.random((len(target), 1)) < 1 / 3)
    duration = rng.uniform(0.3, 6.0, (len(target), 1))
    rest = np.zeros(target.shape)
    ends = [[place, velocity * duration, acceleration * duration**2], [target, rest, rest]]
    quintic = BPoly.from_derivatives([0, 1], np.array(ends))
    share = np.minimum(np.arange(1, PATH_FRAMES + 1) * frame_time / duration, 1)
    rates = [quintic(share, order)[rows, :, rows] / duration[..., None] ** order for order in range(3)]
    return np.stack(rates, axis=2)


def worst_stream_excess(
    rng: np.random.Generator,
    streams: int,
    frames: int,
    obstacles: Obstacles | None = None,
    flights: int = FLIGHTS,
    *,
    paths: bool = False,
) -> Excess:
    """Fly whole streams of people who walk at random, and return the worst excess at 1 kHz in the world's frame.

    The camera's place in the world is differentiated, so nothing but places goes into it. Each vehicle flies
    `flights` streams around the centre that it follows. Among obstacles it takes ways around them, and evades those
    towards which it is carried; some streams begin within one. With `paths`, vehicles follow random ones, most of which
    nothing can fly, and new ones again and again, as if they planned. `workspace` is 1 if a camera left the workspace,
    else 0.
    """
    flown, worst, out = 0, -np.inf, 0.0
    workspace, step = Workspace(), 1 / SAMPLE_RATE
    while flown < streams:
        vehicle, fps = random_vehicle(rng), float(rng.choice([25, 30]))
        walks = np.cumsum(rng.normal(0, rng.uniform(0.005, 0.1), (flights, frames, 3)), axis=1)
        walks[rng.random(flights) < 0.2, frames // 2 :, 0] += 3.0  # a tracker that leaps
        centres = [smoothed(*Localisation().estimated(walk, fps, 0), 1 / fps, centre_limits(vehicle)) for walk in walks]
        motion = FlightMotion(vehicle=vehicle, workspace=workspace, moving_centre=True)
        motion.centre = CentreMotion(*(np.stack(parts) for parts in zip(*centres, strict=True)))
        motion.keep_clear(None if obstacles is None else Surroundings(obstacles, motion.centre.position))
        motion.reset(random_viewpoints(rng, flights, workspace), 1 / fps)
        target = random_viewpoints(rng, flights, workspace)
        times = np.arange(0, 1 / fps, step)
        for frame in range(frames - 1):
            jumps = rng.random(flights) < 0.05
            target = np.where(jumps[:, None], random_viewpoints(rng, flights, workspace), target)
            if paths and frame % REPLAN == 0:
                path = random_paths(rng, motion, target, 1 / fps)
            motion.follow(path[:, frame % REPLAN :]) if paths else motion.advance(target)
            state, after = motion.sample(times), times[:, None]
            p, v, a, j = (part[:, frame, None] for part in motion.centre)
            place = cartesian(state.viewpoint) + p + after * (v + after * (a / 2 + after / 6 * j))
            rates = [np.diff(place, order, axis=1) / step**order for order in (1, 2, 3)]
            lengths = [np.linalg.norm(rate, axis=-1).max() for rate in rates]
            upwards, turning = rates[0][..., 2], np.abs(state.velocity[..., AZIMUTH]).max()
            shares = (
                lengths[0] / vehicle.speed,
                (lengths[1] - 1e-7) / vehicle.acceleration,  # less the rounding of differences
                (lengths[2] - 1e-4) / vehicle.jerk,
                upwards.max() / vehicle.climb_speed,
                -upwards.min() / vehicle.descent_speed,
                turning / vehicle.yaw_rate,
            )
            worst = max(worst, float(max(shares)) - 1)
            out = max(out, float(not workspace.contains(state.viewpoint).all()))
        flown += flights
    return Excess(flown * frames, worst, out)


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
