"""PPO: it learns a small task in seconds, goes on where it was stopped, and ends where something is not finite."""

import math
import multiprocessing
import re
from copy import deepcopy
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from ehar.errors import EpisodeError, ModelError, UsageError
from planners.agents.config import PPOSetting
from planners.agents.episode_groups import MakeEnv
from planners.agents.network import AgentNetwork
from planners.agents.ppo import DIAGNOSTICS, PPOProgress, diagnostics_line, rollouts_of, train_ppo
from tests.helpers.agent_worlds import mean_return, tiny_maker, weights
from tests.helpers.agents import untrained_network

MOVES = 9
SMALL = PPOSetting(frames=6 * MOVES * 8, num_envs=8, hold=2, copies=4, learning_rate=3e-3)  # 6 rollouts
PLAIN = PPOSetting(frames=6 * MOVES * 8, num_envs=8, hold=1, copies=1, learning_rate=3e-3, hindsight=False)


def fresh(setting: PPOSetting, *, seed: int = 0) -> PPOProgress:
    """Return the progress of a network that has learned nothing."""
    spec = untrained_network(hindsight=5 if setting.hindsight else 0).spec
    return PPOProgress(AgentNetwork(spec, seed=seed))


def nothing(progress: PPOProgress) -> None:
    """Keep nothing."""


def train(
    progress: PPOProgress, setting: PPOSetting, *, make_env: MakeEnv | None = None, seed: int = 0, **chosen: Any
) -> PPOProgress:
    options = {"moves": MOVES, "fine_tune": False, "keep": nothing} | chosen
    made = make_env or tiny_maker(copies=setting.copies)
    train_ppo(progress, made, setting=setting, seed=seed, **options)
    return progress


@pytest.mark.parametrize(("form", "seed"), [("ours", 0), ("ours", 1), ("paper", 2)])
def test_it_learns_to_go_where_there_is_something_to_see(form: str, seed: int) -> None:
    """Always towards level is worth 1.0 here, and random moves 0.5."""
    if form == "ours":
        setting = PPOSetting(frames=20 * 19 * 64, num_envs=64, hold=3, copies=4, learning_rate=3e-3, gamma=0.9)
    else:
        setting = PPOSetting(
            frames=30 * 19 * 64, num_envs=64, hold=1, copies=1, learning_rate=3e-3, gamma=0.9, hindsight=False
        )
    make_env = tiny_maker(copies=setting.copies, length=20, sensor="perfect")
    progress = train(fresh(setting, seed=seed), setting, make_env=make_env, moves=19, seed=seed)
    assert mean_return(None) < 0.55
    assert mean_return(progress.network) > 0.9
    assert progress.history[-1]["entropy"] < progress.history[0]["entropy"]


@pytest.mark.parametrize(("setting", "fine_tune"), [(SMALL, False), (PLAIN, False), (PLAIN, True)])
@pytest.mark.parametrize("stop", [1, 2, 4])
def test_resuming_is_running_through(setting: PPOSetting, fine_tune: bool, stop: int) -> None:
    """Bit for bit, wherever it was stopped: also where only the critic was learning, or had just been."""
    setting = PPOSetting(**vars(setting) | {"critic_rollouts": 2})
    through = train(fresh(setting), setting, fine_tune=fine_tune)
    kept: list[PPOProgress] = []

    def keep(progress: PPOProgress) -> None:
        kept.append(deepcopy(progress))
        if progress.rollouts == stop:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(fresh(setting), setting, fine_tune=fine_tune, keep=keep)
    resumed = kept[-1]
    assert resumed.rollouts == stop
    assert weights(resumed.network) != weights(through.network)
    np.random.seed(12345)  # noqa: NPY002  whatever it was
    torch.rand(7)
    train(resumed, setting, fine_tune=fine_tune)
    assert resumed.rollouts == through.rollouts == 6
    assert weights(resumed.network) == weights(through.network)
    np.testing.assert_equal(resumed.history, through.history)


@pytest.mark.slow
def test_workers_decide_nothing() -> None:
    setting = PPOSetting(frames=2 * MOVES * 64, num_envs=64)
    one, other = (train(fresh(setting), setting, workers=workers) for workers in (0, 2))
    assert weights(one.network) == weights(other.network)
    assert one.history == other.history


def test_the_seed_decides() -> None:
    first, again, other = (train(fresh(SMALL), SMALL, seed=seed) for seed in (0, 0, 1))
    assert weights(first.network) == weights(again.network)
    assert weights(first.network) != weights(other.network)


def test_what_is_done_is_not_done_again() -> None:
    done = train(fresh(SMALL), SMALL)
    before, history = weights(done.network), list(done.history)

    def keep(progress: PPOProgress) -> None:
        pytest.fail("there is nothing to keep")

    train(done, SMALL, keep=keep)
    assert (weights(done.network), done.history, done.rollouts) == (before, history, 6)


def test_the_first_rollouts_of_a_fine_tuning_train_the_critic_alone() -> None:
    setting = PPOSetting(**vars(SMALL) | {"critic_rollouts": 2})
    states: list[dict[str, torch.Tensor]] = []

    def keep(progress: PPOProgress) -> None:
        states.append(deepcopy(progress.network.state_dict()))

    progress = fresh(setting)
    states.append(deepcopy(progress.network.state_dict()))
    train(progress, setting, fine_tune=True, keep=keep)
    for rollout, (before, after) in enumerate(pairwise(states[:4])):
        for name in before:
            changed = not torch.equal(before[name], after[name])
            assert changed == (name.startswith("critic.") or rollout == 2), (rollout, name)
    assert all(weight.requires_grad for weight in progress.network.parameters())


def test_from_scratch_all_of_it_learns_at_once() -> None:
    setting = PPOSetting(**vars(SMALL) | {"critic_rollouts": 2})
    before = fresh(setting).network.state_dict()
    after: list[dict[str, torch.Tensor]] = []
    train(fresh(setting), setting, keep=lambda reached: after.append(deepcopy(reached.network.state_dict())))
    assert not any(torch.equal(before[name], after[0][name]) for name in before)


def test_the_random_state_of_others_is_given_back() -> None:
    np.random.seed(5)  # noqa: NPY002
    torch.manual_seed(5)
    expected, expected_torch = np.random.random(3).tolist(), torch.rand(3)  # noqa: NPY002
    np.random.seed(5)  # noqa: NPY002
    torch.manual_seed(5)
    train(fresh(SMALL), SMALL)
    assert np.random.random(3).tolist() == expected  # noqa: NPY002
    assert torch.equal(torch.rand(3), expected_torch)


@pytest.mark.parametrize("rollout", [1, 3])
def test_weights_that_are_not_finite_end_it_and_what_was_kept_stays(rollout: int) -> None:
    kept: list[bool] = []

    def keep(progress: PPOProgress) -> None:
        kept.append(all(bool(weight.isfinite().all()) for weight in progress.network.parameters()))
        if progress.rollouts == rollout:
            with torch.no_grad():
                progress.network.critic[0].weight[0, 0] = torch.nan  # type: ignore[index]

    with pytest.raises(ModelError, match=f"in update {rollout + 1}: expected a finite one"):
        train(fresh(SMALL), SMALL, keep=keep)
    assert kept == [True] * rollout


def test_a_loss_that_is_not_finite_ends_it() -> None:
    setting = PPOSetting(**vars(SMALL) | {"entropy": math.inf})
    with pytest.raises(ModelError, match=r"PPO: the loss is (nan|-inf) in update 1: expected a finite one"):
        train(fresh(setting), setting)


def test_a_weight_that_is_not_finite_is_named() -> None:
    """With one step in an update, the loss is from before the step that spoils the weights."""
    setting = replace(SMALL, epochs=1, minibatches=1, learning_rate=math.inf)
    progress = fresh(setting)
    name, _ = next(progress.network.named_parameters())
    expected = rf"^PPO: {re.escape(name)} holds (nan|-?inf) after update 1: expected finite weights$"
    with pytest.raises(ModelError, match=expected):
        train(progress, setting)


def test_moves_whose_probabilities_are_not_finite_cannot_be_drawn() -> None:
    progress = fresh(SMALL)
    with torch.no_grad():
        progress.network.actor.bias[0] = torch.nan
    with pytest.raises(ModelError, match="finite probabilities"):
        train(progress, SMALL)


@pytest.mark.slow
def test_an_error_of_an_environment_ends_its_workers_too() -> None:
    with pytest.raises(EpisodeError, match="ValueError: no evidence"):
        train(fresh(SMALL), SMALL, make_env=tiny_maker(copies=4, broken=True), workers=1)
    assert not multiprocessing.active_children()


def test_tensorboard_that_is_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    from stable_baselines3.common import logger

    monkeypatch.setattr(logger, "SummaryWriter", None)
    with pytest.raises(ModelError, match="expected TensorBoard to be installed"):
        train(fresh(SMALL), SMALL, tensorboard="logs")


def test_tensorboard_is_told_what_the_history_holds(tmp_path: Path) -> None:
    progress = train(fresh(SMALL), SMALL, tensorboard=str(tmp_path))
    logs = EventAccumulator(str(tmp_path)).Reload()
    told = {name: [event.value for event in logs.Scalars(key)] for name, key in DIAGNOSTICS.items()}
    assert told.pop("return") == pytest.approx([of_one["return"] for of_one in progress.history], rel=1e-5)
    for name, values in told.items():  # stable-baselines3 writes those of an update when the next rollout has ended
        sign = -1 if name == "entropy" else 1
        assert values == pytest.approx([sign * of_one[name] for of_one in progress.history[:-1]], rel=1e-5)


def test_the_diagnostics_are_those_of_each_rollout() -> None:
    returns: list[float] = []
    progress = train(fresh(PLAIN), PLAIN, keep=lambda reached: returns.append(reached.history[-1]["return"]))
    assert len(progress.history) == len(returns) == 6
    assert [of_one["return"] for of_one in progress.history] == returns
    for of_one in progress.history:
        assert list(of_one) == list(DIAGNOSTICS)
        assert 0 < of_one["entropy"] <= math.log(7) + 1e-6
        assert of_one["approx_kl"] >= -1e-6
        assert 0 <= of_one["clip_fraction"] <= 1
        # the return is a mean over 8 episodes of 10 frames, each a multiple of a tenth
        assert of_one["return"] * 80 == pytest.approx(round(of_one["return"] * 80), abs=1e-6)
    assert progress.history[-1]["approx_kl"] > 1e-6  # the last rollout is learned from too
    line = diagnostics_line(progress, 6)
    assert line.startswith("rollout 6 of 6: return ")
    assert line.endswith(f"{progress.frames_per_s:,.0f} frames/s")
    assert progress.frames_per_s > 0


@pytest.mark.parametrize(("frames", "expected"), [(1, 1), (72, 1), (107, 1), (109, 2), (432, 6)])
def test_frames_are_whole_rollouts_and_at_least_one(frames: int, expected: int) -> None:
    assert rollouts_of(PPOSetting(frames=frames, num_envs=8), MOVES) == expected


def test_copies_that_do_not_divide_the_environments() -> None:
    setting = PPOSetting(**vars(SMALL) | {"copies": 3})
    with pytest.raises(UsageError, match="multiple of 3 copies"):
        train(fresh(setting), setting)
