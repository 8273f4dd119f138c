"""What trainings will cost: predicted from one measured step of each recogniser's training, before anything begins."""

from collections.abc import Hashable, Mapping
from typing import NamedTuple, TypeVar

from ehar.data.motion_data import MotionData
from ehar.data.scenario import USUAL_LENGTH, split_parts, windows
from ehar.data.streams.data import StreamData
from eval.running.outlook import Needed
from eval.running.training import TrainAllConfig
from planners.agents.config import ImitationSetting, PPOSetting
from recognition.training.config import TrainingConfig
from recognition.training.stopping import LEAST_CLIPS

Key = TypeVar("Key", bound=Hashable)

# What parts of other trainings take, in steps of the recogniser's: 32 clips on one thread. Measured on solo, in time of
# one core, of which a step took 0.29 s. In streams planners learn from longer windows than recognisers do, and a part
# takes so many times as much. On solo-stream, of which a step took 1.06 s, that is within a sixth of what was measured
# of demonstrations and of policy optimisation.
ROLLOUTS = 11.5  # a batch of branching rollouts for the gain field
PLACE = 0.095  # a place of fixed-best in one window
DEMONSTRATED = {"oracle": 0.1, "oracle-lookahead": 0.25}  # an episode, by its teacher
CLONED = 0.0045  # an epoch of a demonstrated episode
OPTIMISED = 0.8  # a thousand frames of policy optimisation

PLACES = 54
MOST_WINDOWS = 128
BEFORE_AND_AFTER = 6 + 6  # batches of rollouts on the validation part
LEAST_BATCHES = 24  # of rollouts for a gain field: twelve and twice as many
HELD_OUT = 128  # demonstrated episodes


class Steps(NamedTuple):
    """A time: if trainings stop as soon as they may, and at the most; in steps, or in seconds."""

    least: float
    most: float

    def __str__(self) -> str:
        """Return a time in seconds in words."""
        least, most = duration(self.least), duration(self.most)
        return least if least == most else f"{least} to {most}"


def steps_of(config: TrainAllConfig, data: MotionData | StreamData, kind: str, agent: str | None = None) -> Steps:
    """Return what a stage costs, in steps of the recogniser's training.

    Args:
        config: the trainings on one set.
        data: the set.
        kind: recogniser, gain field, fixed-best, demonstrations, or an agent.
        agent: agent that demonstrations are for.
    """
    needed = Needed.of(data, config.told.length)
    longer = needed.planners / needed.recogniser
    if kind == "recogniser":
        asked = config.recogniser
        ends_early = asked.optimiser == TrainingConfig.optimiser
        least = min(LEAST_CLIPS, asked.clips) if ends_early else asked.clips
        return Steps(least / asked.batch, asked.clips / asked.batch)
    if kind == "gain field":
        most = config.gain_field.batches
        drawn = (2 * batches + BEFORE_AND_AFTER for batches in (min(LEAST_BATCHES, most), most))
        return Steps(*(ROLLOUTS * longer * batches for batches in drawn))
    if kind == "fixed-best":
        held = len(windows(data, split_parts(data).validation, needed.planners, stride=needed.planners))
        return Steps(*2 * (PLACE * longer * PLACES * min(held, MOST_WINDOWS),))
    if kind == "demonstrations" and agent is not None:
        asked_of = config.agents.imitation("dagger" if agent == "dagger" else "il")
        return Steps(*2 * (DEMONSTRATED[asked_of.teacher] * longer * (asked_of.episodes + HELD_OUT),))
    if kind in ("il", "dagger"):
        asked_of = config.agents.imitation("dagger" if kind == "dagger" else "il")
        return _cloned(asked_of, longer)
    if kind not in ("ppo", "il-ppo"):
        raise ValueError(f"expected a stage of a training, got {kind!r}")
    return _optimised(config.agents.ppo, USUAL_LENGTH / needed.recogniser)


def _cloned(setting: ImitationSetting, longer: float) -> Steps:
    drawn = DEMONSTRATED[setting.teacher] * (setting.episodes + HELD_OUT) * setting.per_seed
    epochs = (min(setting.patience + 1, setting.epochs), setting.epochs)
    return Steps(*(longer * (drawn + CLONED * setting.episodes * most) for most in epochs))


def _optimised(setting: PPOSetting, shorter: float) -> Steps:
    least = min((setting.patience + 1) * setting.evaluate_every, setting.frames)
    return Steps(*(OPTIMISED * shorter * frames / 1000 for frames in (least, setting.frames)))


def step_seconds(config: TrainAllConfig) -> float:
    """Return how long a step of the recogniser's training takes here, on one thread [s]."""
    from recognition.training.trainer import time_step  # imported here: torch takes seconds

    return time_step(config.recogniser)


def predicted(graph: Mapping[Key, tuple[Key, ...]], costs: Mapping[Key, Steps], cores: int) -> Steps:
    """Return how long a graph takes on so many cores: all of its work shared out, or its longest chain.

    Args:
        graph: stages, each after those that it needs, and which stages it needs.
        costs: what each stage takes on one core.
        cores: number of stages that run side by side.
    """

    def longest(seconds: tuple[float, ...], at: int) -> float:
        ends: dict[Key, float] = {}
        for stage, needed in graph.items():
            ends[stage] = max((ends[one] for one in needed), default=0.0) + costs[stage][at]
        return max(sum(seconds) / cores, *ends.values())

    return Steps(*(longest(tuple(costs[stage][at] for stage in graph), at) for at in range(2)))


def duration(seconds: float) -> str:
    """Return a time in words, as exact as it is known: 40 s, 12 min, 3.5 h."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 90 * 60 else f"{seconds / 3600:.1f} h"
