"""A policy that stable-baselines3 trains on `ehar/Grid-v0`, wrapped as a planner: `python learned.py`."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
from stable_baselines3 import A2C
from stable_baselines3.common.policies import BasePolicy

import recognition  # noqa: F401  registers the environments with Gymnasium
from ehar import Conditions, Context, Observation, Planner
from ehar.envs.observations import shown_to_agent
from ehar.viewpoint import apply_moves
from eval import benchmark


class Learned(Planner):
    """Make the moves that a policy finds most probable.

    Args:
        policy: trained on `ehar/Grid-v0`.
    """

    name = "learned"

    def __init__(self, policy: BasePolicy) -> None:
        """Create the planner."""
        self.policy = policy

    def reset(self, context: Context) -> None:
        """Keep what is said about these episodes."""
        self.context = context

    def act(self, observation: Observation) -> np.ndarray:
        """Return the neighbouring viewpoints that the moves lead to, (B, 3)."""
        seen = shown_to_agent(observation, self.context)  # what the environment shows of a frame
        moves, _ = self.policy.predict(seen, deterministic=True)
        return apply_moves(observation.viewpoint, moves, self.context.workspace)


def train(steps: int, conditions: Conditions) -> Learned:
    """Return a planner that was trained for some steps, on the policy part of the data."""
    env = gym.make("ehar/Grid-v0", conditions=replace(conditions, part="policy"))
    return Learned(A2C("MultiInputPolicy", env, seed=0, device="cpu").learn(steps).policy)


if __name__ == "__main__":
    duo = Conditions(data="duo")
    run = benchmark([train(5_000, duo), "no-act", "oracle"], duo)
    print(run.summary)
