"""Runs a planner over the few episodes of a conformance kit, and shows it the same observations again."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.batch import Batch
from ehar.errors import EpisodeError
from ehar.motion import heading
from ehar.planner import Context, Observation, Planner, Truth
from ehar.plugins.blame import blamed
from ehar.runner import Runner
from ehar.sensors.sensor import Sensed, Sensor
from eval.running.recorder import Recorder, array_names

SEED = 0  # seed of every planner's generator


@dataclass(frozen=True, eq=False)
class PlannerWorld:
    """The episodes of a kit, and the runner that runs planners over them."""

    runner: Runner
    batch: Batch

    def context(self, batch: Batch) -> Context:
        """Return the context of a planner, with a new generator of the same seed."""
        episodes, frames = batch.positions.shape[:2]
        length = None if batch.labels.ndim > 1 else frames
        return self.runner.context(episodes, length, np.random.default_rng(SEED))


class CheckedRun(NamedTuple):
    """The results of one run of a planner."""

    recorder: Recorder
    targets: FloatArray  # (L - 1, B, 3)
    changed: dict[str, int]  # parts of observations that the planner changed, with the first frame of each
    drew: bool  # whether it drew from its generator


def run_planner(planner: Planner, world: PlannerWorld, batch: Batch, *, sensor: Sensor | None = None) -> CheckedRun:
    """Run a planner as the benchmark does."""
    changed: dict[str, int] = {}

    def note_changes(shown: Observation) -> None:
        kept = recorder.observations[-1]
        for name in array_names(kept):
            if not np.array_equal(getattr(shown, name), getattr(kept, name)):
                changed.setdefault(name, kept.frame)

    recorder = Recorder(planner, answered=note_changes)
    runner = world.runner if sensor is None else replace(world.runner, sensor=sensor)
    rng = np.random.default_rng(SEED)
    before = rng.bit_generator.state
    runner.roll(recorder, batch, rng)
    targets = np.stack(recorder.targets) if recorder.targets else np.empty((0, len(batch.labels), 3))
    return CheckedRun(recorder, targets, changed, rng.bit_generator.state != before)


def replay(planner: Planner, world: PlannerWorld, shown: list[Observation], batch: Batch, rows: IntArray) -> FloatArray:
    """Return the targets (L - 1, B, 3) for some rows of earlier observations; the targets move nothing."""
    some, recogniser = batch.select(rows), world.runner.recogniser
    where = f"planner {planner.name!r}, {len(rows)} of the rows that it was shown before"
    state = recogniser.start(len(rows))
    targets = []
    with blamed(planner, where):
        planner.reset(world.context(some))
        for observation in shown:
            here = replace(observation, **{name: getattr(observation, name)[rows] for name in array_names(observation)})
            if planner.privileged:
                told = some.seen_from(here.frame, here.viewpoint)
                _, state = recogniser.step(state, Sensed(here.joints_2d, here.confidence), told)
                imagine, labels = _imagination(world, some), some.frame_labels
                coming = labels[:, here.frame + 1]
                truth = Truth(coming, recogniser, state, imagine, labels, seen_from=some.seen_from)
                here = replace(here, truth=truth)
            target = heading(planner.act(here))
            if target.shape != (len(rows), 3):
                raise EpisodeError(f"{where}, frame {here.frame}: targets of shape {target.shape}")
            targets.append(target)
    return np.stack(targets)


def _imagination(world: PlannerWorld, batch: Batch) -> Callable[[int, FloatArray], Sensed]:
    def imagine(frame: int, candidates: FloatArray) -> Sensed:
        return batch.sense(world.runner.sensor, frame, candidates, f"frame {frame}")

    return imagine


def joined(one: Observation, other: Observation) -> Observation:
    """Return an observation with the episodes of both."""
    both: dict[str, Any] = {
        name: np.concatenate([getattr(one, name), getattr(other, name)]) for name in array_names(one)
    }
    return replace(one, **both)
