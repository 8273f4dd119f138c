"""How fast recognition, the world and planning are: ratios that hold on any machine, and times on this one.

Every measurement runs in processes of its own with one torch thread each, as the benchmark's workers do.
"""

import json
import math
import multiprocessing
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch

from ehar.arrays import FloatArray
from ehar.axis_limits import limits_to_target
from ehar.datasets.source import load_data
from ehar.errors import ModelError
from ehar.motion import GridMotion
from ehar.motion_data import MotionData
from ehar.planner import Context
from ehar.recogniser import Recogniser
from ehar.scenario import windows
from ehar.sensor import PerfectSensor, Sensed, SensorNoise, draw_noise
from ehar.spherical_motion import SphericalState
from ehar.time_optimal import TimeOptimal
from ehar.vehicle import VEHICLES
from ehar.viewpoint import Workspace, sample_starts
from eval.results import write_text
from eval.tables import Table
from planners.camera_limits import camera_limits
from planners.next_best_view import DEFAULT_HORIZON, FLIGHT_PLAN_TIME
from planners.trajectory_solver import TrajectorySolver
from planners.trajectory_timing import measure_solves
from recognition.calibration import Temperature
from recognition.causal import CausalCTRGCN
from recognition.causal_layers import refreshes
from recognition.flops import count_flops
from recognition.networks import NetworkSpec
from recognition.storage import load_recogniser
from recognition.streaming import PrefixRecogniser, StreamingRecogniser
from recognition.training_config import Form, Size

DATA = "duo"  # 2 persons of 16 joints
WORKERS = 2  # processes side by side, one a core, that are timed together
EARLY = 5  # the frame, counted from 1, that the last one is compared with
VEHICLE = VEHICLES["px4-auto"]
PACE = 0.1  # share of the vehicle's speed and acceleration that each axis begins a flight with, at most


@dataclass(frozen=True)
class Effort:
    """How much is measured; the defaults take about two minutes.

    Args:
        length: L, frames of an episode.
        episodes: run in lockstep by the streaming recogniser.
        repeats: of each episode; medians are taken over them.
        small_episodes: run by both forms of the small network, which see every prefix.
        published_episodes: the same for the published widths.
        cameras: moved and seen through together when the world is measured alone.
        flights: that Ruckig is asked for at once.
        plans: that are solved on each track, each from the one before it, 15 in a row.
    """

    length: int = 60
    episodes: int = 128
    repeats: int = 7
    small_episodes: int = 32
    published_episodes: int = 2
    cameras: int = 2048
    flights: int = 5000
    plans: int = 600


class Target(NamedTuple):
    """What a figure is to reach."""

    bound: float
    at_most: bool = False

    def met(self, figure: float) -> bool:
        """Return whether the figure reaches the target."""
        return figure <= self.bound if self.at_most else figure >= self.bound


TARGETS = {
    "flops_ratio": Target(20.0),
    "time_ratio": Target(10.0),
    "late_over_early_frame": Target(1.2, at_most=True),
    "recognised_frames_per_s": Target(3000.0),
    "world_frames_per_s": Target(500_000.0),
    "nbv_solve_ms_median": Target(3.0, at_most=True),
    "nbv_solve_ms_p95": Target(10.0, at_most=True),
    "nbv_fallback_share": Target(0.01, at_most=True),
    "ruckig_us_per_call": Target(5.0, at_most=True),
}


def bench(out: Path, effort: Effort | None = None) -> dict[str, float]:
    """Measure everything and write it to `out` as JSON.

    Returns:
        flops_ratio, time_ratio: what the published form costs over an episode, evaluated on every prefix, over
            what the streaming form costs, at the small widths; and, with `_published_widths` behind their names,
            at the published ones, where the published form also strides over time.
        late_over_early_frame: the streaming recogniser's time for the last frame over that for the 5th.
        refresh_over_plain_frame: its time for a frame that refreshes the topologies over that for another.
        recognised_frames_per_s: of `WORKERS` processes together, from sensing to calibrated probabilities.
        world_frames_per_s: of as many, moving cameras and sensing alone.
        nbv_solve_ms_median, nbv_solve_ms_p95: one solve at the default horizon, over the plans on the grid and those
            of a PX4 in mission mode.
        nbv_fallback_share: of those plans, the share that was not what the solver that was asked for has found.
        ruckig_us_per_call: one flight of that vehicle on three axes.
        shipped_weights: 1 if the streaming recogniser is the one that ships, 0 if it is untrained.
    """
    effort = effort or Effort()
    data = load_data(DATA)
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(WORKERS, mp_context=context, initializer=torch.set_num_threads, initargs=(1,)) as pool:
        small = pool.submit(compare_forms, data, "small", effort.small_episodes, effort.length).result()
        wide = pool.submit(compare_forms, data, "published", effort.published_episodes, effort.length).result()
        recognised = [pool.submit(time_recogniser, data, effort) for _ in range(WORKERS)]
        frame_seconds = np.stack([future.result() for future in recognised])
        moved = [pool.submit(time_world, data, effort) for _ in range(WORKERS)]
        world_rate = sum(effort.cameras / future.result() for future in moved)
        solves = pool.submit(time_solves, data, effort).result()
        ruckig_seconds = pool.submit(time_ruckig, effort).result()
    figures = {
        **small._asdict(),
        **{f"{name}_published_widths": ratio for name, ratio in wide._asdict().items()},
        **frame_ratios(frame_seconds.mean(axis=0)),
        "recognised_frames_per_s": float((effort.episodes * effort.length / frame_seconds.sum(axis=1)).sum()),
        "world_frames_per_s": world_rate,
        **solves,
        "ruckig_us_per_call": 1e6 * ruckig_seconds,
        "shipped_weights": float(streaming_recogniser(data)[1]),
    }
    write_text(out, [json.dumps(figures, indent=1), "\n"])
    return figures


class FormRatios(NamedTuple):
    """What the published form costs over what the streaming form costs."""

    flops_ratio: float
    time_ratio: float


def compare_forms(data: MotionData, size: Size, episodes: int, length: int) -> FormRatios:
    """Run both forms, untrained, over the same episodes: frame by frame in turn, so that both meet the same machine."""
    forms = [_untrained(data, "ctrgcn", size, length), _untrained(data, "causal", size, length)]
    positions, viewpoint, noise = _episodes(data, episodes, length)
    sensor = PerfectSensor()
    states: list[Any] = [form.start(episodes) for form in forms]
    single: list[Any] = [form.start(1) for form in forms]  # the ratio of operations is that of one episode
    flops, seconds = np.zeros(2), np.zeros(2)
    for frame in range(length):
        sensed = sensor.sense(positions[:, frame], viewpoint, noise.frame(frame))
        first = Sensed(sensed.joints_2d[:1], sensed.confidence[:1])
        for i, form in enumerate(forms):
            step = partial(form.step, single[i], first, viewpoint[:1])
            flops[i] += count_flops(step)
            _, single[i] = step()
            begin = time.perf_counter()
            _, states[i] = form.step(states[i], sensed, viewpoint)
            seconds[i] += time.perf_counter() - begin
    return FormRatios(float(flops[0] / flops[1]), float(seconds[0] / seconds[1]))


def time_recogniser(data: MotionData, effort: Effort) -> FloatArray:
    """Return the seconds that sensing and recognising each frame of an episode take, (L,), medians over repeats."""
    recogniser, _ = streaming_recogniser(data)
    sensor = PerfectSensor()
    positions, viewpoint, noise = _episodes(data, effort.episodes, effort.length)
    seconds = np.empty((effort.repeats + 1, effort.length))
    for repeat in range(len(seconds)):
        state = recogniser.start(effort.episodes)
        for frame in range(effort.length):
            begin = time.perf_counter()
            sensed = sensor.sense(positions[:, frame], viewpoint, noise.frame(frame))
            _, state = recogniser.step(state, sensed, viewpoint)
            seconds[repeat, frame] = time.perf_counter() - begin
    return np.median(seconds[1:], axis=0)  # the first warms up


def time_world(data: MotionData, effort: Effort) -> float:
    """Return the seconds that moving and sensing take for one frame of all cameras, the median over an episode."""
    positions, viewpoint, noise = _episodes(data, effort.cameras, effort.length)
    sensor, motion = PerfectSensor(), GridMotion()
    motion.reset(viewpoint, 1 / data.fps)
    target = viewpoint[::-1]
    seconds = np.empty(effort.length)
    for frame in range(effort.length):
        begin = time.perf_counter()
        viewpoint = motion.advance(target)
        sensor.sense(positions[:, frame], viewpoint, noise.frame(frame))
        seconds[frame] = time.perf_counter() - begin
    return float(np.median(seconds))


def time_solves(data: MotionData, effort: Effort) -> dict[str, float]:
    """Return how long solves take on the grid and in flight together, and the share of plans that fell back."""
    grid_node = math.ceil((effort.length - 1) / DEFAULT_HORIZON) / data.fps
    seconds, plans, fallbacks = [], 0, 0
    for vehicle, node_time in ((None, grid_node), (VEHICLE, FLIGHT_PLAN_TIME / DEFAULT_HORIZON)):
        rng = np.random.default_rng(0)
        context = Context(
            episodes=1,
            length=effort.length,
            frame_time=1 / data.fps,
            class_names=data.class_names,
            skeleton=data.skeleton,
            workspace=Workspace(),
            track="ideal" if vehicle is None else vehicle.name,
            rng=rng,
            vehicle=vehicle,
        )
        limits = camera_limits(context, sample_starts(rng, 1)[0], node_time)
        in_a_row = min(15, effort.plans)
        statistics = measure_solves(
            rng,
            TrajectorySolver(horizon=DEFAULT_HORIZON),
            limits,
            node_time=node_time,
            episodes=effort.plans // in_a_row,
            plans=in_a_row,
        )
        seconds += statistics.solve_seconds
        plans, fallbacks = plans + statistics.counts.total(), fallbacks + statistics.fallbacks
    return {
        "nbv_solve_ms_median": 1000 * float(np.median(seconds)),
        "nbv_solve_ms_p95": 1000 * float(np.percentile(seconds, 95)),
        "nbv_fallback_share": fallbacks / plans,
    }


def time_ruckig(effort: Effort) -> float:
    """Return the seconds of one of Ruckig's calculations, between states and limits as flights meet them; median."""
    rng, flights = np.random.default_rng(0), effort.flights
    viewpoint, target = sample_starts(rng, flights), sample_starts(rng, flights)
    per_axis = PACE * np.stack([np.ones(flights), 1 / viewpoint[:, 0], 1 / viewpoint[:, 0]], axis=1)
    velocity, acceleration = per_axis * rng.uniform(-1, 1, (2, flights, 3))
    state = SphericalState(
        viewpoint, VEHICLE.speed * velocity, VEHICLE.acceleration * acceleration, np.zeros((flights, 3))
    )
    limits = limits_to_target(VEHICLE, state, target - viewpoint).select(0)
    optimal, seconds = TimeOptimal(), np.empty(effort.repeats)
    for repeat in range(effort.repeats):
        begin = time.perf_counter()
        optimal.durations(state, target, limits)
        seconds[repeat] = time.perf_counter() - begin
    return float(np.median(seconds) / flights)


def streaming_recogniser(data: MotionData) -> tuple[Recogniser, bool]:
    """Return the recogniser that ships for the data and True, or an untrained one of its architecture and False."""
    try:
        return load_recogniser(None, data, sensor="perfect", views="moving"), True
    except ModelError:
        return _untrained(data, "causal", "small", Effort.length), False


def bench_table(figures: dict[str, float]) -> Table:
    """Return the figures beside what they are to reach."""
    rows = []
    for name, figure in figures.items():
        target = TARGETS.get(name)
        goal = f"{'<=' if target.at_most else '>='} {target.bound:,g}" if target else ""
        rows.append((name, f"{figure:,.4g}" if figure < 1000 else f"{figure:,.0f}", goal, _verdict(target, figure)))
    return Table(
        title=f"Speed on {DATA}: episodes of {Effort.length} frames, {WORKERS} processes of one thread",
        header=("figure", "measured", "target", "met"),
        rows=tuple(rows),
        footnotes=() if figures["shipped_weights"] else ("The recogniser is untrained: no weights ship yet.",),
    )


def _verdict(target: Target | None, figure: float) -> str:
    if target is None:
        return ""
    return "yes" if target.met(figure) else "no"


def frame_ratios(seconds: FloatArray) -> dict[str, float]:
    """Return how the seconds of frames (L,) compare; the first frame, which nothing precedes, stands apart."""
    refresh = np.array([refreshes(count) for count in range(1, len(seconds) + 1)])
    plain, refreshing = seconds[1:][~refresh[1:]], seconds[1:][refresh[1:]]
    return {
        "late_over_early_frame": float(seconds[-1] / seconds[EARLY - 1]),
        "refresh_over_plain_frame": float(refreshing.mean() / np.median(plain)),
    }


def _untrained(data: MotionData, form: Form, size: Size, length: int) -> StreamingRecogniser | PrefixRecogniser:
    spec = NetworkSpec.of(data, form=form, size=size, length=length)
    network = spec.build()
    if isinstance(network, CausalCTRGCN):
        return StreamingRecogniser(network=network, spec=spec, temperature=Temperature(), sha256="untrained")
    return PrefixRecogniser(network=network, spec=spec, temperature=Temperature(), sha256="untrained")


def _episodes(data: MotionData, episodes: int, length: int) -> tuple[FloatArray, FloatArray, SensorNoise]:
    """Return joints (B, L, P, J, 3) of the data's windows, repeated as needed, start viewpoints (B, 3) and noise."""
    rng = np.random.default_rng(0)
    scenarios = windows(data, np.arange(len(data.labels)), length, length)
    positions = scenarios.positions(np.arange(episodes) % len(scenarios))
    persons, joints = positions.shape[2:4]
    return positions, sample_starts(rng, episodes), draw_noise(rng, (episodes, length), persons, joints)
