"""The speed of sensing, recognition and training on a GPU, and how far its probabilities differ from the CPU's."""

import time

import numpy as np

from ehar.data.motion_data import MotionData
from ehar.sensors.registry import load_sensor
from ehar.sensors.sensor import Sensor
from ehar.world import PAPER
from eval.speed.effort import Effort
from eval.speed.recognition import first_frames, streaming_recogniser, time_frames, time_training, untrained
from recognition.networks.sizes import Size

SIZES: tuple[Size, ...] = ("small", "published")


def device_figures(data: MotionData, device: str, effort: Effort) -> dict[str, float]:
    """Return what a device decides; the keys are explained in `eval.speed.bench.bench`.

    Args:
        data: what is recognised.
        device: torch device.
        effort: how much to measure.
    """
    here, there = _estimator(data, None), _estimator(data, device)
    figures = {
        "device_probability_difference": _difference(data, device, effort),
        "device_sensor_speedup": _sensing_time(data, here, effort) / _sensing_time(data, there, effort),
    }
    for size in SIZES:
        ending = "" if size == "small" else f"_{size}_widths"
        recogniser = untrained(data, "causal", size, effort.length, device=device)
        sensing, recognising = time_frames(recogniser, data, effort.batch, effort, there).sum(axis=0)
        frames = effort.batch * effort.length
        figures[f"device_recognised_frames_per_s{ending}"] = frames / float(recognising)
        figures[f"device_sensed_and_recognised_frames_per_s{ending}"] = frames / float(sensing + recognising)
        figures[f"device_training_clips_per_s{ending}"] = time_training(data, effort, device=device, size=size)
    return figures


def _estimator(data: MotionData, device: str | None) -> Sensor:
    """Return the estimator sensor on a device; None means NumPy."""
    return load_sensor("estimator", data, PAPER, device=device).sensor


def _sensing_time(data: MotionData, sensor: Sensor, effort: Effort) -> float:
    """Return the seconds that a sensor takes for a frame of `Effort.batch` episodes, the median over an episode."""
    seconds, begin = [], time.perf_counter()
    for _ in first_frames(data, effort.batch, effort.length, sensor):
        seconds.append(time.perf_counter() - begin)
        begin = time.perf_counter()
    return float(np.median(seconds[1:]))  # the first frame warms up


def _difference(data: MotionData, device: str, effort: Effort) -> float:
    """Return how far probabilities differ at most from those on the CPU, over episodes that either senses itself."""
    here, there = (streaming_recogniser(data, each)[0] for each in ("cpu", device))
    states = [recogniser.start(effort.episodes) for recogniser in (here, there)]
    greatest = 0.0
    both = (first_frames(data, effort.episodes, effort.length, _estimator(data, each)) for each in (None, device))
    for frames in zip(*both, strict=True):
        (one, states[0]), (other, states[1]) = (
            recogniser.step(state, sensed, viewpoint)
            for recogniser, state, (sensed, viewpoint) in zip((here, there), states, frames, strict=True)
        )
        greatest = max(greatest, float(np.abs(np.exp(one.log_probs) - np.exp(other.log_probs)).max()))
    return greatest
