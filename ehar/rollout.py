"""The rollout loop: in each frame, all episodes of a batch sense, recognise, plan and move together."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray, in_brief, read_only
from ehar.data.scenario import Scenarios
from ehar.data.skeleton import Skeleton
from ehar.data.streams.following import CentreMotion
from ehar.data.streams.scenario import StreamScenarios
from ehar.data.window import Windows
from ehar.errors import EpisodeError
from ehar.motion import Motion, keep_clear, move
from ehar.obstacles.shapes import MARGIN
from ehar.obstacles.surroundings import Surroundings, too_near
from ehar.onsets import Onset, ToldOnsets, begins
from ehar.planner import Context, Observation, Planner, Truth
from ehar.plugins.blame import blamed
from ehar.recogniser import Recogniser, Recognition
from ehar.sensors.sensing import sense
from ehar.sensors.sensor import Sensed, Sensor, SensorNoise, draw_noise
from ehar.steps import LEAD, StepLimits

ROUNDING = 1e-9  # [m], [rad], of the viewpoints that a motion returns


@dataclass(frozen=True, eq=False, repr=False)
class Batch:
    """B episodes that run together.

    Args:
        positions: (B, L, P, J, 3) [m], relative to each scenario's centre.
        labels: (B,) true classes; of streams (B, L), those of each frame.
        starts: (B, 3) start viewpoints.
        noise: (B, L, ...) random draws of the sensor.
        names: names of the episodes in error messages.
        surroundings: what stands and walks around people; None in an open world.
        centre: the motion of the centre that a vehicle follows, each (B, L, 3); None where the centre rests, or cameras
            follow it at once.
    """

    positions: FloatArray
    labels: IntArray
    starts: FloatArray
    noise: SensorNoise
    names: tuple[str, ...]
    surroundings: Surroundings | None = None
    centre: CentreMotion | None = None

    __repr__ = in_brief

    @staticmethod
    def of(
        scenarios: Scenarios | StreamScenarios,
        chosen: IntArray,
        starts: FloatArray,
        noise: SensorNoise,
        surroundings: Surroundings | None = None,
    ) -> "Batch":
        """Return episodes of scenarios chosen by index (B,)."""
        sequences = (scenarios.data.sequence_names[sequence] for sequence in scenarios.sequence[chosen])
        begins = zip(sequences, scenarios.first[chosen], strict=True)
        return Batch(
            positions=scenarios.positions(chosen),
            labels=scenarios.labels[chosen],
            starts=starts,
            noise=noise,
            names=tuple(f"{name} from frame {first}" for name, first in begins),
            surroundings=surroundings,
            centre=scenarios.centre_motion(chosen) if isinstance(scenarios, StreamScenarios) else None,
        )

    @staticmethod
    def joined(pieces: Sequence["Batch"]) -> "Batch":
        """Return the episodes of several batches, one after another."""
        return Batch(
            positions=np.concatenate([piece.positions for piece in pieces]),
            labels=np.concatenate([piece.labels for piece in pieces]),
            starts=np.concatenate([piece.starts for piece in pieces]),
            noise=SensorNoise(
                *(np.concatenate(draws) for draws in zip(*(piece.noise for piece in pieces), strict=True))
            ),
            names=tuple(name for piece in pieces for name in piece.names),
            surroundings=Surroundings.joined([piece.surroundings for piece in pieces]),
            centre=_joined([piece.centre for piece in pieces if piece.centre is not None]),
        )

    def select(self, rows: IntArray | slice, frames: int | None = None) -> "Batch":
        """Return some of the episodes, cut to their first `frames` frames; None keeps all frames."""
        return Batch(
            positions=self.positions[rows, :frames],
            labels=self.labels[rows] if self.labels.ndim == 1 else self.labels[rows, :frames],
            starts=self.starts[rows],
            noise=SensorNoise(*(draws[rows, :frames] for draws in self.noise)),
            names=tuple(np.array(self.names, dtype=object)[rows]),
            surroundings=None if self.surroundings is None else self.surroundings.select(rows, frames),
            centre=None if self.centre is None else CentreMotion(*(part[rows, :frames] for part in self.centre)),
        )

    @property
    def frame_labels(self) -> IntArray:
        """The true classes in each frame, (B, L)."""
        every = self.labels if self.labels.ndim == 2 else self.labels[:, None]
        return np.broadcast_to(every, self.positions.shape[:2])

    def protected(self) -> "Batch":
        """Return a copy that nobody can write into."""
        noise = SensorNoise(*(read_only(draws) for draws in self.noise))
        return replace(
            self,
            positions=read_only(self.positions),
            labels=read_only(self.labels),
            starts=read_only(self.starts),
            noise=noise,
        )

    def hidden(self, frame: int, viewpoint: FloatArray) -> BoolArray | None:
        """Return which joints are hidden from cameras in a frame, (B, P, J) or (B, F, P, J); None in an open world.

        Args:
            frame: the frame.
            viewpoint: (B, 3), or of forks (B, F, 3).
        """
        if self.surroundings is None:
            return None
        joints = self.positions[:, frame] if viewpoint.ndim == 2 else self.positions[:, None, frame]
        return self.surroundings.hide(viewpoint, joints, frame)

    def first_change(self, before: "Batch") -> str | None:
        """Return the name of the first part that is not what it was; None if there is none."""
        now, then = (
            {"positions": one.positions, "labels": one.labels, "starts": one.starts, **one.noise._asdict()}
            for one in (self, before)
        )
        return next(
            (name for name, array in now.items() if not np.array_equal(array, then[name], equal_nan=True)), None
        )


def _joined(centres: Sequence[CentreMotion]) -> CentreMotion | None:
    return CentreMotion(*(np.concatenate(parts) for parts in zip(*centres, strict=True))) if centres else None


def noise_of(scenarios: Windows, episodes: int, rng: np.random.Generator) -> SensorNoise:
    """Draw the sensor's noise for a number of episodes, (B, L, ...)."""
    data = scenarios.data
    return draw_noise(rng, (episodes, scenarios.length), data.persons, len(data.skeleton.joint_names))


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

    A planner gets read-only copies. In Python a planner can still find the motion, the batch or the recogniser, and
    write into them. So every step is checked against what the motion can do, and at the end the batch is compared with
    what it was, and the recogniser if it has a `fingerprint`.

    Raises:
        EpisodeError: a start lies outside of the workspace; or planner, recogniser, sensor or motion raised an error,
            or returned arrays of other shapes, or arrays that are not finite; or somebody moved the camera by hand, or
            wrote into the batch or the recogniser.
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
        noise = world.noise.frame(frame).forked()
        hidden, where = world.hidden(frame, candidates), f"frame {frame}, as imagined"
        sensed = sense(sensor, world.positions[:, None, frame], candidates, noise, where, hidden)
        return Sensed(*(read_only(array) for array in sensed))

    planning, privileged = f"planner {planner.name!r}", bool(planner.privileged)
    seeing, fingerprint = f"recogniser {type(recogniser).__name__}", _fingerprint(recogniser)
    moving, steps = f"motion {type(motion).__name__}", StepLimits.of(motion, context.frame_time)
    with blamed(motion, f"{moving}, reset"):
        keep_clear(motion, world.surroundings)
        motion.reset(viewpoint.copy(), context.frame_time)
    with blamed(planner, f"{planning}, reset"):
        planner.reset(_own_context(context))
    with blamed(recogniser, f"{seeing}, start"):
        state = watching.start(episodes)
    trail = [viewpoint] * (LEAD + 1)
    passers = None if world.surroundings is None else world.surroundings.passers
    for frame in range(length):
        noise = world.noise.frame(frame)
        hidden = world.hidden(frame, viewpoint)
        sensed = sense(sensor, world.positions[:, frame], viewpoint, noise, f"frame {frame}", hidden)
        with blamed(recogniser, f"{seeing}, frame {frame}"):
            recognition, state = watching.step(state, sensed, viewpoint)
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
            truth=Truth(read_only(frame_labels[:, frame + 1]), watching, state, imagine, frame_labels)
            if privileged
            else None,
            time=frame * context.frame_time,
            passers=None if passers is None else read_only(passers.tracked[:, frame]),
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
    if _fingerprint(recogniser) != fingerprint:
        raise EpisodeError(f"{planning}: {seeing} changed during the rollout, expected no change")
    if bool(planner.privileged) != privileged:
        raise EpisodeError(
            f"{planning}: privileged was {privileged} at first, expected no change, got {not privileged}"
        )
    return Record(viewpoints, log_probs, plan_seconds)


def _own_context(context: Context) -> Context:
    """Return a context whose parts are the planner's own: other planners, motion and sensor have others."""
    return replace(
        context,
        skeleton=Skeleton(context.skeleton.joint_names, context.skeleton.bones),
        workspace=replace(context.workspace),
        vehicle=None if context.vehicle is None else replace(context.vehicle),
    )


def _fingerprint(recogniser: Recogniser) -> bytes | None:
    """Return a hash of what decides a recogniser's answers; None if it gives none."""
    fingerprint = getattr(recogniser, "fingerprint", None)
    if fingerprint is None:
        return None
    with blamed(recogniser, f"recogniser {type(recogniser).__name__}, fingerprint"):
        return bytes(fingerprint())


def check_recognition(recognition: Recognition, recogniser: Recogniser, episodes: int, frame: str) -> None:
    """Raise an EpisodeError that names recogniser and frame unless both arrays are finite and have the right shapes.

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
        if np.shape(array) != expected or not np.isfinite(array).all():
            got = np.shape(array) if np.shape(array) != expected else "NaN or infinity"
            raise EpisodeError(f"{where}: expected finite {name} of shape {expected}, got {got}")


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
        raise EpisodeError(
            f"planner {planner.name!r}, episode {batch.names[bad]!r}, frame {frame}: "
            f"expected a finite target viewpoint, got {targets[bad, ..., :3].reshape(-1, 3)[0].tolist()}"
        )
    return targets
