"""The machine's peak, as products of large matrices reach it, and what a recognised frame takes of it."""

import time
from functools import partial

import numpy as np
import torch

from ehar.data.motion_data import MotionData
from ehar.sensors.perfect import PerfectSensor
from eval.speed.effort import Effort
from eval.speed.flops import count_flops
from eval.speed.recognition import first_frames, streaming_recogniser
from recognition.training.arithmetic import has_bfloat16


def peak_figures(effort: Effort, threads: int) -> dict[str, float]:
    """Return the billions of operations a second of large products, with one thread and with several.

    Args:
        effort: the size of the matrices.
        threads: the larger number of threads.
    """
    types = {"float32": torch.float32}
    if has_bfloat16(torch.device("cpu")):
        types["bfloat16"] = torch.bfloat16
    before = torch.get_num_threads()
    figures = {}
    try:
        for name, kind in types.items():
            for count, words in ((1, "one_thread"), (threads, "all_threads")):
                torch.set_num_threads(count)
                figures[f"peak_gflops_{name}_{words}"] = _gflops(effort, kind)
    finally:
        torch.set_num_threads(before)
    return figures


def _gflops(effort: Effort, kind: torch.dtype) -> float:
    """Return the billions of operations a second of a square product; the fastest of the repeats is the peak."""
    matrix = torch.ones(effort.matrix, effort.matrix, dtype=kind)
    seconds = np.empty(effort.repeats + 1)
    for repeat in range(len(seconds)):
        begin = time.perf_counter()
        torch.mm(matrix, matrix)
        seconds[repeat] = time.perf_counter() - begin
    return float(2e-9 * effort.matrix**3 / seconds[1:].min())  # the first warms up


def frame_gflop(data: MotionData, effort: Effort) -> float:
    """Return the billions of operations of a recognised frame, as a mean over an episode."""
    recogniser, _ = streaming_recogniser(data)
    state, flops = recogniser.start(1), 0
    for sensed, viewpoint in first_frames(data, 1, effort.length, PerfectSensor()):
        step = partial(recogniser.step, state, sensed, viewpoint)
        flops += count_flops(step)
        _, state = step()
    return 1e-9 * flops / effort.length
