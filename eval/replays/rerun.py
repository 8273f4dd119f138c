"""Runs episodes of a finished run again along their recorded paths, to see what was sensed, recognised and wanted.

Records hold neither joints nor all probabilities nor targets. The camera follows its recorded path, so the recogniser
sees the same as before. The planner is asked again where it wants to go.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.batch import Batch
from ehar.camera import Camera
from ehar.data.scenario import Scenarios, part_of
from ehar.data.skeleton import Skeleton
from ehar.data.streams.scenario import StreamScenarios
from ehar.errors import DataError
from ehar.planner import Context, Observation, Planner
from ehar.rollout import Record
from eval.running.episodes import cut_scenarios, random_starts
from eval.running.jobs import Workload
from eval.running.recorder import Recorder
from eval.running.run import Run
from eval.verification.followed_way import FollowedWay
from eval.verification.inputs import Inputs
from eval.verification.rerun import make_again
from eval.verification.seen import seen_difference
from planners.heuristic import NoAct
from planners.registry import VALUING

if TYPE_CHECKING:
    from planners.value.model import GainModel


@dataclass(frozen=True, eq=False)
class PlannerReplay:
    """The replay of one planner in E episodes.

    Args:
        viewpoints: (E, L, 3), where the camera was.
        joints_2d: (E, L, P, J, 2) [px], as sensed.
        confidence: (E, L, P, J), 0 where a joint was missed.
        probabilities: (E, L, K), the scored probabilities.
        targets: E arrays (L - 1, 3), its targets; None if they are unknown.
        weights: E arrays (L - 1, 21), the weights of its gain field, see `planners.value.view_basis.field_value`; None
            without a gain field.
    """

    viewpoints: FloatArray
    joints_2d: FloatArray
    confidence: FloatArray
    probabilities: FloatArray
    targets: tuple[FloatArray | None, ...]
    weights: tuple[FloatArray | None, ...]

    def cut(self, frames: slice) -> "PlannerReplay":
        """Return some of the frames."""
        return PlannerReplay(
            viewpoints=self.viewpoints[:, frames],
            joints_2d=self.joints_2d[:, frames],
            confidence=self.confidence[:, frames],
            probabilities=self.probabilities[:, frames],
            targets=tuple(None if target is None else target[frames] for target in self.targets),
            weights=tuple(None if weights is None else weights[frames] for weights in self.weights),
        )


@dataclass(frozen=True, eq=False)
class Replays:
    """E episodes of a run, with all planners that could be replayed.

    Args:
        positions: (E, L, P, J, 3) [m], relative to each scenario's centre; in a stream, to where it is in that frame.
        labels: (E, L), the true class of each frame.
        centres: (E, L, 3) [m], where the centre is in a stream, relative to the first frame; None in clips.
        passers: (E, L, W, J, 3) [m], who walks past, in the frame of `positions`; None if nobody does.
        skeleton: the skeleton of one person.
        class_names: K class names; in streams, the last one is no activity.
        fps: frames per second.
        camera: intrinsics of all cameras.
        planners: replay of each planner, by record name.
        notes: what is missing, one sentence each.
    """

    positions: FloatArray
    labels: IntArray
    centres: FloatArray | None
    passers: FloatArray | None
    skeleton: Skeleton
    class_names: tuple[str, ...]
    fps: float
    camera: Camera
    planners: Mapping[str, PlannerReplay]
    notes: tuple[str, ...]

    def thinned(self, every: int) -> "Replays":
        """Return one frame in `every`."""
        frames = slice(None, None, every)
        return replace(
            self,
            positions=self.positions[:, frames],
            labels=self.labels[:, frames],
            centres=None if self.centres is None else self.centres[:, frames],
            passers=None if self.passers is None else self.passers[:, frames],
            fps=self.fps / every,
            planners={name: planner.cut(frames) for name, planner in self.planners.items()},
        )


def replay_run(
    run: Run, inputs: Inputs, indices: Sequence[int], names: Sequence[str], *, advance: Callable[[str], None]
) -> Replays:
    """Replay some episodes of a run.

    They run as one batch and not in their original chunks, so a planner that draws random numbers draws other ones. Its
    targets are left out if they do not lead along the recorded path. Its gain field rests on what was seen, and stays.

    Args:
        run: the run.
        inputs: data and models of the run.
        indices: numbers of E episodes in the run.
        names: record names of the planners.
        advance: is told of each planner that is done.

    Raises:
        DataError: the data or the recogniser is missing, or the replay does not recognise what was recorded.
        EharError: something that the run needed cannot be read.
    """
    conditions = run.conditions
    reason = inputs.reason_against
    if reason is not None or inputs.setting is None or inputs.place is None:
        raise DataError(str(reason))
    data = inputs.setting.recordings
    scenarios = cut_scenarios(data, part_of(data, conditions.part), conditions.frames, lambda line: None)
    episodes = random_starts(scenarios, conditions.starts, conditions.seed, run.config.world)
    belief = inputs.place.load_gain_model().belief if run.config.readout == "belief" else None
    workload = Workload(inputs.setting.runner, episodes, belief)
    batch = workload.followed.pick(indices)
    asked = tuple(planner for planner in run.config.planners if planner.name in names)
    planners, left = make_again(replace(run.config, planners=asked), inputs.place)
    notes = [f"What {name} wanted is not shown: {left[name]}." for name in names if name in left]
    replayed = {}
    for name in names:
        model = inputs.place.load_gain_model() if name in planners and name in VALUING else None
        replayed[name], astray = _replay(run, name, planners.get(name), model, workload, batch, indices)
        if name in planners and astray:
            notes.append(
                f"What {name} wanted is not shown in {astray} of {len(indices)} episodes: asked once more, and with "
                "other episodes beside them, it would not have gone where it went. Random draws, which are a batch's, "
                "do that, and moves that are as good but for rounding; `ehar verify --rerun-episodes` asks for whole "
                "batches, as the run did."
            )
        advance(name)
    passers = None if batch.surroundings is None else batch.surroundings.passers
    return Replays(
        positions=batch.around_centre,
        labels=np.broadcast_to(batch.labels.reshape(len(batch.labels), -1), batch.positions.shape[:2]),
        centres=_centres(workload.followed.scenarios, episodes.scenario[list(indices)]),
        passers=None if passers is None else passers.joints(slice(None)),
        skeleton=data.skeleton,
        class_names=data.recognised_names,
        fps=data.fps,
        camera=inputs.setting.runner.sensor.camera,
        planners=replayed,
        notes=tuple(notes),
    )


def _replay(
    run: Run,
    name: str,
    planner: Planner | None,
    model: "GainModel | None",
    workload: Workload,
    batch: Batch,
    indices: Sequence[int],
) -> tuple[PlannerReplay, int]:
    """Return the replay of one planner, and in how many episodes its targets lead elsewhere.

    Args:
        run: the run.
        name: name of the planner's record.
        planner: the planner to ask; None if it cannot be made again.
        model: model of its gain field; None if it has none.
        workload: workload of the run.
        batch: the episodes.
        indices: their numbers in the run.
    """
    records, sensor = run.records[name], workload.runner.sensor
    way = records.viewpoint[list(indices)]

    def play(nudges: FloatArray) -> tuple[Record, Recorder, FollowedWay]:
        motion = FollowedWay(workload.runner.new_motion(), way, nudges)
        recorder = Recorder(planner or NoAct(), name=name)  # the recorded path decides the view, not the planner
        return workload.roll(recorder, batch, 0, motion), recorder, motion

    record, recorder, motion = play(np.zeros_like(way))
    difference, nudges = seen_difference(
        name, records, np.array(indices), record, batch, sensor, lambda nudges: play(nudges)[0]
    )
    if difference is not None:
        raise DataError(difference)
    if nudges.any():
        record, recorder, motion = play(nudges)
    weights = [] if model is None else _field_weights(model, recorder.context, recorder.observations)
    frames = [batch.sense(sensor, frame, record.viewpoints[:, frame]) for frame in range(way.shape[1])]
    astray: BoolArray = np.asarray(motion.elsewhere.any(axis=1))
    led = np.zeros(len(way), dtype=bool) if planner is None else ~astray
    return PlannerReplay(
        viewpoints=way,
        joints_2d=np.stack([sensed.joints_2d for sensed in frames], axis=1),
        confidence=np.stack([sensed.confidence for sensed in frames], axis=1),
        probabilities=np.exp(record.log_probs.astype(np.float64)),
        targets=_by_episode(recorder.targets, led),
        weights=_by_episode(weights, np.ones(len(way), dtype=bool)),  # they rest on what was seen, on the recorded path
    ), int(astray.sum())


def _centres(scenarios: Scenarios | StreamScenarios, chosen: IntArray) -> FloatArray | None:
    """Return where the centre is in each frame of streams, relative to the first, (E, L, 3) [m]; None in clips."""
    if not isinstance(scenarios, StreamScenarios):
        return None
    centres = scenarios.centres(chosen)
    relative: FloatArray = centres - centres[:, :1]
    return relative


def _field_weights(model: "GainModel", context: Context, observations: Sequence[Observation]) -> list[FloatArray]:
    """Return the weights of the gain field after each observation, (B, 21)."""
    from planners.value.view_value import ViewValue  # imported here: torch takes seconds

    value = ViewValue(model)
    value.reset(context)
    weights = []
    for observation in observations:
        value.update(observation)
        weights.append(value.weights.copy())
    return weights


def _by_episode(frames: list[FloatArray], kept: BoolArray) -> tuple[FloatArray | None, ...]:
    """Return an array for each episode from an array for each frame; None for episodes that are not kept."""
    if not frames:
        return (None,) * len(kept)
    heard = np.stack(frames, axis=1)
    return tuple(episode if keep else None for episode, keep in zip(heard, kept, strict=True))
