"""Running a planner in the small world of conformance, and showing it again what it was shown."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.errors import EpisodeError
from ehar.planner import Context, Observation, Planner, Truth
from ehar.rollout import Batch, blamed
from ehar.runner import Runner
from ehar.sensors.sensor import Sensed, Sensor

SEED = 0  # of every planner's generator


@dataclass(frozen=True, eq=False)
class PlannerWorld:
    """The episodes, and what rolls planners over them."""

    runner: Runner
    batch: Batch

    def context(self, batch: Batch) -> Context:
        """Return what a planner is told, with a new generator of the same seed."""
        episodes, length = batch.positions.shape[:2]
        return self.runner.context(episodes, length, np.random.default_rng(SEED))


@dataclass
class Recorder:
    """Passes everything on to a planner, and keeps what it was shown and what it answered."""

    planner: Planner
    observations: list[Observation] = field(default_factory=list)
    targets: list[FloatArray] = field(default_factory=list)
    changed: dict[str, int] = field(default_factory=dict)  # parts of observations, and in which frame first
    seconds: float = 0.0

    def __post_init__(self) -> None:
        """Take the planner's name."""
        self.name = self.planner.name
        self.privileged = self.planner.privileged

    def reset(self, context: Context) -> None:
        """Pass it on."""
        with blamed(self.planner, f"planner {self.name!r}, reset"):
            self.planner.reset(context)

    def act(self, observation: Observation) -> FloatArray:
        """Pass a copy on, which it may spoil, and keep another."""
        shown, kept = _copy(observation), _copy(observation)
        begin = time.perf_counter()
        with blamed(self.planner, f"planner {self.name!r}, frame {observation.frame}"):
            target = self.planner.act(shown)
        self.seconds += time.perf_counter() - begin
        for name in _arrays(kept):
            if not np.array_equal(getattr(shown, name), getattr(kept, name)):
                self.changed.setdefault(name, observation.frame)
        self.observations.append(replace(kept, truth=None))
        self.targets.append(np.array(target, dtype=np.float64, ndmin=1))
        return target


class PlannerRun(NamedTuple):
    """What came of one run."""

    recorder: Recorder
    targets: FloatArray  # (L - 1, B, 3)
    drew: bool  # from its generator


def run_planner(planner: Planner, world: PlannerWorld, batch: Batch, *, sensor: Sensor | None = None) -> PlannerRun:
    """Run a planner as the benchmark does."""
    recorder = Recorder(planner)
    runner = world.runner if sensor is None else replace(world.runner, sensor=sensor)
    rng = np.random.default_rng(SEED)
    before = rng.bit_generator.state
    runner.roll(recorder, batch, rng)
    targets = np.stack(recorder.targets) if recorder.targets else np.empty((0, len(batch.labels), 3))
    return PlannerRun(recorder, targets, rng.bit_generator.state != before)


def replay(planner: Planner, world: PlannerWorld, shown: list[Observation], batch: Batch, rows: IntArray) -> FloatArray:
    """Return the targets (L - 1, B, 3) for some rows of what was shown before, whatever they lead to."""
    some, recogniser = batch.select(rows), world.runner.recogniser
    where = f"planner {planner.name!r}, {len(rows)} of the rows that it was shown before"
    state = recogniser.start(len(rows))
    targets = []
    with blamed(planner, where):
        planner.reset(world.context(some))
        for observation in shown:
            here = replace(observation, **{name: getattr(observation, name)[rows] for name in _arrays(observation)})
            if planner.privileged:
                _, state = recogniser.step(state, Sensed(here.joints_2d, here.confidence), here.viewpoint)
                here = replace(here, truth=Truth(some.labels, recogniser, state, _imagination(world, some)))
            target = np.array(planner.act(here), dtype=np.float64)
            if target.shape != (len(rows), 3):
                raise EpisodeError(f"{where}, frame {here.frame}: targets of shape {target.shape}")
            targets.append(target)
    return np.stack(targets)


def _imagination(world: PlannerWorld, batch: Batch) -> Callable[[int, FloatArray], Sensed]:
    def imagine(frame: int, candidates: FloatArray) -> Sensed:
        return world.runner.sensor.sense(batch.positions[:, None, frame], candidates, batch.noise.frame(frame).forked())

    return imagine


def _arrays(observation: Observation) -> list[str]:
    return [name for name, value in vars(observation).items() if isinstance(value, np.ndarray)]


def _copy(observation: Observation) -> Observation:
    return replace(observation, **{name: getattr(observation, name).copy() for name in _arrays(observation)})


def joined(one: Observation, other: Observation) -> Observation:
    """Return an observation of the episodes of both."""
    both: dict[str, Any] = {name: np.concatenate([getattr(one, name), getattr(other, name)]) for name in _arrays(one)}
    return replace(one, **both)
