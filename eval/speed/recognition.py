"""The speed of recognition and the world: both forms of the network, the streaming recogniser, cameras alone."""

import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from ehar.arrays import FloatArray
from ehar.conditions import Conditions, Form
from ehar.data.motion_data import MotionData
from ehar.data.recordings import Recordings
from ehar.data.scenario import windows
from ehar.errors import ModelError
from ehar.motion import GridMotion
from ehar.recogniser import Recogniser
from ehar.sensors.perfect import PerfectSensor
from ehar.sensors.sensor import Sensed, Sensor, SensorNoise, draw_noise
from ehar.world import PAPER
from eval.speed.effort import WORKERS, Effort
from eval.speed.flops import count_flops
from recognition.calibration import Temperature
from recognition.networks.causal import CausalCTRGCN
from recognition.networks.layers import refreshes
from recognition.networks.sizes import Size
from recognition.networks.spec import NetworkSpec
from recognition.storage import load_recogniser
from recognition.streaming import PrefixRecogniser, StreamingRecogniser
from recognition.training.config import TrainingConfig
from recognition.training.trainer import train_recogniser

EARLY = 5  # the frame, counted from 1, that the last one is compared with


class FormRatios(NamedTuple):
    """The cost of the published form divided by the cost of the streaming form."""

    flops_ratio: float
    time_ratio: float


def compare_forms(data: MotionData, size: Size, episodes: int, length: int) -> FormRatios:
    """Run both forms, untrained, over the same episodes: frame by frame in turn, for a fair comparison."""
    forms = [untrained(data, "ctrgcn", size, length), untrained(data, "causal", size, length)]
    positions, viewpoint, noise = _episodes(data, episodes, length)
    sensor = PerfectSensor()
    states: list[Any] = [form.start(episodes) for form in forms]
    single: list[Any] = [form.start(1) for form in forms]  # operations are counted for one episode
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
    recogniser = streaming_recogniser(data)[0]
    return np.asarray(time_frames(recogniser, data, effort.episodes, effort, PerfectSensor()).sum(axis=1))


def time_frames(recogniser: Recogniser, data: MotionData, episodes: int, effort: Effort, sensor: Sensor) -> FloatArray:
    """Return the seconds that sensing, and then recognising, each frame takes, (L, 2), medians over repeats."""
    positions, viewpoint, noise = _episodes(data, episodes, effort.length)
    seconds = np.empty((effort.repeats + 1, effort.length, 2))
    for repeat in range(len(seconds)):
        state = recogniser.start(episodes)
        for frame in range(effort.length):
            begin = time.perf_counter()
            sensed = sensor.sense(positions[:, frame], viewpoint, noise.frame(frame))
            seen = time.perf_counter()
            _, state = recogniser.step(state, sensed, viewpoint)  # what it returns lies in the CPU's memory
            seconds[repeat, frame] = seen - begin, time.perf_counter() - seen
    return np.asarray(np.median(seconds[1:], axis=0))  # the first warms up


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


def streaming_recogniser(data: MotionData, device: str = "cpu") -> tuple[Recogniser, bool]:
    """Return the recogniser that ships for the data and True, or an untrained one of its architecture and False."""
    try:
        return load_recogniser(Conditions(), data, device=device), True
    except ModelError:
        return untrained(data, "causal", "small", Effort.length, device=device), False


def time_training(data: MotionData, effort: Effort, *, device: str = "cpu", size: Size = "small") -> float:
    """Return how many clips a second a recogniser's training takes in, as `WORKERS` threads of this process."""
    times: list[float] = []
    with TemporaryDirectory() as folder:
        conditions = Conditions(data=data, sensor="estimator", length=effort.length)
        config = TrainingConfig(
            conditions=conditions, out=Path(folder), size=size, clips=effort.clips, device=device, threads=WORKERS
        )
        train_recogniser(config, lambda clips, expected, evaluations: times.append(time.perf_counter()))
    steps = np.diff(times[:-1])  # the last step is followed by an evaluation
    return config.batch / float(np.median(steps))


def frame_ratios(seconds: FloatArray) -> dict[str, float]:
    """Return ratios of the seconds of frames (L,), without the first frame, which has no predecessor."""
    refresh = np.array([refreshes(count) for count in range(1, len(seconds) + 1)])
    plain, refreshing = seconds[1:][~refresh[1:]], seconds[1:][refresh[1:]]
    return {
        "late_over_early_frame": float(seconds[-1] / seconds[EARLY - 1]),
        "refresh_over_plain_frame": float(refreshing.mean() / np.median(plain)),
    }


def first_frames(data: MotionData, episodes: int, length: int, sensor: Sensor) -> Iterator[tuple[Sensed, FloatArray]]:
    """Yield what cameras that stay sense in each frame of B episodes, and their viewpoints (B, 3)."""
    positions, viewpoint, noise = _episodes(data, episodes, length)
    for frame in range(length):
        yield sensor.sense(positions[:, frame], viewpoint, noise.frame(frame)), viewpoint


def untrained(
    data: Recordings, form: Form, size: Size, length: int, *, device: str = "cpu"
) -> StreamingRecogniser | PrefixRecogniser:
    """Return a recogniser with random weights: as fast as a trained one."""
    spec = NetworkSpec.of(data, form=form, size=size, length=length)
    network = spec.build()
    if isinstance(network, CausalCTRGCN):
        return StreamingRecogniser(
            network=network, spec=spec, temperature=Temperature(), sha256="untrained", device=device
        )
    return PrefixRecogniser(network=network, spec=spec, temperature=Temperature(), sha256="untrained", device=device)


def _episodes(data: MotionData, episodes: int, length: int) -> tuple[FloatArray, FloatArray, SensorNoise]:
    """Return joints (B, L, P, J, 3) of the data's windows, repeated as needed, start viewpoints (B, 3) and noise."""
    rng = np.random.default_rng(0)
    scenarios = windows(data, np.arange(len(data.labels)), length, length)
    positions = scenarios.positions(np.arange(episodes) % len(scenarios))
    persons, joints = positions.shape[2:4]
    return positions, PAPER.sample_starts(rng, episodes), draw_noise(rng, (episodes, length), persons, joints)
