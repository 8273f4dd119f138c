"""The rollout loop: it senses, recognises, plans and moves every frame of a batch of episodes in lockstep."""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.data.scenario import Scenarios
from ehar.errors import EharError, EpisodeError
from ehar.motion import Motion
from ehar.planner import Context, Observation, Planner, Truth
from ehar.plugins.loading import failure
from ehar.recogniser import Recogniser
from ehar.sensors.sensor import Sensed, Sensor, SensorNoise, draw_noise


@dataclass(frozen=True, eq=False)
class Batch:
    """B episodes that run together.

    Args:
        positions: (B, L, P, J, 3) [m], relative to each scenario's centre.
        labels: (B,).
        starts: (B, 3) start viewpoints.
        noise: (B, L, ...), random draws of the sensor.
        names: names of the episodes in error messages.
    """

    positions: FloatArray
    labels: IntArray
    starts: FloatArray
    noise: SensorNoise
    names: tuple[str, ...]

    @staticmethod
    def of(scenarios: Scenarios, chosen: IntArray, starts: FloatArray, noise: SensorNoise) -> "Batch":
        """Return episodes of scenarios chosen by index (B,)."""
        sequences = (scenarios.data.sequence_names[sequence] for sequence in scenarios.sequence[chosen])
        begins = zip(sequences, scenarios.first[chosen], strict=True)
        return Batch(
            positions=scenarios.positions(chosen),
            labels=scenarios.labels[chosen],
            starts=starts,
            noise=noise,
            names=tuple(f"{name} from frame {first}" for name, first in begins),
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
        )

    def select(self, rows: IntArray | slice, frames: int | None = None) -> "Batch":
        """Return some of the episodes, cut to their first `frames` frames; None keeps all frames."""
        return Batch(
            positions=self.positions[rows, :frames],
            labels=self.labels[rows],
            starts=self.starts[rows],
            noise=SensorNoise(*(draws[rows, :frames] for draws in self.noise)),
            names=tuple(np.array(self.names, dtype=object)[rows]),
        )


def noise_of(scenarios: Scenarios, episodes: int, rng: np.random.Generator) -> SensorNoise:
    """Draw the sensor's noise for a number of episodes, (B, L, ...)."""
    data = scenarios.data
    return draw_noise(rng, (episodes, scenarios.length), data.persons, len(data.skeleton.joint_names))


@dataclass(frozen=True, eq=False)
class Record:
    """The viewpoints and the recognition in each frame of B episodes."""

    viewpoints: FloatArray  # (B, L, 3), where the camera was
    log_probs: FloatArray  # (B, L, K), after each frame
    plan_seconds: float  # spent in the planner, over all episodes and frames


def rollout(
    planner: Planner, batch: Batch, recogniser: Recogniser, sensor: Sensor, motion: Motion, context: Context
) -> Record:
    """Run B episodes of L frames.

    Frame 0 is seen from the start viewpoint; after each frame but the last the planner moves the camera.

    Raises:
        EpisodeError: a start lies outside the workspace, the planner does not return finite targets (B, 3), an array of
            the recogniser has the wrong shape, or the code of the planner or the recogniser raises an error.
    """
    _check_starts(batch, context)
    episodes, length = batch.positions.shape[:2]
    viewpoint = batch.starts
    viewpoints = np.empty((episodes, length, 3))
    log_probs = np.empty((episodes, length, len(context.class_names)), dtype=np.float32)
    plan_seconds = 0.0

    def imagine(frame: int, candidates: FloatArray) -> Sensed:
        return sensor.sense(batch.positions[:, None, frame], candidates, batch.noise.frame(frame).forked())

    motion.reset(viewpoint, context.frame_time)
    with blamed(planner, f"planner {planner.name!r}, reset"):
        planner.reset(context)
    seeing = f"recogniser {type(recogniser).__name__}"
    with blamed(recogniser, f"{seeing}, start"):
        state = recogniser.start(episodes)
    for frame in range(length):
        sensed = sensor.sense(batch.positions[:, frame], viewpoint, batch.noise.frame(frame))
        with blamed(recogniser, f"{seeing}, frame {frame}"):
            recognition, state = recogniser.step(state, sensed, viewpoint)
        viewpoints[:, frame] = viewpoint
        log_probs[:, frame] = _checked_log_probs(recognition.log_probs, log_probs.shape[::2], seeing, frame)
        if frame == length - 1:
            break
        observation = Observation(
            frame=frame,
            length=length,
            joints_2d=sensed.joints_2d,
            confidence=sensed.confidence,
            viewpoint=viewpoint,
            log_probs=recognition.log_probs,
            embedding=recognition.embedding,
            velocity=motion.velocity,
            acceleration=motion.acceleration,
            truth=Truth(batch.labels, recogniser, state, imagine) if planner.privileged else None,
        )
        begin = time.perf_counter()
        with blamed(planner, f"planner {planner.name!r}, frame {frame}"):
            target = planner.act(observation)
        plan_seconds += time.perf_counter() - begin
        viewpoint = motion.advance(_checked(target, planner, batch, frame))
    return Record(viewpoints, log_probs, plan_seconds)


@contextmanager
def blamed(actor: object, where: str) -> Iterator[None]:
    """Turn an error in the code of a planner or a recogniser into one line that names the file and the line.

    Raises:
        EpisodeError: the code raised an error; an `EharError` passes unchanged.
    """
    try:
        yield
    except EharError:
        raise
    except Exception as error:
        raise EpisodeError(f"{where}: {failure(error, type(actor))}") from error


def _checked_log_probs(log_probs: FloatArray, expected: tuple[int, ...], seeing: str, frame: int) -> FloatArray:
    """Return log-probabilities (B, K), or raise an error that names recogniser and frame."""
    if np.shape(log_probs) != expected or not np.isfinite(log_probs).all():
        raise EpisodeError(
            f"{seeing}, frame {frame}: expected finite log-probabilities of shape {expected}, "
            f"got {'NaN or infinity' if np.shape(log_probs) == expected else np.shape(log_probs)}"
        )
    return log_probs


def _check_starts(batch: Batch, context: Context) -> None:
    """Raise an error that names the episode unless all starts are finite and in the workspace."""
    inside = context.workspace.contains(batch.starts) & np.isfinite(batch.starts).all(axis=1)
    if not inside.all():
        bad = int(np.argmin(inside))
        raise EpisodeError(
            f"episode {batch.names[bad]!r}: expected a start viewpoint within {context.workspace}, "
            f"got {batch.starts[bad].tolist()}"
        )


def _checked(target: FloatArray, planner: Planner, batch: Batch, frame: int) -> FloatArray:
    """Return the targets as float64, or raise an error that names planner, episode and frame."""
    expected = (len(batch.labels), 3)
    try:
        targets = np.asarray(target, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise EpisodeError(
            f"planner {planner.name!r}, frame {frame}: "
            f"expected target viewpoints of shape {expected}, got {type(target).__name__}"
        ) from error
    if targets.shape != expected:
        raise EpisodeError(
            f"planner {planner.name!r}, episode {batch.names[0]!r} and those beside it, frame {frame}: "
            f"expected target viewpoints of shape {expected}, got {targets.shape}"
        )
    finite = np.isfinite(targets).all(axis=1)
    if not finite.all():
        bad = int(np.argmin(finite))
        raise EpisodeError(
            f"planner {planner.name!r}, episode {batch.names[bad]!r}, frame {frame}: "
            f"expected a finite target viewpoint, got {targets[bad].tolist()}"
        )
    return targets
