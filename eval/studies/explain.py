"""Explains one episode: it runs the episode as the benchmark does, and keeps what the planner saw and believed."""

from pathlib import Path

import numpy as np

from ehar.arrays import IntArray
from ehar.conditions import Conditions
from ehar.errors import UsageError
from eval.running.choice import ModelPlace
from eval.running.episodes import CHUNK, cut_scenarios, random_starts
from eval.running.progress import ConsoleReporter, Reporter
from eval.running.recorder import Recorder
from eval.studies.explanation import Explanation
from planners.registry import VALUING, make_planner, needs_gain_model
from planners.value.situation import frames_to_come
from planners.value.view_value import ViewValue
from recognition.setting import length_note, load_setting, localisation_note

FIRST_MOMENT, LAST_MOMENT = 0.1, 0.9  # as shares of the episode


def explain(
    conditions: Conditions | None = None,
    *,
    planner: str = "nbv",
    episode: int = 0,
    frames: int = 4,
    out: str | Path | None = None,
    reporter: Reporter | None = None,
) -> Explanation:
    """Run one episode of the benchmark, and keep what the planner saw and believed.

    In a stream, which has no end, what a view is worth and what is believed are about the coming seconds.

    Args:
        conditions: conditions of the benchmark; None takes the defaults.
        planner: a planner that values views.
        episode: number of the test scenario, from 0; its start viewpoint is the first one of the benchmark.
        frames: number of moments to show, from 10 to 90 % of the episode.
        out: picture to write: .png, .svg or .pdf.
        reporter: receives notes about what is left out; None prints them on standard error.

    Raises:
        EharError: one line that says what was got and what was expected.
    """
    from eval.studies.explain_figure import check_format, draw_explanation  # matplotlib takes a second to import

    conditions, reporter = conditions or Conditions(), reporter or ConsoleReporter()
    if out is not None:
        check_format(Path(out))
    if not needs_gain_model(planner):
        raise UsageError(f"unknown planner {planner!r}; expected one that values views: {', '.join(VALUING)}")
    setting = load_setting(conditions)
    data, length = setting.recordings, setting.conditions.frames
    if length < 2 or not 1 <= frames <= length - 1:
        raise UsageError(f"frames: expected 1 to {length - 1} moments of episodes of {length} frames, got {frames}")
    model = ModelPlace.of(setting).load_gain_model()
    trained = {"recogniser": setting.trained_localisation, "gain field": model.localisation}
    for note in (
        length_note(length, {"recogniser": setting.trained_length, "gain field": model.length}),
        localisation_note(setting.world.localisation, trained),
    ):
        if note is not None:
            reporter.note(f"warning: {note}")
    scenarios = cut_scenarios(data, setting.sequences, length, reporter.note)
    episodes = random_starts(setting.runner.followed(scenarios), 1, conditions.seed, setting.world)
    if not 0 <= episode < len(episodes):
        raise UsageError(f"episode: expected 0 to {len(episodes) - 1}, got {episode}")
    batch, runner = episodes.pick([episode]), setting.runner
    motion = runner.new_motion()
    recorder = Recorder(make_planner(planner, lambda: model))
    record = runner.roll(recorder, batch, episodes.planner_rng(planner, episode // CHUNK), motion)
    value = ViewValue(model)
    value.reset(recorder.context)
    believed, weights, facing, facing_std = [], [], [], []
    for observation in recorder.observations:
        value.update(observation)
        believed.append(value.situation.belief[0])
        weights.append(value.weights[0])
        facing.append(value.situation.facing[0].copy())
        facing_std.append(value.situation.facing_std[0].copy())
    explanation = Explanation(
        title=f"{data.title}, {conditions.sensor} sensor, {conditions.views} views",
        planner=recorder.name,
        sequence=batch.names[0],
        class_names=data.recognised_names,
        labels=batch.frame_labels[0],
        viewpoints=record.viewpoints[0],
        recognised=np.exp(record.log_probs[0].astype(np.float64)),
        targets=np.array([target[0] for target in recorder.targets]),
        believed=np.array(believed),
        weights=np.array(weights),
        facing=np.array(facing),
        facing_std=np.array(facing_std),
        moments=moments(length, frames),
        workspace=motion.workspace,
        span=value.span,
        frame_time=1 / data.fps,
        ahead=None if recorder.context.length is not None else frames_to_come(recorder.context) / data.fps,
        expected=model.lookahead,
    )
    if out is not None:
        draw_explanation(explanation, Path(out))
        reporter.note(f"drawn in {out}")
    return explanation


def moments(length: int, count: int) -> IntArray:
    """Return the frames to show, each once: from 10 to 90 % of an episode of L frames, without its last frame."""
    shares = np.linspace(FIRST_MOMENT, LAST_MOMENT, count)
    return np.unique(np.clip(np.rint(shares * length).astype(np.int64) - 1, 0, length - 2))
