"""The speed of recognition and training on a GPU, and how far its probabilities differ from those of the CPU."""

import numpy as np

from ehar.data.motion_data import MotionData
from ehar.sensors.perfect import PerfectSensor
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
    figures = {"device_probability_difference": _difference(data, device, effort)}
    for size in SIZES:
        ending = "" if size == "small" else f"_{size}_widths"
        recogniser = untrained(data, "causal", size, effort.length, device=device)
        sensing, recognising = time_frames(recogniser, data, effort.batch, effort).sum(axis=0)
        frames = effort.batch * effort.length
        figures[f"device_recognised_frames_per_s{ending}"] = frames / float(recognising)
        figures[f"device_sensed_and_recognised_frames_per_s{ending}"] = frames / float(sensing + recognising)
        figures[f"device_training_clips_per_s{ending}"] = time_training(data, effort, device=device, size=size)
    return figures


def _difference(data: MotionData, device: str, effort: Effort) -> float:
    """Return how far the streaming recogniser's probabilities differ at most from those on the CPU, over episodes."""
    here, there = (streaming_recogniser(data, each)[0] for each in ("cpu", device))
    states = [recogniser.start(effort.episodes) for recogniser in (here, there)]
    greatest = 0.0
    for sensed, viewpoint in first_frames(data, effort.episodes, effort.length, PerfectSensor()):
        (one, states[0]), (other, states[1]) = (
            recogniser.step(state, sensed, viewpoint) for recogniser, state in zip((here, there), states, strict=True)
        )
        greatest = max(greatest, float(np.abs(np.exp(one.log_probs) - np.exp(other.log_probs)).max()))
    return greatest
