"""Validation of agents in training: how well they do on people that are held out, and whether it still gets better."""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ehar.data.scenario import Scenarios
from ehar.data.streams.scenario import StreamScenarios
from ehar.runner import Runner
from planners.agents.agent import Agent
from planners.agents.network import AgentNetwork

BATCHES, EPISODES = 4, 32  # 128 episodes, of which 32 run in lockstep
STREAM_BATCHES = 2  # of streams, whose episodes show several activities each
VALIDATION_SEED = 1_000_003  # draws the same episodes for every evaluation of every training


@dataclass(frozen=True, eq=False)
class Validation:
    """The same held-out episodes each time.

    Args:
        runner: runs them.
        scenarios: the scenarios that they are drawn from.
    """

    runner: Runner
    scenarios: Scenarios | StreamScenarios

    def accuracy(self, network: AgentNetwork) -> float:
        """Return the accuracy of the network's most probable moves [%], the mean over frames and episodes.

        Of streams, frames that show no activity do not count.
        """
        agent = Agent(name="in training", network=deepcopy(network).cpu())
        right = []
        for batch in range(validation_batches(self.scenarios)):
            rng = np.random.default_rng([VALIDATION_SEED, batch])
            chosen = rng.integers(len(self.scenarios), size=EPISODES)
            episodes = self.runner.batch(self.scenarios, chosen, self.runner.world.sample_starts(rng, EPISODES), rng)
            record = self.runner.roll(agent, episodes, rng)
            correct = record.log_probs.argmax(axis=-1) == episodes.frame_labels
            right.append(correct[episodes.frame_labels < len(self.scenarios.data.class_names)])
        return 100 * float(np.concatenate(right).mean())


def validation_batches(scenarios: Scenarios | StreamScenarios) -> int:
    """Return the number of batches of held-out episodes."""
    return STREAM_BATCHES if isinstance(scenarios, StreamScenarios) else BATCHES


def stopped_getting_better(scores: Sequence[float], patience: int) -> bool:
    """Return whether none of the last `patience` scores is above all before them; NaN is above nothing."""
    return len(scores) > patience and not max(scores[-patience:]) > max(scores[:-patience])


@dataclass(frozen=True)
class Ending:
    """Why a training ended.

    Args:
        better: whether validation was still getting better.
        best: when it was best; these weights are kept.
        ended: when the training ended.
        most: when it would have ended at the latest.
        unit: unit of these three: frames or epochs.
    """

    better: bool
    best: int
    ended: int
    most: int
    unit: str

    @staticmethod
    def of(scores: Sequence[float], at: Sequence[int], *, patience: int, most: int, unit: str) -> "Ending":
        """Return why a training ended.

        Args:
            scores: the score of each evaluation.
            at: when each of them was.
            patience: number of evaluations without a better one after which a training stops.
            most: when it ends at the latest.
            unit: unit of `at` and `most`.
        """
        best = at[int(np.argmax(scores))]
        return Ending(not stopped_getting_better(scores, patience), best, at[-1], most, unit)

    def __str__(self) -> str:
        """Return a line for the console; one that warns says so."""
        if self.better:
            still = "still getting better" if self.best == self.ended else f"too soon after the best at {self.best:,}"
            return f"warning: cut short at {self.ended:,} {self.unit}, {still}: more may help"
        return f"validation stopped getting better after {self.best:,} of at most {self.most:,} {self.unit}"

    def to_json(self) -> dict[str, Any]:
        """Return the object in the JSON beside the weights."""
        return {"why": str(self), **asdict(self)}
