"""Episodes of a finished run once more, along the paths that were recorded: what was sensed, recognised and wanted.

Records hold neither joints nor all probabilities nor targets. The camera is led along its recorded path, so that the
recogniser sees what it saw, and the planner, asked once more, says where it wanted to go.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ehar.arrays import FloatArray
from ehar.errors import DataError, EharError
from ehar.motion import GridMotion
from ehar.planner import Context, Observation, Planner
from ehar.rollout import Batch, rollout
from ehar.scenario import part_of
from ehar.sensor import SensorNoise
from ehar.skeleton import Skeleton
from ehar.viewpoint import Workspace, from_cells, to_cells
from eval.finished_run import FinishedRun
from eval.planner_choice import ModelPlace
from eval.records import EpisodeRecords
from planners.registry import VALUING, make_planner

if TYPE_CHECKING:
    from eval.episodes import Episodes
    from eval.run import Setting
    from planners.belief import BeliefModel
    from planners.view_value import ViewValue

AGREES = 2e-3  # by which a probability that is computed once more may differ: batches of another size round otherwise


@dataclass(frozen=True, eq=False)
class PlannerReplay:
    """What one planner did in E episodes.

    Args:
        viewpoints: (E, L, 3), where the camera was.
        joints_2d: (E, L, P, J, 2) [px], as sensed.
        confidence: (E, L, P, J), 0 where a joint was missed.
        probabilities: (E, L, K), those that were scored.
        targets: (E, L - 1, 3), where it wanted to be; None where that is not known.
        weights: (E, L - 1, 21) of its gain field, see `planners.view_basis.field_value`; None without one.
    """

    viewpoints: FloatArray
    joints_2d: FloatArray
    confidence: FloatArray
    probabilities: FloatArray
    targets: FloatArray | None
    weights: FloatArray | None


@dataclass(frozen=True, eq=False)
class Replays:
    """E episodes of a run, with all planners that could be replayed.

    Args:
        positions: (E, L, P, J, 3) [m], relative to each scenario's centre.
        skeleton: of one person.
        fps: frames a second.
        image: width and height [px].
        planners: by record name.
        notes: what could not be had, one sentence each.
    """

    positions: FloatArray
    skeleton: Skeleton
    fps: float
    image: tuple[int, int]
    planners: Mapping[str, PlannerReplay]
    notes: tuple[str, ...]


class RecordedMotion:
    """A camera that goes where it went, whatever the target is."""

    workspace = Workspace()

    def __init__(self, path: FloatArray) -> None:
        """Keep the path (B, L, 3)."""
        self._path = path
        self.velocity = self.acceleration = np.zeros((len(path), 3))

    def reset(self, viewpoint: FloatArray, frame_time: float) -> None:
        """Begin anew."""
        self._frame = 0

    def advance(self, target: FloatArray) -> FloatArray:
        """Return the next viewpoint of the path, (B, 3)."""
        self._frame += 1
        return self._path[:, self._frame]


class Listener(Planner):
    """Asks a planner, if there is one, and keeps what it heard and what the camera sensed.

    Args:
        name: of the planner.
        privileged: whether it is handed the truth.
        planner: to ask; None stays where it is.
        value: of views, kept beside it; None where the planner has no gain field.
    """

    def __init__(self, name: str, privileged: bool, planner: Planner | None, value: "ViewValue | None") -> None:
        """Keep nothing yet."""
        self.name, self.privileged = name, privileged
        self._planner, self._value = planner, value

    def reset(self, context: Context) -> None:
        """Begin anew."""
        self.targets: list[FloatArray] = []
        self.weights: list[FloatArray] = []
        for part in (self._planner, self._value):
            if part is not None:
                part.reset(context)

    def act(self, observation: Observation) -> FloatArray:
        """Return the planner's targets, (B, 3)."""
        target = observation.viewpoint if self._planner is None else self._planner.act(observation)
        self.targets.append(np.array(target))
        if self._value is not None:
            self._value.update(observation)
            self.weights.append(self._value.weights.copy())
        return target


def replay_run(
    run: FinishedRun,
    indices: Sequence[int],
    names: Mapping[str, bool],
    *,
    advance: Callable[[str], None] = lambda name: None,
) -> Replays:
    """Replay some episodes of a run.

    Args:
        run: the run.
        indices: of E episodes.
        names: of the planners, by record name; whether each was handed the truth.
        advance: told of each planner that is done.

    Raises:
        DataError: the data or the recogniser are not those of the run, or what is recognised along the recorded paths
            is not what was recorded.
        EharError: the data or the recogniser cannot be read.
    """
    from eval.episodes import cut_scenarios, random_starts
    from recognition.torch_threads import one_torch_thread

    conditions = run.conditions
    setting, place = _setting(run)
    scenarios = cut_scenarios(
        setting.data, part_of(setting.data, conditions.part), conditions.length, lambda line: None
    )
    episodes = random_starts(scenarios, conditions.starts, conditions.seed)
    batch = _batch(episodes, indices)
    belief = place.load_gain_model().belief if conditions.readout == "belief" else None
    notes: list[str] = []
    if run.flown:
        notes.append("What planners wanted is not shown: records of flights hold no velocities to ask them with.")
    replayed = {}
    for name, privileged in names.items():
        planner = None if run.flown else _planner(name, place, notes)
        value = _value(name, place) if planner is not None else None
        listener = Listener(name, privileged and planner is not None, planner, value)
        context = Context(
            episodes=len(indices),
            length=conditions.length,
            frame_time=1 / setting.data.fps,
            class_names=setting.data.class_names,
            skeleton=setting.data.skeleton,
            workspace=RecordedMotion.workspace,
            track=conditions.track,
            rng=episodes.planner_rng(name, 0),
        )
        with one_torch_thread():
            replayed[name] = _replay(run, name, listener, batch, setting, context, indices, belief, notes)
        advance(name)
    camera = setting.sensor.camera
    return Replays(
        positions=batch.positions,
        skeleton=setting.data.skeleton,
        fps=setting.data.fps,
        image=(camera.width, camera.height),
        planners=replayed,
        notes=tuple(notes),
    )


def _setting(run: FinishedRun) -> tuple["Setting", ModelPlace]:
    """Load what the run took place in, and check that it is the same."""
    from eval.run import load_setting

    conditions = run.conditions
    models = None if conditions.models is None else Path(conditions.models)
    setting = load_setting(
        data=conditions.source,
        models=models,
        sensor=conditions.sensor,
        views=conditions.views,
        form="ctrgcn" if conditions.form == "ctrgcn" else "causal",
        fps=conditions.fps,
    )
    for what, held, wanted in (
        ("data", setting.data.sha256, conditions.data_sha256),
        ("recogniser", setting.recogniser_sha256, conditions.recogniser_sha256),
    ):
        if held != wanted:
            raise DataError(f"{run.directory}: expected the {what} of the run, sha256 {wanted}, got {held}")
    place = ModelPlace(
        models=models,
        data=setting.data,
        sensor=conditions.sensor,
        views=conditions.views,
        form=conditions.form,
        recogniser_sha256=setting.recogniser_sha256,
    )
    return setting, place


def _batch(episodes: "Episodes", indices: Sequence[int]) -> Batch:
    """Return some episodes, with the starts and the noise that they had."""
    from eval.explain import single_episode

    pieces = [single_episode(episodes, index) for index in indices]
    return Batch(
        positions=np.concatenate([piece.positions for piece in pieces]),
        labels=np.concatenate([piece.labels for piece in pieces]),
        starts=np.concatenate([piece.starts for piece in pieces]),
        noise=SensorNoise(*(np.concatenate(draws) for draws in zip(*(piece.noise for piece in pieces), strict=True))),
        names=tuple(name for piece in pieces for name in piece.names),
    )


def _planner(name: str, place: ModelPlace, notes: list[str]) -> Planner | None:
    """Return the planner of a record name; None, and a note, where it cannot be made from its name."""
    try:
        return make_planner(name, place.load_gain_model, place.load_agent)
    except EharError:
        notes.append(f"What {name} wanted is not shown: it cannot be made again from its name.")
        return None


def _value(name: str, place: ModelPlace) -> "ViewValue | None":
    """Return what views are worth to a planner that values them."""
    from planners.view_value import ViewValue

    return ViewValue(place.load_gain_model()) if name in VALUING else None


def _replay(
    run: FinishedRun,
    name: str,
    listener: Listener,
    batch: Batch,
    setting: "Setting",
    context: Context,
    indices: Sequence[int],
    belief: "BeliefModel | None",
    notes: list[str],
) -> PlannerReplay:
    records = run.records[name]
    path = records.viewpoint[list(indices)]
    if not run.flown:
        path = from_cells(to_cells(path))  # without the rounding of the records
    record = rollout(listener, batch, setting.recogniser, setting.sensor, RecordedMotion(path), context)
    log_probs = record.log_probs
    if belief is not None:
        from planners.belief import readout

        log_probs = readout(belief, log_probs, record.viewpoints)
    probabilities = np.exp(log_probs.astype(np.float64))
    _check(run, name, records, indices, probabilities)
    frames = [
        setting.sensor.sense(batch.positions[:, frame], path[:, frame], batch.noise.frame(frame))
        for frame in range(path.shape[1])
    ]
    targets = np.stack(listener.targets, axis=1) if listener.targets else np.zeros((len(path), 0, 3))
    led = not run.flown and _leads_along(targets, path)
    if not led and not run.flown and not any(name in note for note in notes):
        notes.append(f"What {name} wanted is not shown: asked once more it would not have gone where it went.")
    return PlannerReplay(
        viewpoints=path,
        joints_2d=np.stack([sensed.joints_2d for sensed in frames], axis=1),
        confidence=np.stack([sensed.confidence for sensed in frames], axis=1),
        probabilities=probabilities,
        targets=targets if led else None,
        weights=np.stack(listener.weights, axis=1) if led and listener.weights else None,
    )


def _check(
    run: FinishedRun, name: str, records: EpisodeRecords, indices: Sequence[int], probabilities: FloatArray
) -> None:
    """Raise a DataError unless the most probable class is as sure as it was."""
    off = np.abs(probabilities.max(axis=-1) - records.top_probability[list(indices)])
    if off.max() > AGREES:
        episode, frame = (int(index) for index in np.unravel_index(int(off.argmax()), off.shape))
        raise DataError(
            f"{run.directory}: expected to recognise in episode {indices[episode]} of {name} what was recognised, "
            f"in frame {frame} the top probability is off by {off.max():.3f}"
        )


def _leads_along(targets: FloatArray, path: FloatArray) -> bool:
    """Return whether targets (E, L - 1, 3) lead a camera on the grid along the path (E, L, 3)."""
    for frame in range(targets.shape[1]):
        motion = GridMotion()
        motion.reset(path[:, frame], 1.0)
        if np.abs(motion.advance(targets[:, frame]) - path[:, frame + 1]).max() > 1e-4:
            return False
    return True
