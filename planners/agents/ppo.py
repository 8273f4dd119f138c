"""Proximal policy optimisation of the agent (Sec. 4.2), by stable-baselines3, on the natively batched environment.

One rollout is one batch of whole episodes. Its random numbers follow from the seed and the rollout's number, so a run
that was stopped ends like one that ran through.
"""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger, configure
from torch import Tensor

from ehar.errors import ModelError, UsageError
from planners.agents.config import PPOSetting
from planners.agents.episode_groups import MakeEnv
from planners.agents.network import AgentNetwork
from planners.agents.policy import AgentPolicy
from planners.agents.validation import Ending, stopped_getting_better
from planners.agents.vector_env import AgentVecEnv

DIAGNOSTICS = {  # diagnostics of each rollout: our names, and the names in the logs of stable-baselines3
    "return": "rollout/ep_rew_mean",
    "entropy": "train/entropy_loss",
    "approx_kl": "train/approx_kl",
    "clip_fraction": "train/clip_fraction",
    "explained_variance": "train/explained_variance",
    "policy_loss": "train/policy_gradient_loss",
    "value_loss": "train/value_loss",
}


@dataclass
class PPOProgress:
    """The progress of a run: everything that later rollouts depend on.

    Args:
        network: the network, trained in place.
        rollouts: number of finished rollouts.
        optimiser: the state of Adam; None before the first rollout.
        history: the diagnostics of each rollout.
        evaluations: the accuracy on held-out episodes [%], and after how many frames.
        best: the weights with the highest of them.
        frames_per_s: environment frames per second since this process began; it is not saved, as it decides nothing.
    """

    network: AgentNetwork
    rollouts: int = 0
    optimiser: dict[str, Any] | None = None
    history: list[dict[str, float]] = field(default_factory=list)
    evaluations: list[dict[str, float]] = field(default_factory=list)
    best: dict[str, Tensor] = field(default_factory=dict)
    frames_per_s: float = 0.0

    @property
    def scores(self) -> list[float]:
        """The accuracy of each evaluation [%]."""
        return [evaluation["accuracy"] for evaluation in self.evaluations]

    def evaluate(self, validate: Callable[[AgentNetwork], float], frames: int) -> None:
        """Evaluate the network after so many frames, and remember the best weights."""
        accuracy = validate(self.network)
        if not self.scores or accuracy > max(self.scores):
            self.best = {name: weight.detach().clone() for name, weight in self.network.state_dict().items()}
        self.evaluations = [*self.evaluations, {"frames": frames, "accuracy": accuracy}]


def train_ppo(
    progress: PPOProgress,
    make_env: MakeEnv,
    *,
    moves: int,
    setting: PPOSetting,
    seed: int,
    fine_tune: bool,
    keep: Callable[[PPOProgress], None],
    validate: Callable[[AgentNetwork], float] | None = None,
    workers: int = 0,
    device: str = "cpu",
    tensorboard: str | None = None,
) -> None:
    """Go on training the network of `progress` until validation stops getting better, or the frames are done.

    Args:
        progress: the progress to start from.
        make_env: makes a natively batched environment of so many episodes.
        moves: number of moves in an episode, L - 1.
        setting: the settings of policy optimisation.
        seed: seed of episodes, moves and minibatches.
        fine_tune: whether the policy has been cloned before. The critic has not, so the setting may let it learn first.
        keep: called with the progress after every rollout; the next rollout changes its tensors.
        validate: returns the accuracy on held-out episodes [%]; None trains for all frames.
        workers: number of processes that environments run in; 0 runs them here.
        device: a torch device.
        tensorboard: a folder for TensorBoard's logs, if TensorBoard is installed.

    Raises:
        ModelError: a loss or a weight is not finite, or TensorBoard is not installed. Earlier progress stays as kept.
        UsageError: environments cannot be shared out, or the folder of logs cannot be written.
        EpisodeError: a worker has ended.
    """
    if progress.rollouts >= rollouts_of(setting, moves) or stopped_getting_better(progress.scores, setting.patience):
        return
    if validate is not None and fine_tune and not progress.evaluations:
        progress.evaluate(validate, 0)  # what was cloned is kept if nothing is better
    logger = _logger(tensorboard)
    env = AgentVecEnv(
        make_env,
        num_envs=setting.num_envs,
        seed=seed,
        first=progress.rollouts,
        hold=setting.hold,
        workers=workers,
    )
    try:
        with _global_numpy_state():
            _learn(
                progress,
                env,
                moves=moves,
                setting=setting,
                seed=seed,
                critic_rollouts=setting.critic_rollouts if fine_tune else 0,
                keep=keep,
                validate=validate,
                device=device,
                logger=logger,
            )
    finally:
        progress.network.requires_grad_(True)
        env.close()


def _learn(
    progress: PPOProgress,
    env: AgentVecEnv,
    *,
    moves: int,
    setting: PPOSetting,
    seed: int,
    critic_rollouts: int,
    keep: Callable[[PPOProgress], None],
    validate: Callable[[AgentNetwork], float] | None,
    device: str,
    logger: Logger,
) -> None:
    """Let stable-baselines3 go on from the progress."""
    steps = math.ceil(moves / setting.hold)  # each step holds its move for several frames
    per_rollout = steps * setting.num_envs
    total = rollouts_of(setting, moves) * per_rollout
    generator = torch.Generator(device)
    progress.network.to(device)
    model = PPO(
        AgentPolicy,
        env,
        # `remaining` is counted after a rollout, so it is 0 for the last one. We learn from that one too.
        learning_rate=lambda remaining: setting.learning_rate * min(1.0, remaining + per_rollout / total),
        n_steps=steps,
        batch_size=max(2, math.ceil(per_rollout / setting.minibatches)),  # a batch of one has no normalised advantage
        n_epochs=setting.epochs,
        gamma=setting.gamma,
        gae_lambda=setting.gae_lambda,
        clip_range=setting.clip,
        ent_coef=setting.entropy,
        stats_window_size=setting.num_envs,  # the return of this rollout, not of those before
        policy_kwargs={"network": progress.network, "generator": generator},
        device=device,
    )
    if progress.optimiser is not None:
        model.policy.optimizer.load_state_dict(progress.optimiser)
    model.num_timesteps = progress.rollouts * per_rollout
    model.set_logger(logger)
    callback = _Rollouts(progress, keep, validate, setting, seed, critic_rollouts, moves=moves)
    model.learn(total - model.num_timesteps, callback=callback, reset_num_timesteps=False)


def rollouts_of(setting: PPOSetting, moves: int) -> int:
    """Return the number of rollouts that make up the setting's frames, for episodes of `moves` moves."""
    return max(1, round(setting.frames / (moves * setting.num_envs)))


def ending(progress: PPOProgress, setting: PPOSetting, moves: int) -> Ending:
    """Return why a training has ended, for episodes of `moves` moves."""
    return Ending.of(
        progress.scores,
        [int(evaluation["frames"]) for evaluation in progress.evaluations],
        patience=setting.patience,
        most=rollouts_of(setting, moves) * moves * setting.num_envs,
        unit="frames",
    )


def diagnostics_line(progress: PPOProgress, total: int) -> str:
    """Return a line about the last rollout, of `total` rollouts."""
    shown = ", ".join(f"{name} {value:.3g}" for name, value in progress.history[-1].items())
    return f"rollout {progress.rollouts} of {total}: {shown}, {progress.frames_per_s:,.0f} frames/s"


class _Rollouts(BaseCallback):
    """Seeds each rollout, and evaluates and keeps the progress after each update."""

    def __init__(
        self,
        progress: PPOProgress,
        keep: Callable[[PPOProgress], None],
        validate: Callable[[AgentNetwork], float] | None,
        setting: PPOSetting,
        seed: int,
        critic_rollouts: int,
        moves: int,
    ) -> None:
        super().__init__()
        self.progress, self.keep, self.validate, self.patience = progress, keep, validate, setting.patience
        self.seed, self.critic_rollouts, self.frames = seed, critic_rollouts, moves * setting.num_envs
        self.total, self.every = rollouts_of(setting, moves), max(1, round(setting.evaluate_every / self.frames))
        self.first, self.begin, self.ended = progress.rollouts, time.perf_counter(), False

    def _on_rollout_start(self) -> None:
        """Note the update that has just ended, and begin the next rollout."""
        if self._updated():
            self._note()
        rollout = self.progress.rollouts
        entropy = np.random.SeedSequence([self.seed, rollout]).generate_state(2)
        policy = self.model.policy
        assert isinstance(policy, AgentPolicy)
        policy.generator.manual_seed(int(entropy[0]))
        np.random.seed(int(entropy[1]))  # noqa: NPY002  stable-baselines3 shuffles its minibatches with it
        critic_only = rollout < self.critic_rollouts
        for name, parameter in policy.network.named_parameters():
            parameter.requires_grad_(name.startswith("critic.") or not critic_only)

    def _on_step(self) -> bool:
        """Return whether to go on; a rollout in which it ended is not learned from."""
        self.ended = stopped_getting_better(self.progress.scores, self.patience)
        return not self.ended

    def _on_training_end(self) -> None:
        """Note the last update, unless training ended in a rollout."""
        if self._updated() and not self.ended:
            self._note()

    def _updated(self) -> bool:
        """Return whether a rollout has ended in an update that was not noted yet."""
        per_rollout = self.model.n_steps * self.training_env.num_envs  # type: ignore[attr-defined]
        return bool(self.model.num_timesteps // per_rollout > self.progress.rollouts)

    def _note(self) -> None:
        """Record the diagnostics and keep the progress, unless something is not finite."""
        rollout = self.progress.rollouts + 1
        logged = self.logger.name_to_value
        loss = float(logged.get("train/loss", 0.0))
        network = self.progress.network
        if not math.isfinite(loss):
            raise ModelError(f"PPO: the loss is {loss} in update {rollout}: expected a finite one")
        for name, weight in network.named_parameters():
            if not weight.isfinite().all():
                got = weight[~weight.isfinite()][0].item()
                raise ModelError(f"PPO: {name} holds {got} after update {rollout}: expected finite weights")
        diagnostics = {name: float(logged.get(key, math.nan)) for name, key in DIAGNOSTICS.items()}
        diagnostics["entropy"] *= -1  # logged as a loss
        episodes = self.model.ep_info_buffer or ()
        diagnostics["return"] = float(np.mean([episode["r"] for episode in episodes]))
        self.progress.history = [*self.progress.history, diagnostics]
        self.progress.rollouts = rollout
        seconds = time.perf_counter() - self.begin
        self.progress.frames_per_s = (rollout - self.first) * self.frames / seconds
        self.progress.optimiser = self.model.policy.optimizer.state_dict()
        if self.validate is not None and (rollout % self.every == 0 or rollout == self.total):
            self.progress.evaluate(self.validate, rollout * self.frames)
        self.keep(self.progress)


def _logger(tensorboard: str | None) -> Logger:
    """Return a logger that prints nothing; it writes for TensorBoard if there is a folder for it."""
    if tensorboard is None:
        return Logger(folder=None, output_formats=[])
    try:
        return configure(tensorboard, ["tensorboard"])
    except (ImportError, AssertionError) as error:
        raise ModelError(f"{tensorboard}: expected TensorBoard to be installed, got: {error}") from error
    except OSError as error:
        raise UsageError(f"{tensorboard}: cannot be written: {error.strerror}") from error


@contextmanager
def _global_numpy_state() -> Iterator[None]:
    """Restore numpy's global random state at the end."""
    before = np.random.get_state()  # noqa: NPY002
    try:
        yield
    finally:
        np.random.set_state(before)  # noqa: NPY002
