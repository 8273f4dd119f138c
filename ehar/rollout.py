"""The rollout loop: in each frame, all episodes of a batch sense, recognise, plan and move together."""

import time
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ehar.arrays import FloatArray, kind_of, read_only
from ehar.batch import Batch
from ehar.data.skeleton import Skeleton
from ehar.errors import EpisodeError
from ehar.motion import ForkedMotion, Motion, keep_clear, move
from ehar.obstacles.shapes import MARGIN
from ehar.obstacles.surroundings import too_near
from ehar.onsets import Onset, ToldOnsets, begins
from ehar.planner import Context, Observation, Planner, Truth
from ehar.plugins.blame import blamed
from ehar.recogniser import NORMALISED, Recogniser, Recognition, total_probability
from ehar.sensors.sensor import Sensed, Sensor
from ehar.steps import LEAD, StepLimits

ROUNDING = 1e-9  # [m], [rad], of the viewpoints that a motion returns


@dataclass(frozen=True, eq=False)
class Record:
    """The viewpoints and the recognition in each frame of B episodes."""

    viewpoints: FloatArray  # (B, L, 3), where the camera was
    log_probs: FloatArray  # (B, L, K), after each frame
    plan_seconds: float  # time in the planner, over all episodes and frames [s]


def rollout(
    planner: Planner,
    batch: Batch,
    recogniser: Recogniser,
    sensor: Sensor,
    motion: Motion,
    context: Context,
    onset: Onset = "unknown",
) -> Record:
    """Run B episodes of L frames, of clips or of streams; in a stream nobody is told how long it lasts.

    Frame 0 is seen from the start viewpoint; after each frame but the last the planner moves the camera. With `onset`
    known, the recogniser begins anew with each activity of a stream.

    A planner gets read-only copies. In Python a planner can still find the motion, the batch, the world, the sensor or
    the recogniser, and write into them. So every step is checked against what the motion can do, and at the end the
    batch and the world are compared with what they were, and sensor and recogniser if they have a `fingerprint`.

    Raises:
        EharError: as planner, recogniser, sensor or motion raised it.
        EpisodeError: a start lies outside of the workspace or near an obstacle; or planner, recogniser, sensor or
            motion raised an error, or returned arrays of other shapes, or arrays that are not finite; or somebody moved
            the camera by hand, or wrote into the batch, the world, the sensor or the recogniser.
    """
    _check_starts(batch, context)
    world = batch.protected()
    episodes, length = world.positions.shape[:2]
    viewpoint, frame_labels = world.starts, read_only(world.frame_labels)
    viewpoints = np.empty((episodes, length, 3))
    log_probs = np.empty((episodes, length, len(context.class_names)), dtype=np.float32)
    plan_seconds = 0.0
    watching: Recogniser = recogniser
    if onset == "known":
        watching = ToldOnsets(recogniser, begins(frame_labels, len(context.class_names) - 1))

    def imagine(frame: int, candidates: FloatArray) -> Sensed:
        sensed = world.sense(sensor, frame, candidates, f"frame {frame}, as imagined")
        return Sensed(*(read_only(array) for array in sensed))

    def seen_from(frame: int, candidates: FloatArray) -> FloatArray:
        return world.seen_from(frame, candidates)

    planning, privileged = f"planner {planner.name!r}", bool(planner.privileged)
    seeing, shared = f"recogniser {type(recogniser).__name__}", _Shared.now(context, sensor, recogniser)
    moving, steps = f"motion {type(motion).__name__}", StepLimits.of(motion, context.frame_time)
    with blamed(motion, f"{moving}, reset"):
        keep_clear(motion, world.surroundings)
        motion.reset(viewpoint.copy(), context.frame_time)
    with blamed(planner, f"{planning}, reset"):
        planner.reset(_own_context(context))
    with blamed(recogniser, f"{seeing}, start"):
        state = watching.start(episodes)
    trail = [viewpoint] * (LEAD + 1)
    fork = _forks(motion)
    around = world.surroundings
    passers, moved = (None, None) if around is None else (around.passers, around.moved)
    for frame in range(length):
        sensed = world.sense(sensor, frame, viewpoint, f"frame {frame}")
        with blamed(recogniser, f"{seeing}, frame {frame}"):
            recognition, state = watching.step(state, sensed, world.seen_from(frame, viewpoint))
        viewpoints[:, frame] = viewpoint
        check_recognition(recognition, recogniser, episodes, f"frame {frame}")
        log_probs[:, frame] = recognition.log_probs
        if frame == length - 1:
            break
        observation = Observation(
            frame=frame,
            length=context.length,
            joints_2d=read_only(sensed.joints_2d),
            confidence=read_only(sensed.confidence),
            viewpoint=read_only(viewpoint),
            log_probs=read_only(recognition.log_probs),
            embedding=read_only(recognition.embedding),
            velocity=read_only(finite_rates(motion, "velocity", episodes, frame)),
            acceleration=read_only(finite_rates(motion, "acceleration", episodes, frame)),
            truth=Truth(read_only(frame_labels[:, frame + 1]), watching, state, imagine, frame_labels, fork, seen_from)
            if privileged
            else None,
            time=frame * context.frame_time,
            passers=None if passers is None else read_only(passers.tracked[:, frame]),
            centre=None if moved is None else read_only(moved[:, frame]),
            gaze=None if world.gaze is None else read_only(world.gaze[:, frame]),
        )
        begin = time.perf_counter()
        with blamed(planner, f"{planning}, frame {frame}"):
            target = planner.act(observation)
        plan_seconds += time.perf_counter() - begin
        targets = _checked(target, planner, batch, frame)
        with blamed(motion, f"{moving}, frame {frame}"):
            reached = move(motion, targets)
        viewpoint = read_only(finite_viewpoints(reached, episodes, f"{moving}, frame {frame}"))
        trail = [*trail[-LEAD - 1 :], viewpoint]
        if steps is not None:
            broken = steps.first_broken(np.stack(trail, axis=1), ROUNDING)
            if broken is not None:
                where = f"{planning}, episode {world.names[broken.episode]!r}, frame {frame + 1}"
                raise EpisodeError(f"{where}: the camera {broken.what}: somebody moved it past {moving}")
    changed = batch.first_change(world)
    if changed is not None:
        raise EpisodeError(f"{planning}: {changed} of the episodes changed during the rollout, expected no change")
    other = shared.first_change(_Shared.now(context, sensor, recogniser))
    if other is not None:
        raise EpisodeError(f"{planning}: {other} changed during the rollout, expected no change")
    if bool(planner.privileged) != privileged:
        raise EpisodeError(
            f"{planning}: privileged was {privileged} at first, expected no change, got {not privileged}"
        )
    return Record(viewpoints, log_probs, plan_seconds)


def _forks(motion: Motion) -> Callable[[int], Motion] | None:
    """Return what forks a motion; None if it can't be forked. Through it nobody gets at the motion's own arrays."""
    return (lambda paths: motion.forked(paths)) if isinstance(motion, ForkedMotion) else None


def _own_context(context: Context) -> Context:
    """Return a context whose parts are the planner's own: other planners, motion and sensor have others."""
    return replace(
        context,
        skeleton=Skeleton(context.skeleton.joint_names, context.skeleton.bones),
        workspace=replace(context.workspace),
        vehicle=None if context.vehicle is None else replace(context.vehicle),
        world=deepcopy(replace(context.world, workspace=replace(context.world.workspace))),
    )


@dataclass(frozen=True, eq=False)
class _Shared:
    """What all planners share, as it is at one moment: by name a copy of it, or a hash of what decides its answers."""

    parts: dict[str, Any]

    @staticmethod
    def now(context: Context, sensor: Sensor, recogniser: Recogniser) -> "_Shared":
        parts: dict[str, Any] = {"the world": deepcopy((context.world, context.workspace, context.vehicle))}
        for kind, part in (("sensor", sensor), ("recogniser", recogniser)):
            fingerprint = getattr(part, "fingerprint", None)
            name = f"{kind} {type(part).__name__}"
            with blamed(part, f"{name}, fingerprint"):
                parts[name] = None if fingerprint is None else bytes(fingerprint())
        return _Shared(parts)

    def first_change(self, later: "_Shared") -> str | None:
        """Return the name of the first part that is another one later; None if all are the same."""
        return next((name for name, part in self.parts.items() if later.parts[name] != part), None)


def check_recognition(recognition: Recognition, recogniser: Recogniser, episodes: int, frame: str) -> None:
    """Raise an EpisodeError that names recogniser and frame unless its answer is one.

    Both parts are arrays of finite floats of the right shapes, and the probabilities of each episode sum to 1.

    Args:
        recognition: recognition of episodes without forks.
        recogniser: the recogniser that returned it.
        episodes: the number of episodes, B.
        frame: name of the frame: "frame 3".
    """
    where = f"recogniser {type(recogniser).__name__}, {frame}"
    parts: tuple[tuple[str, Any, int], ...] = (
        ("log-probabilities", getattr(recognition, "log_probs", None), len(recogniser.class_names)),
        ("embedding", getattr(recognition, "embedding", None), recogniser.embedding_size),
    )
    for name, array, size in parts:
        expected = (episodes, size)
        if not isinstance(array, np.ndarray) or array.dtype.kind != "f":
            raise EpisodeError(f"{where}: {name}: expected an array of floats, got {kind_of(array)}")
        if array.shape != expected or not np.isfinite(array).all():
            got = array.shape if array.shape != expected else "NaN or infinity"
            raise EpisodeError(f"{where}: expected finite {name} of shape {expected}, got {got}")
    total = total_probability(recognition.log_probs)
    worst = int(np.abs(total - 1).argmax())
    if abs(total[worst] - 1) > NORMALISED:
        raise EpisodeError(
            f"{where}: expected log-probabilities, whose probabilities sum to 1 within {NORMALISED:g}, got a sum of "
            f"{total[worst]:.4g} in episode {worst} of the batch"
        )


def finite_viewpoints(reached: Any, episodes: int, where: str) -> FloatArray:
    """Return the viewpoints (B, 3) that a motion reached; raise an EpisodeError unless they are finite and (B, 3)."""
    return _finite(reached, (episodes, 3), f"{where}: viewpoints")


def finite_rates(motion: Motion, name: str, episodes: int, frame: int) -> FloatArray:
    """Return the velocity or the acceleration (B, 3) of a motion; the motion may give one number for all.

    Raises:
        EpisodeError: the rates are not finite, or have another shape.
    """
    where = f"motion {type(motion).__name__}, frame {frame}"
    with blamed(motion, where):
        rates: Any = getattr(motion, name)
    if isinstance(rates, int | float):
        rates = np.full((episodes, 3), float(rates))
    return _finite(rates, (episodes, 3), f"{where}: {name}")


def _finite(array: Any, expected: tuple[int, ...], what: str) -> FloatArray:
    """Return an array of a motion as float64; raise an error if it is not finite or has another shape."""
    try:
        found = np.array(array, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise EpisodeError(f"{what}: expected an array of shape {expected}, got {type(array).__name__}") from error
    if found.shape != expected or not np.isfinite(found).all():
        got = str(found.shape) if found.shape != expected else "NaN or infinity"
        raise EpisodeError(f"{what}: expected finite numbers of shape {expected}, got {got}")
    return found


def _check_starts(batch: Batch, context: Context) -> None:
    """Raise an error that names the episode unless all starts are finite and in the workspace."""
    inside = context.workspace.contains(batch.starts) & np.isfinite(batch.starts).all(axis=1)
    if not inside.all():
        bad = int(np.argmin(inside))
        raise EpisodeError(
            f"episode {batch.names[bad]!r}: expected a start viewpoint within {context.workspace}, "
            f"got {batch.starts[bad].tolist()}"
        )
    if batch.surroundings is not None:
        near = too_near(batch.surroundings.clearance(batch.starts, 0))
        if near.any():
            bad = int(np.argmax(near))
            raise EpisodeError(
                f"episode {batch.names[bad]!r}: expected a start viewpoint at least {MARGIN:g} m from obstacles, "
                f"got {batch.starts[bad].tolist()}"
            )


def _checked(target: FloatArray, planner: Planner, batch: Batch, frame: int) -> FloatArray:
    """Return targets or paths as float64; raise an error that names planner, episode and frame if they are wrong."""
    expected = (len(batch.labels), 3)
    what = f"expected target viewpoints of shape {expected}"
    try:
        targets = np.array(target, dtype=np.float64)  # a copy: the planner may keep what it returned
    except (TypeError, ValueError) as error:
        raise EpisodeError(f"planner {planner.name!r}, frame {frame}: {what}, got {type(target).__name__}") from error
    paths = targets.ndim == 4 and targets.shape[1] > 0 and (len(targets), *targets.shape[2:]) == (*expected, 3)
    if targets.shape != expected and not paths:
        raise EpisodeError(
            f"planner {planner.name!r}, episode {batch.names[0]!r} and those beside it, frame {frame}: "
            f"{what}, or paths ({expected[0]}, F, 3, 3), got {targets.shape}"
        )
    finite = np.isfinite(targets).reshape(len(targets), -1).all(axis=1)
    if not finite.all():
        bad = int(np.argmin(finite))
        vectors = targets[bad].reshape(-1, 3)
        wrong = vectors[int(np.argmin(np.isfinite(vectors).all(axis=1)))]
        raise EpisodeError(
            f"planner {planner.name!r}, episode {batch.names[bad]!r}, frame {frame}: "
            f"expected a finite {'path' if paths else 'target viewpoint'}, got {wrong.tolist()}"
        )
    return targets
