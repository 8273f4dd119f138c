"""Explains one episode: runs it as the benchmark does, and keeps what explains it."""

from pathlib import Path

import numpy as np

from ehar.arrays import IntArray
from ehar.data.motion_data import MotionData
from ehar.data.scenario import split_parts
from ehar.errors import UsageError
from ehar.motion import GridMotion
from ehar.planner import Context
from ehar.rollout import Record, rollout
from eval.running.benchmark import check_options, load_setting
from eval.running.episodes import CHUNK, cut_scenarios, random_starts
from eval.running.picked_episodes import pick_episodes
from eval.running.progress import ConsoleReporter, Reporter
from eval.running.recorder import Recorder
from eval.studies.explanation import Explanation
from planners.registry import VALUING, make_planner, needs_gain_model
from planners.value.model import GainModel, load_gain_model
from planners.value.view_value import ViewValue

FIRST_MOMENT, LAST_MOMENT = 0.1, 0.9  # of the episode


def explain(
    *,
    data: str | Path | MotionData = "duo",
    models: Path | None = None,
    sensor: str = "perfect",
    views: str = "moving",
    planner: str = "nbv",
    episode: int = 0,
    frames: int = 4,
    seed: int = 0,
    length: int = 60,
    fps: float | None = None,
    reporter: Reporter | None = None,
) -> Explanation:
    """Run one of the benchmark's episodes on the ideal track, and keep what explains it.

    Args:
        data: `duo`, `solo`, the path of a prepared .npz, or data in memory.
        models: folder of recogniser and gain field; None takes those that ship with ehar.
        sensor: `perfect` or `estimator`.
        views: the cameras that the recogniser was trained on, `moving` or `paper`.
        planner: one that values views.
        episode: which of the test scenarios, counted from 0; its start viewpoint is the benchmark's first.
        frames: how many moments to show, from 10 to 90 % of the episode.
        seed: of the start viewpoint and the sensor's noise.
        length: L, frames in an episode.
        fps: frame rate to resample to [1/s]; None keeps the data's.
        reporter: hears of what is left out; None prints it on standard error.

    Raises:
        EharError: one line that says what was got and what was expected.
    """
    check_options(seed=seed, workers=1)
    if not needs_gain_model(planner):
        raise UsageError(f"unknown planner {planner!r}; expected one that values views: {', '.join(VALUING)}")
    if length < 2 or not 1 <= frames <= length - 1:
        raise UsageError(f"frames: expected 1 to {length - 1} moments of episodes of {length} frames, got {frames}")
    setting = load_setting(data=data, models=models, sensor=sensor, views=views, form="causal", fps=fps)
    model = load_gain_model(
        None if models is None else Path(models),
        setting.data,
        sensor=sensor,
        views=views,
        recogniser_sha256=setting.recogniser_sha256,
    )
    note = (reporter or ConsoleReporter()).note
    episodes = random_starts(cut_scenarios(setting.data, split_parts(setting.data).test, length, note), 1, seed)
    if not 0 <= episode < len(episodes):
        raise UsageError(f"episode: expected 0 to {len(episodes) - 1}, got {episode}")
    batch = pick_episodes(episodes, [episode])
    motion = GridMotion()
    context = Context(
        episodes=1,
        length=length,
        frame_time=1 / setting.data.fps,
        class_names=setting.data.class_names,
        skeleton=setting.data.skeleton,
        workspace=motion.workspace,
        track="ideal",
        rng=episodes.planner_rng(planner, episode // CHUNK),
    )
    recorder = Recorder(make_planner(planner, lambda: model))
    record = rollout(recorder, batch, setting.recogniser, setting.sensor, motion, context)
    return _explanation(
        recorder,
        record,
        model,
        context,
        title=f"{setting.data.title}, {sensor} sensor, {views} views",
        sequence=batch.names[0],
        label=int(batch.labels[0]),
        moments=moments(length, frames),
    )


def moments(length: int, count: int) -> IntArray:
    """Return the frames to show: from 10 to 90 % of an episode of L frames, the last one left out, each once."""
    shares = np.linspace(FIRST_MOMENT, LAST_MOMENT, count)
    return np.unique(np.clip(np.rint(shares * length).astype(np.int64) - 1, 0, length - 2))


def _explanation(
    recorder: Recorder,
    record: Record,
    model: GainModel,
    context: Context,
    *,
    title: str,
    sequence: str,
    label: int,
    moments: IntArray,
) -> Explanation:
    """Return what a recorder kept of its only episode, with what views were worth in it."""
    value = ViewValue(model)
    value.reset(context)
    believed, weights, facing, facing_std = [], [], [], []
    for observation in recorder.observations:
        value.update(observation)
        believed.append(value.situation.belief[0])
        weights.append(value.weights[0])
        facing.append(value.situation.facing[0].copy())
        facing_std.append(value.situation.facing_std[0].copy())
    return Explanation(
        title=title,
        planner=recorder.name,
        sequence=sequence,
        class_names=context.class_names,
        label=label,
        viewpoints=record.viewpoints[0],
        recognised=np.exp(record.log_probs[0].astype(np.float64)),
        targets=np.array(recorder.targets)[:, 0],
        believed=np.array(believed),
        weights=np.array(weights),
        facing=np.array(facing),
        facing_std=np.array(facing_std),
        moments=moments,
        workspace=context.workspace,
    )
