"""The speed of recognition, the world and planning: ratios that hold on any machine, and times on this one.

Every measurement runs in separate processes with one torch thread each, like the benchmark's workers.
"""

import json
import multiprocessing
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from ehar.data.any_source import load_recordings
from ehar.data.source import load_data
from ehar.data.streams.data import StreamData
from ehar.files import check_folder, write_text
from ehar.world import PAPER, ROOM
from eval.render.tables import Table
from eval.speed.effort import DATA, WORKERS, Effort
from eval.speed.on_device import device_figures
from eval.speed.peak import frame_gflop, peak_figures
from eval.speed.planning import time_ppo, time_ruckig, time_solves
from eval.speed.recognition import (
    compare_forms,
    frame_ratios,
    streaming_recogniser,
    time_recogniser,
    time_training,
    time_world,
)
from eval.speed.report import time_report
from eval.speed.streams import STREAMS, late_over_early, letting_go, time_flown_streams, time_plans, time_streams
from recognition.devices import check_device


class Target(NamedTuple):
    """The bound that a figure should reach."""

    bound: float
    at_most: bool = False

    def met(self, figure: float) -> bool:
        """Return whether the figure reaches the target."""
        return figure <= self.bound if self.at_most else figure >= self.bound


TARGETS = {
    "flops_ratio": Target(20.0),
    "time_ratio": Target(10.0),
    "late_over_early_frame": Target(1.05, at_most=True),
    "recognised_frames_per_s": Target(12_000.0),
    "world_frames_per_s": Target(500_000.0),
    "nbv_solve_ms_median": Target(3.0, at_most=True),
    "nbv_solve_ms_p95": Target(10.0, at_most=True),
    "nbv_fallback_share": Target(0.01, at_most=True),
    "nbv_room_solve_ms_p95": Target(10.0, at_most=True),
    "nbv_room_fallback_share": Target(0.005, at_most=True),
    "nbv_plan_ms_p95": Target(10.0, at_most=True),
    "nbv_room_plan_ms_p95": Target(10.0, at_most=True),
    "nbv_crowd_plan_ms_p95": Target(10.0, at_most=True),
    "ruckig_us_per_call": Target(5.0, at_most=True),
    "ppo_frames_per_s": Target(5000.0),
    "streams_times_real_time": Target(50.0),
    "flown_streams_times_real_time": Target(20.0),
    "flown_room_streams_times_real_time": Target(20.0),
    "stream_late_over_early_frame": Target(1.05, at_most=True),
    "letting_go_later_s": Target(0.3, at_most=True),
    "report_interactive_s": Target(3.0, at_most=True),
    "device_recognised_frames_per_s": Target(1_000_000.0),
    "device_probability_difference": Target(1e-4, at_most=True),
}


def bench(
    out: str | Path,
    effort: Effort | None = None,
    report: str | Path | None = None,
    models: str | Path | None = None,
    device: str = "cpu",
) -> dict[str, float]:
    """Measure everything, or what a GPU decides, and write it to `out` as JSON.

    Args:
        out: the file.
        effort: how much to measure.
        report: a report.html to open as well.
        models: folder of a recogniser of solo-stream, to see how soon it lets go; None takes the one that ships.
        device: cuda measures on a GPU what it decides: the keys that begin with `device_`.

    Returns:
        flops_ratio, time_ratio: the cost of the published form over an episode, evaluated on every prefix, divided by
            the cost of the streaming form, at the small widths. Keys that end in `_published_widths` are for the
            published widths, where the published form also strides over time.
        late_over_early_frame: the streaming recogniser's time for the last frame divided by that for the 5th.
        refresh_over_plain_frame: its time for a frame that refreshes the topologies divided by that for another frame.
        recognised_frames_per_s: frames of `WORKERS` processes together, from sensing to calibrated probabilities.
        recognised_share_of_peak: the operations of these frames, as a share of what `WORKERS` threads reach in a
            product of large float32 matrices.
        peak_gflops_float32_one_thread, peak_gflops_float32_all_threads: billions of operations a second of that
            product, with one thread and with `WORKERS`; likewise `peak_gflops_bfloat16_...`, where the processor has
            such products.
        training_clips_per_s: clips that the training of a recogniser takes in, with `WORKERS` threads.
        world_frames_per_s: frames of `WORKERS` processes together that only move cameras and sense.
        nbv_solve_ms_median, nbv_solve_ms_p95: one solve at the default horizon, over plans on the grid and plans of a
            PX4 in mission mode.
        nbv_fallback_share: the share of those plans that the chosen solver did not find itself.
        nbv_compiled: 1 if all of them ran on machine code, 0 if formulas were interpreted, as without a C compiler.
        nbv_room_solve_ms_median, nbv_room_solve_ms_p95, nbv_room_fallback_share, nbv_room_compiled: the same around a
            person in the room.
        nbv_plan_ms_median, nbv_plan_ms_p95: all that nbv does in a frame in which it plans, flown around one person;
            `nbv_room_plan_...` and `nbv_crowd_plan_...` likewise in these worlds. A plan is one solve or several.
        ruckig_us_per_call: one flight of that vehicle on three axes.
        ppo_frames_per_s: environment frames of PPO's training, with the recogniser in the loop and 64 environments.
        streams_times_real_time: seconds that 32 streams of one person have together, for each second that a benchmark
            of them takes with `WORKERS` processes, on the ideal track with the estimator.
        flown_streams_times_real_time, flown_room_streams_times_real_time: the same with nbv, flown by that vehicle, and
            planning anew every 10 frames; in the open, and in the room.
        stream_late_over_early_frame: the streaming recogniser's time for frame 18,000 of a stream divided by that for
            frame 60.
        recognised_s_after_30_frames, recognised_s_after_300_frames: how long after its onset an activity is recognised
            behind so many frames of another [s].
        letting_go_later_s: the second of these minus the first.
        report_interactive_s: from opening the report until its table is sorted and its replay has moved; only with a
            report.
        shipped_weights: 1 if the streaming recogniser is the one that ships, 0 if it is untrained.
        device_recognised_frames_per_s: frames that the streaming recogniser takes in on the device, `Effort.batch`
            episodes at once, from what a sensor gave to calibrated probabilities, both in the CPU's memory.
        device_sensed_and_recognised_frames_per_s: likewise with the estimator sensor, on the device too.
        device_training_clips_per_s: clips that the training of a recogniser takes in; the CPU draws them.
        device_probability_difference: how far its probabilities differ at most from those on the CPU; each
            has an estimator sensor of its own.
        device_sensor_speedup: how many times as many frames of `Effort.batch` episodes that sensor takes on the device
            as on one thread of the CPU.

    Raises:
        UsageError: there is no such device, `out` cannot be written, or there is no report, or no browser for it.
        ModelError: there are no weights of solo-stream.
    """
    effort = effort or Effort()
    check_device(device)
    check_folder(Path(out).parent)
    if device != "cpu":
        return _written(out, device_figures(load_data(DATA), device, effort))
    opened = {} if report is None else {"report_interactive_s": time_report(Path(report))}  # first: it may be missing
    let_go = letting_go(models, effort)
    data, streams = load_data(DATA), load_recordings(STREAMS)
    assert isinstance(streams, StreamData)
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(WORKERS, mp_context=context, initializer=torch.set_num_threads, initargs=(1,)) as pool:
        small = pool.submit(compare_forms, data, "small", effort.small_episodes, effort.length).result()
        wide = pool.submit(compare_forms, data, "published", effort.published_episodes, effort.length).result()
        recognised = [pool.submit(time_recogniser, data, effort) for _ in range(WORKERS)]
        frame_seconds = np.stack([future.result() for future in recognised])
        moved = [pool.submit(time_world, data, effort) for _ in range(WORKERS)]
        world_rate = sum(effort.cameras / future.result() for future in moved)
        watched = [pool.submit(time_streams, streams, effort) for _ in range(WORKERS)]
        real_time = sum(future.result() for future in watched)
        flown_real_time = []
        for world in (PAPER, ROOM):
            flown = [pool.submit(time_flown_streams, effort, world) for _ in range(WORKERS)]
            flown_real_time.append(sum(future.result() for future in flown))
        late = pool.submit(late_over_early, streams, effort).result()
        trained = pool.submit(time_training, data, effort).result()
        gflop = pool.submit(frame_gflop, data, effort).result()
        peaks = pool.submit(peak_figures, effort, WORKERS).result()
        solves = pool.submit(time_solves, data, effort).result()
        plans = pool.submit(time_plans, effort).result()
        ruckig_seconds = pool.submit(time_ruckig, effort).result()
    frames_per_s = float((effort.episodes * effort.length / frame_seconds.sum(axis=1)).sum())
    figures = {
        **small._asdict(),
        **{f"{name}_published_widths": ratio for name, ratio in wide._asdict().items()},
        **frame_ratios(frame_seconds.mean(axis=0)),
        "recognised_frames_per_s": frames_per_s,
        "recognised_share_of_peak": frames_per_s * gflop / peaks["peak_gflops_float32_all_threads"],
        **peaks,
        "training_clips_per_s": trained,
        "world_frames_per_s": world_rate,
        **solves,
        **plans,
        "ruckig_us_per_call": 1e6 * ruckig_seconds,
        "ppo_frames_per_s": time_ppo(data, effort),
        "streams_times_real_time": real_time,
        "flown_streams_times_real_time": flown_real_time[0],
        "flown_room_streams_times_real_time": flown_real_time[1],
        "stream_late_over_early_frame": late,
        **let_go,
        **opened,
        "shipped_weights": float(streaming_recogniser(data)[1]),
    }
    return _written(out, figures)


def _written(out: str | Path, figures: dict[str, float]) -> dict[str, float]:
    """Write figures as JSON, and return them."""
    write_text(Path(out), [json.dumps(figures, indent=1), "\n"])
    return figures


def bench_table(figures: dict[str, float]) -> Table:
    """Return the figures beside their targets."""
    rows = []
    for name, figure in figures.items():
        target = TARGETS.get(name)
        goal = f"{'<=' if target.at_most else '>='} {target.bound:,g}" if target else ""
        rows.append((name, f"{figure:,.4g}" if figure < 1000 else f"{figure:,.0f}", goal, _verdict(target, figure)))
    on_device = any(name.startswith("device_") for name in figures)
    how = f"{Effort.batch:,} at once on a GPU" if on_device else f"{WORKERS} processes of one thread"
    return Table(
        title=f"Speed on {DATA}: episodes of {Effort.length} frames, {how}",
        header=("figure", "measured", "target", "met"),
        rows=tuple(rows),
        footnotes=tuple(_footnotes(figures)),
    )


def _footnotes(figures: dict[str, float]) -> Iterator[str]:
    if not figures.get("shipped_weights", 1.0):
        yield "The recogniser is untrained: no weights ship yet."


def _verdict(target: Target | None, figure: float) -> str:
    if target is None:
        return ""
    return "yes" if target.met(figure) else "no"
