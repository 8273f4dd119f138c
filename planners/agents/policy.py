"""The agent's network as a policy of stable-baselines3."""

from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.distributions import Distribution
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.type_aliases import PyTorchObs, Schedule
from torch import Tensor

from ehar.errors import ModelError
from planners.agents.episode_groups import HINDSIGHT
from planners.agents.network import AgentNetwork


class AgentPolicy(ActorCriticPolicy):
    """Actor and critic of an `AgentNetwork`, over the observations of `AgentVecEnv`.

    Args:
        observation_space: the environment's observation space.
        action_space: the 7 moves.
        lr_schedule: schedule of the learning rate.
        network: the network, trained in place.
        generator: generator that draws the moves.
        **others: the other arguments of a policy of stable-baselines3.

    Raises:
        ModelError: a move is drawn, and the probabilities of moves are not finite.
    """

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        lr_schedule: Schedule,
        *,
        network: AgentNetwork,
        generator: torch.Generator,
        **others: Any,
    ) -> None:
        """Take the network over."""
        super().__init__(observation_space, action_space, lr_schedule, **others)
        self.generator = generator
        self.network = network
        self.optimizer = torch.optim.Adam(network.parameters(), lr=lr_schedule(1), eps=1e-5)

    def _build(self, lr_schedule: Schedule) -> None:
        """Build nothing: the network is an argument."""

    def forward(self, obs: PyTorchObs, deterministic: bool = False) -> tuple[Tensor, Tensor, Tensor]:
        """Return moves (B,), values (B, 1) and the moves' log-probabilities (B,)."""
        state, log_probs = self._judged(obs)
        moves = self._drawn(log_probs, deterministic)
        return moves, self._value(obs, state)[:, None], _chosen(log_probs, moves)

    def evaluate_actions(self, obs: PyTorchObs, actions: Tensor) -> tuple[Tensor, Tensor, Tensor | None]:
        """Return values (B, 1), log-probabilities (B,) and entropies (B,) of moves (B,)."""
        state, log_probs = self._judged(obs)
        entropy = -(log_probs.exp() * log_probs).sum(dim=1)
        return self._value(obs, state)[:, None], _chosen(log_probs, actions.long()), entropy

    def predict_values(self, obs: PyTorchObs) -> Tensor:
        """Return values (B, 1)."""
        return self._value(obs, self._judged(obs)[0])[:, None]

    def get_distribution(self, obs: PyTorchObs) -> Distribution:
        """Return the distribution over moves."""
        return self.action_dist.proba_distribution(action_logits=self._judged(obs)[1])

    def _predict(self, observation: PyTorchObs, deterministic: bool = False) -> Tensor:
        return self._drawn(self._judged(observation)[1], deterministic)

    def _judged(self, obs: PyTorchObs) -> tuple[Tensor, Tensor]:
        """Return states (B, S) and log-probabilities (B, 7)."""
        assert isinstance(obs, dict)
        state = self.network.state(obs)
        return state, torch.log_softmax(self.network.logits(state), dim=1)

    def _drawn(self, log_probs: Tensor, deterministic: bool) -> Tensor:
        if not bool(log_probs.isfinite().all()):
            raise ModelError("policy: expected finite probabilities of the moves, got NaN or infinity")
        if deterministic:
            return log_probs.argmax(dim=1)
        return torch.multinomial(log_probs.exp(), 1, generator=self.generator)[:, 0]

    def _value(self, obs: PyTorchObs, state: Tensor) -> Tensor:
        """Return values (B,); a value with hindsight does not train the policy's state."""
        assert isinstance(obs, dict)
        if self.network.spec.hindsight:
            return self.network.value(state.detach(), obs[HINDSIGHT])
        return self.network.value(state)


def _chosen(log_probs: Tensor, moves: Tensor) -> Tensor:
    return log_probs.gather(1, moves[:, None])[:, 0]
