"""Explains one episode: runs it as the benchmark does, and keeps what explains it."""

from pathlib import Path

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.data.motion_data import MotionData
from ehar.data.scenario import split_parts
from ehar.errors import UsageError
from ehar.motion import GridMotion
from ehar.planner import Context, Observation, Planner
from ehar.rollout import Batch, Record, rollout
from ehar.sensors.sensor import SensorNoise
from eval.running.benchmark import check_options, load_setting
from eval.running.episodes import CHUNK, Episodes, cut_scenarios, random_starts
from eval.running.progress import ConsoleReporter, Reporter
from eval.studies.explanation import Explanation
from planners.registry import VALUING, make_planner, needs_gain_model
from planners.value.model import GainModel, load_gain_model
from planners.value.view_value import ViewValue

FIRST_MOMENT, LAST_MOMENT = 0.1, 0.9  # of the episode


class Recorder(Planner):
    """Asks a planner, and keeps what it saw and said in an episode, with what views were worth.

    Args:
        planner: to ask.
        model: the gain model that it was made with.
    """

    privileged = False

    def __init__(self, planner: Planner, model: GainModel) -> None:
        """Create the recorder."""
        self.name = planner.name
        self._planner = planner
        self._value = ViewValue(model)

    def reset(self, context: Context) -> None:
        """Forget what was kept."""
        self._planner.reset(context)
        self._value.reset(context)
        self.targets: list[FloatArray] = []
        self.believed: list[FloatArray] = []
        self.weights: list[FloatArray] = []
        self.facing: list[FloatArray] = []
        self.facing_std: list[FloatArray] = []

    def act(self, observation: Observation) -> FloatArray:
        """Return the planner's targets."""
        target = self._planner.act(observation)
        self._value.update(observation)
        situation = self._value.situation
        self.targets.append(target[0])
        self.believed.append(situation.belief[0])
        self.weights.append(self._value.weights[0])
        self.facing.append(situation.facing[0].copy())
        self.facing_std.append(situation.facing_std[0].copy())
        return target


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
    batch = single_episode(episodes, episode)
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
    recorder = Recorder(make_planner(planner, lambda: model), model)
    record = rollout(recorder, batch, setting.recogniser, setting.sensor, motion, context)
    return _explanation(
        recorder,
        record,
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


def single_episode(episodes: Episodes, index: int) -> Batch:
    """Return one episode alone, with the start viewpoint and the noise that it has in the benchmark."""
    batch, place = episodes.batch(index // CHUNK), index % CHUNK
    only = slice(place, place + 1)
    return Batch(
        positions=batch.positions[only],
        labels=batch.labels[only],
        starts=batch.starts[only],
        noise=SensorNoise(*(draws[only] for draws in batch.noise)),
        names=batch.names[only],
    )


def _explanation(
    recorder: Recorder,
    record: Record,
    context: Context,
    *,
    title: str,
    sequence: str,
    label: int,
    moments: IntArray,
) -> Explanation:
    """Return what a recorder kept of its only episode."""
    return Explanation(
        title=title,
        planner=recorder.name,
        sequence=sequence,
        class_names=context.class_names,
        label=label,
        viewpoints=record.viewpoints[0],
        recognised=np.exp(record.log_probs[0].astype(np.float64)),
        targets=np.array(recorder.targets),
        believed=np.array(recorder.believed),
        weights=np.array(recorder.weights),
        facing=np.array(recorder.facing),
        facing_std=np.array(recorder.facing_std),
        moments=moments,
        workspace=context.workspace,
    )
