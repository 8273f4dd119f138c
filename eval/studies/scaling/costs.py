"""What commands take, in time of one core: from a timed step of a training, and from what jobs took."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import prod
from pathlib import Path
from typing import NamedTuple

from ehar.conditions import Conditions
from ehar.data.any_source import load_recordings
from ehar.data.motion_data import MotionData
from ehar.data.scenario import part_of, windows
from ehar.data.streams.data import StreamData
from ehar.errors import EharError
from eval.records.job_times import JobTime
from eval.running.cost import ROLLOUTS, Steps, steps_of
from eval.running.episodes import CHUNK
from eval.running.training import TrainAllConfig
from eval.studies.scaling.commands import Asked
from planners.registry import is_learned
from recognition.setting import EPISODE, with_length
from recognition.training.config import TrainingConfig
from recognition.training.stopping import LEAST_CLIPS

# What a job takes for a thousand frames of one person, in steps of a recogniser's training. Measured on the benchmark
# of solo through the estimator, in time of one core: see docs/results/scaling.md.
WATCHED = 0.58  # any planner that takes next to no time itself
PLANNED = {  # beside it
    **{"fixed-best": 0.08, "front": 0.15, "side": 0.15, "near-level": 0.08},
    **{"nbv-greedy": 0.16, "nbv-search": 0.35, "nbv": 2.1, "oracle": 1.7, "oracle-lookahead": 4.3},
}
AGENT_SEEDS = 5  # trainings of each agent in a benchmark
ALONE = 7.0  # [s] of every command: it starts, reads data and weights, and writes tables and a report
RULES = ("no-act", "random", "towards", "h-rotate", "v-rotate", "near-level", "side", "front", "fixed-best")
USUAL = (*RULES, "nbv-greedy", "nbv-search", "nbv", "oracle", "oracle-lookahead")  # where no planner is named
STUDIED = {  # planners of studies that run episodes themselves
    "study headroom": ("no-act", "oracle", "oracle-lookahead"),  # and a camera at each place of the map
    "study ablation": ("nbv",) * 25,
    "study belief": ("no-act", "random", "nbv-search"),
}
ALL = (
    "train recogniser",
    "train gain-field",
    "train fixed-best",
    "train agent",
)  # of `train all`; the first goes first
TRAINS = ("study published", "study real-views", "study trials")  # trainings of their own, which nobody foretells
HEADROOM_MAP = {"azimuths": 12, "polars": 6}  # where a headroom study names none
FIRST_BATCHES = 3  # of rollouts for a gain field, that wait for those before


class Work(NamedTuple):
    """What a command takes.

    Args:
        total: time of one core [s].
        alone: the part of it that one core has to do, one after another [s].
        anywhere: whether the rest may run on all machines; else on the cores of one.
        jobs: number of jobs that results come back from.
    """

    total: Steps
    alone: Steps
    anywhere: bool = False
    jobs: int = 0


@dataclass(frozen=True)
class Costs:
    """What commands take on this machine.

    Args:
        step: time of one core for a step of a recogniser's training on one person [s].
        rates: time of one core for a thousand frames of one person [s], by planner, of finished runs.
    """

    step: float
    rates: Mapping[str, float]

    def work_of(self, asked: Asked) -> Work | None:
        """Return what a command takes; None if nobody knows: it asks for a GPU, or its data are not there."""
        if "cuda" in asked.options.get("device", ()) or asked.option("setting") == "paper":
            return None
        if asked.option("size", "small") != "small" or asked.kind in TRAINS:
            return None
        try:
            if asked.kind.startswith("train"):
                return self._training(asked)
            if asked.kind == "benchmark" or asked.kind in STUDIED:
                return self._episodes(asked)
        except EharError:
            return None
        return Work(*2 * (Steps(ALONE, ALONE),))

    def rate(self, planner: str) -> float:
        """Return the time of one core for a thousand frames of one person [s]."""
        return self.rates.get(planner, self.step * (WATCHED + PLANNED.get(planner, 0.0)))

    def _episodes(self, asked: Asked) -> Work:
        count, frames, persons = _episodes_of(*(asked.option(name) for name in ("data", "fps", "length", "part")))
        count *= int(asked.option("starts", "1") or 1)
        planners = (asked.places or USUAL) if asked.kind == "benchmark" else STUDIED[asked.kind]
        if asked.kind == "study headroom":
            places = (int(asked.option(name, str(usual)) or usual) for name, usual in HEADROOM_MAP.items())
            planners = (*("no-act",) * prod(places), *planners)
        tracks = 1 + len(asked.options.get("tracks", ()))
        trained = [name for name in planners for _ in range(AGENT_SEEDS if is_learned(name) else 1)] * tracks
        thousands = count * frames / 1000 * persons
        total = ALONE + sum(thousands * self.rate(name) for name in trained)
        longest = max(CHUNK * frames / 1000 * persons * self.rate(name) for name in trained)
        return Work(
            Steps(total, total),
            Steps(*2 * (ALONE + longest,)),
            anywhere=asked.kind == "benchmark",
            jobs=len(trained) * -(-count // CHUNK),
        )

    def _training(self, asked: Asked) -> Work:
        if asked.kind == "train all":
            recogniser, *others = (self._training(replace(asked, kind=kind)) for kind in ALL)
            after = max((work.alone for work in others), key=lambda alone: alone.most)
            return Work(sum_of([recogniser.total, *(work.total for work in others)]), sum_of([recogniser.alone, after]))
        data = _recordings(asked.option("data"), asked.option("fps"))
        step, length = self.step * data.persons, asked.option("length")
        kind = asked.kind.removeprefix("train ").replace("gain-field", "gain field")
        if kind == "recogniser":
            clips = int(asked.option("clips") or TrainingConfig.clips)
            batch = TrainingConfig.batch
            took = Steps(min(LEAST_CLIPS, clips) / batch, clips / batch)
            return _started(_times(took, step), _times(took, step))
        seeds = tuple(int(seed) for seed in asked.options.get("seeds", ("0",)))
        told = Conditions(data=data, length=None if length is None else int(length))
        config = TrainAllConfig(conditions=told, out=Path(), seeds=seeds)
        if kind != "agent":
            took = steps_of(config, data, kind)
            most = min(FIRST_BATCHES * ROLLOUTS, took.least) if kind == "gain field" else 0.0
            return _started(_times(took, step), Steps(*2 * (most * step,)))
        stages = (asked.option("stages") or ",".join(config.agents.stage_names)).split(",")
        each = {stage: steps_of(config, data, stage) for stage in stages}
        drawn = [steps_of(config, data, "demonstrations", stage) for stage in stages if stage in ("il", "dagger")]
        sums = [[one[at] for one in each.values()] for at in range(2)]
        total = Steps(*(len(seeds) * sum(sums[at]) + sum(one[at] for one in drawn) for at in range(2)))
        chain = Steps(*(sum(each[stage][at] for stage in ("il", "il-ppo") if stage in each) for at in range(2)))
        return _started(_times(total, step), _times(chain, step))


def rates_of(runs: Mapping[Path, tuple[tuple[JobTime, ...], int]]) -> dict[str, float]:
    """Return the time of one core for a thousand frames of one person [s], by planner.

    Args:
        runs: the jobs of each run, and the number of persons in its data.
    """
    seconds: dict[str, float] = {}
    frames: dict[str, float] = {}
    for jobs, persons in runs.values():
        for job in jobs:
            name = job.planner.partition("/")[0]
            seconds[name] = seconds.get(name, 0.0) + job.core_seconds
            frames[name] = frames.get(name, 0.0) + job.episodes * job.frames * persons / 1000
    return {name: seconds[name] / frames[name] for name in seconds}


def sum_of(times: Sequence[Steps]) -> Steps:
    """Return how long several take, one after another."""
    return Steps(sum(time.least for time in times), sum(time.most for time in times))


def _started(total: Steps, alone: Steps) -> Work:
    return Work(_later(total), _later(alone))


def _later(steps: Steps) -> Steps:
    return Steps(ALONE + steps.least, ALONE + steps.most)


def _times(steps: Steps, step: float) -> Steps:
    return Steps(steps.least * step, steps.most * step)


@cache
def _recordings(data: str | None, fps: str | None) -> MotionData | StreamData:
    return load_recordings(data or "duo", fps=None if fps is None else float(fps))


@cache
def _episodes_of(data: str | None, fps: str | None, length: str | None, part: str | None) -> tuple[int, int, int]:
    """Return the windows of a part from one start each, their frames, and the persons in them."""
    held = _recordings(data, fps)
    told = Conditions(data=held, length=None if length is None else int(length), part=part or "test")
    frames, chosen = with_length(told, held, EPISODE).frames, part_of(held, told.part)
    if isinstance(held, StreamData):
        return int((held.lengths[chosen] // frames).sum()), frames, held.persons
    return len(windows(held, chosen, frames, stride=frames)), frames, held.persons
