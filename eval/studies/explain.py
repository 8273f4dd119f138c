"""Explains one episode: runs it as the benchmark does, and keeps what explains it."""

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.conditions import Conditions
from ehar.errors import UsageError
from ehar.planner import Context, Observation, Planner
from eval.running.choice import ModelPlace
from eval.running.episodes import CHUNK, cut_scenarios, random_starts
from eval.running.progress import ConsoleReporter, Reporter
from eval.studies.explanation import Explanation
from planners.registry import VALUING, make_planner, needs_gain_model
from planners.value.model import GainModel
from planners.value.view_value import ViewValue
from recognition.setting import load_setting

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
    conditions: Conditions | None = None,
    *,
    planner: str = "nbv",
    episode: int = 0,
    frames: int = 4,
    reporter: Reporter | None = None,
) -> Explanation:
    """Run one of the benchmark's episodes, and keep what explains it.

    Args:
        conditions: of the benchmark; None is the usual ones.
        planner: one that values views.
        episode: which of the test scenarios, counted from 0; its start viewpoint is the benchmark's first.
        frames: how many moments to show, from 10 to 90 % of the episode.
        reporter: hears of what is left out; None prints it on standard error.

    Raises:
        EharError: one line that says what was got and what was expected.
    """
    conditions = conditions or Conditions()
    if not needs_gain_model(planner):
        raise UsageError(f"unknown planner {planner!r}; expected one that values views: {', '.join(VALUING)}")
    length = conditions.length
    if length < 2 or not 1 <= frames <= length - 1:
        raise UsageError(f"frames: expected 1 to {length - 1} moments of episodes of {length} frames, got {frames}")
    setting = load_setting(conditions)
    model = ModelPlace.of(setting).load_gain_model()
    note = (reporter or ConsoleReporter()).note
    episodes = random_starts(cut_scenarios(setting.data, setting.sequences, length, note), 1, conditions.seed)
    if not 0 <= episode < len(episodes):
        raise UsageError(f"episode: expected 0 to {len(episodes) - 1}, got {episode}")
    batch, runner = episodes.single(episode), setting.runner
    motion = runner.track.new_motion()
    recorder = Recorder(make_planner(planner, lambda: model), model)
    record = runner.roll(recorder, batch, episodes.planner_rng(planner, episode // CHUNK), motion)
    return Explanation(
        title=f"{setting.data.title}, {conditions.sensor} sensor, {conditions.views} views",
        planner=recorder.name,
        sequence=batch.names[0],
        class_names=setting.data.class_names,
        label=int(batch.labels[0]),
        viewpoints=record.viewpoints[0],
        recognised=np.exp(record.log_probs[0].astype(np.float64)),
        targets=np.array(recorder.targets),
        believed=np.array(recorder.believed),
        weights=np.array(recorder.weights),
        facing=np.array(recorder.facing),
        facing_std=np.array(recorder.facing_std),
        moments=moments(length, frames),
        workspace=motion.workspace,
    )


def moments(length: int, count: int) -> IntArray:
    """Return the frames to show: from 10 to 90 % of an episode of L frames, the last one left out, each once."""
    shares = np.linspace(FIRST_MOMENT, LAST_MOMENT, count)
    return np.unique(np.clip(np.rint(shares * length).astype(np.int64) - 1, 0, length - 2))
