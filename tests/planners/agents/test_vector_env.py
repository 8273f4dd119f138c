"""Episodes as stable-baselines3 sees them: by hand against the environment, and alike in any number of processes."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stable_baselines3.common.vec_env import VecCheckNan, VecMonitor

from ehar.arrays import FloatArray, IntArray
from ehar.envs.environment import EpisodeVectorEnv
from ehar.errors import EpisodeError, UsageError
from planners.agents import vector_env
from planners.agents.episode_groups import HINDSIGHT, Group, GroupSetting, hindsight, relative_rewards
from planners.agents.inputs import AgentInputs, Inputs
from planners.agents.vector_env import AgentVecEnv
from tests.helpers.agent_worlds import LENGTH, tiny_env, tiny_maker
from tests.helpers.places import ROOT
from tests.helpers.processes import needs_proc, still_running

STEPS = LENGTH - 1


def adapter(num_envs: int = 6, *, seed: int = 3, copies: int = 1, **chosen: Any) -> AgentVecEnv:
    return AgentVecEnv(tiny_maker(copies=copies), num_envs=num_envs, seed=seed, **chosen)


def group_seed(seed: int, group: int, batch: int) -> int:
    """Return what a group seeds its environment with, for a batch of episodes."""
    return int(np.random.SeedSequence([seed, group, batch]).generate_state(1)[0])


def random_moves(steps: int, num_envs: int) -> IntArray:
    return np.random.default_rng(9).integers(0, 7, (steps, num_envs))


def run(env: AgentVecEnv, moves: IntArray) -> tuple[list[Inputs], FloatArray, list[list[dict[str, Any]]]]:
    """Return all inputs, rewards (steps, B) and infos of moves (steps, B), and close the environment."""
    inputs: list[Any] = [env.reset()]
    rewards, infos = [], []
    for of_step in moves:
        seen, reward, _, info = env.step(of_step)
        inputs.append(seen)
        rewards.append(reward)
        infos.append(info)
    env.close()
    return inputs, np.stack(rewards), infos


def same(one: Inputs, other: Inputs) -> None:
    assert one.keys() == other.keys()
    for name, values in one.items():
        np.testing.assert_array_equal(values, other[name], err_msg=name)


def test_two_batches_of_episodes_by_hand() -> None:
    """Inputs, rewards, ends and returns are those of the environment itself with the same seeds."""
    env, moves = adapter(), random_moves(2 * STEPS, 6)
    seen: Any = env.reset()
    for batch in range(2):
        by_hand, inputs = tiny_env(6), AgentInputs()
        shown, info = by_hand.reset(seed=group_seed(3, 0, batch))
        expected = inputs.see(shown)
        returns = np.zeros(6)
        for step in range(STEPS):
            same({name: values for name, values in seen.items() if name != HINDSIGHT}, expected)
            np.testing.assert_array_equal(seen[HINDSIGHT], hindsight(shown["probabilities"], info))
            of_step = moves[batch * STEPS + step]
            seen, rewards, dones, infos = env.step(of_step)
            shown, expected_rewards, terminated, _, info = by_hand.step(of_step)
            expected = inputs.see(shown)
            np.testing.assert_allclose(rewards, expected_rewards, rtol=1e-6)
            np.testing.assert_array_equal(dones, terminated)
            assert dones.tolist() == [step == STEPS - 1] * 6
            returns += expected_rewards
        for i, of_one in enumerate(infos):
            last = of_one["terminal_observation"]
            for name, values in expected.items():
                np.testing.assert_array_equal(last[name], values[i])
            np.testing.assert_array_equal(last[HINDSIGHT], hindsight(shown["probabilities"], info)[i])
            assert of_one["episode"]["r"] == pytest.approx(returns[i])
            assert of_one["episode"]["l"] == STEPS
            assert "TimeLimit.truncated" not in of_one


def test_inputs_lie_in_their_space_and_survive_the_next_step() -> None:
    env = adapter()
    first: Any = env.reset()
    kept = {name: values.copy() for name, values in first.items()}
    env.step(np.full(6, 4))
    same(first, kept)
    assert isinstance(env.observation_space.spaces, dict)  # type: ignore[attr-defined]
    for i in range(6):
        assert {name: values[i] for name, values in first.items()} in env.observation_space


def test_stable_baselines3_s_own_wrappers_find_nothing_amiss() -> None:
    """It has no checker of a VecEnv; these refuse what is not finite, and sum the rewards by themselves."""
    env = VecMonitor(VecCheckNan(adapter(), raise_exception=True))
    env.reset()
    for moves in random_moves(STEPS, 6):
        _, _, dones, infos = env.step(moves)
    assert dones.all()
    plain = run(adapter(), random_moves(STEPS, 6))
    for i, info in enumerate(infos):
        assert info["episode"]["r"] == pytest.approx(plain[2][-1][i]["episode"]["r"], abs=1e-5)
        assert info["episode"]["l"] == STEPS


@pytest.mark.slow
def test_workers_decide_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(vector_env, "GROUP", 4)  # the workers are told the sizes of their groups
    moves = random_moves(STEPS + 3, 12)
    inputs, rewards, infos = run(adapter(12, copies=2), moves)
    for workers in (1, 2):
        others = run(adapter(12, copies=2, workers=workers), moves)
        for one, other in zip(inputs, others[0], strict=True):
            same(one, other)
        np.testing.assert_array_equal(rewards, others[1])
        for info, other_info in zip(infos[STEPS - 1], others[2][STEPS - 1], strict=True):
            assert info["episode"] == other_info["episode"]
            same(info["terminal_observation"], other_info["terminal_observation"])


def test_a_batch_does_not_depend_on_those_before() -> None:
    moves = random_moves(3 * STEPS, 6)
    inputs, rewards, _ = run(adapter(), moves)
    late_inputs, late_rewards, _ = run(adapter(first=2), moves[2 * STEPS :])
    for one, other in zip(inputs[2 * STEPS :], late_inputs, strict=True):
        same(one, other)
    np.testing.assert_array_equal(rewards[2 * STEPS :], late_rewards)


def test_groups_seeds_and_batches_differ() -> None:
    assert len({group_seed(*which) for which in np.ndindex(3, 3, 3)}) == 27
    first, other = (adapter(seed=seed).reset() for seed in (0, 1))
    assert isinstance(first, dict)
    assert isinstance(other, dict)
    assert not np.array_equal(first["position"], other["position"])


@pytest.mark.parametrize(("hold", "steps"), [(2, 5), (3, 3), (4, 3), (20, 1)])
def test_a_held_move_is_rewarded_with_the_sum_of_its_frames(hold: int, steps: int) -> None:
    """Of 9 moves, the last step of 2 or of 4 holds its move for one frame only."""
    env, by_hand = adapter(hold=hold), tiny_env(6)
    env.reset()
    by_hand.reset(seed=group_seed(3, 0, 0))
    frames = 0
    for step, moves in enumerate(random_moves(steps, 6)):
        _, rewards, dones, infos = env.step(moves)
        held = min(hold, STEPS - frames)
        expected = sum(by_hand.step(moves)[1] for _ in range(held))
        frames += held
        np.testing.assert_allclose(rewards, expected, rtol=1e-6, atol=1e-7)
        assert dones.all() == (step == steps - 1)
    assert frames == STEPS
    last = infos[0]["terminal_observation"]
    assert last["recognition"][-1] == 1.0  # the observation ratio


def test_a_held_move_shows_every_frame_to_the_running_mean() -> None:
    seen: Any = adapter(hold=3)
    seen.reset()
    moves = random_moves(1, 6)[0]
    after = seen.step(moves)[0]
    by_hand, inputs = tiny_env(6), AgentInputs()
    inputs.see(by_hand.reset(seed=group_seed(3, 0, 0))[0])
    for _ in range(3):
        expected = inputs.see(by_hand.step(moves)[0])
    np.testing.assert_array_equal(after["recognition"], expected["recognition"])


def test_relative_rewards_by_hand() -> None:
    rewards = np.array([1.0, 0.0, 2.0, 5.0, 5.0, -1.0])
    # each less the mean of the two others: 1 - 1, 0 - 1.5, 2 - 0.5; 5 - 2, 5 - 2, -1 - 5
    np.testing.assert_allclose(relative_rewards(rewards, 3), [0, -1.5, 1.5, 3, 3, -6])
    np.testing.assert_allclose(relative_rewards(rewards, 2), [1, -1, -3, 3, 6, -6])
    assert relative_rewards(rewards, 1) is rewards


def test_copies_share_everything_but_the_moves() -> None:
    first: Any = adapter(6, copies=3).reset()
    for values in first.values():
        together = values.reshape(2, 3, -1)
        np.testing.assert_array_equal(together, together[:, :1].repeat(3, axis=1))
    moves = random_moves(STEPS, 6)
    inputs, rewards, infos = run(adapter(6, copies=3), moves)
    assert not np.array_equal(inputs[-2]["position"][0], inputs[-2]["position"][1])
    np.testing.assert_allclose(rewards.reshape(STEPS, 2, 3).sum(axis=2), 0, atol=1e-6)
    by_hand = tiny_env(6, copies=3)
    by_hand.reset(seed=group_seed(3, 0, 0))
    returns = np.zeros(6)
    for of_step, relative in zip(moves, rewards, strict=True):
        reward = by_hand.step(of_step)[1]
        returns += reward
        for i in range(6):
            others = [j for j in range(i // 3 * 3, i // 3 * 3 + 3) if j != i]
            assert relative[i] == pytest.approx(reward[i] - reward[others].mean(), abs=1e-6)
    assert [info["episode"]["r"] for info in infos[-1]] == pytest.approx(returns.tolist())  # not relative


def test_copies_that_move_alike_are_rewarded_nothing() -> None:
    moves = random_moves(STEPS, 2).repeat(3, axis=1)
    np.testing.assert_allclose(run(adapter(6, copies=3), moves)[1], 0, atol=1e-12)


def test_hindsight_by_hand() -> None:
    probabilities = np.array([[0.2, 0.5, 0.3], [0.6, 0.3, 0.1]])
    info = {"label": np.array([1, 2]), "correct": np.array([True, False])}
    expected = [[0, 1, 0, 0.5, 1], [0, 0, 1, 0.1, 0]]
    np.testing.assert_allclose(hindsight(probabilities, info), expected, rtol=1e-6)


@pytest.mark.parametrize("num_envs", [0, -1, 33, 65])
def test_numbers_of_environments_that_make_no_groups(num_envs: int) -> None:
    with pytest.raises(UsageError, match=f"expected 1 to 32, or a multiple of 32, got {num_envs}"):
        adapter(num_envs)


def test_copies_that_do_not_divide_a_group() -> None:
    with pytest.raises(UsageError, match="expected a multiple of 4 copies, got 6"):
        adapter(6, copies=4).reset()


def test_what_there_is_none_of() -> None:
    env = adapter()
    assert env.get_attr("num_envs", [0, 2]) == [6, 6]
    assert env.env_is_wrapped(VecMonitor) == [False] * 6
    assert not env.has_attr("spectators")
    with pytest.raises(UsageError, match="'frame'"):
        env.set_attr("frame", 3)
    with pytest.raises(UsageError, match="'render'"):
        env.env_method("render")


class TwoWords(Exception):
    """An error that does not survive a pipe: it is made of other arguments than it keeps."""

    def __init__(self, one: str, two: str) -> None:
        super().__init__(f"{one} {two}")


def refusing(episodes: int) -> EpisodeVectorEnv:
    if episodes > 1:  # not the one that is asked for the spaces
        raise TwoWords("no", "environments")
    return tiny_env(episodes)


@pytest.mark.slow
def test_an_error_in_a_worker_is_raised_here() -> None:
    env = AgentVecEnv(tiny_maker(broken=True), num_envs=4, seed=0, workers=1)
    for _ in range(2):
        with pytest.raises(EpisodeError, match=r"ValueError: no evidence at \(4, 3\)"):
            env.reset()
    env.close()
    env = adapter(workers=1)
    env.reset()
    with pytest.raises(EpisodeError, match="frame 1: expected 6 whole moves from 0 to 6"):
        env.step(np.full(6, 7))
    env.close()
    env = AgentVecEnv(refusing, num_envs=4, seed=0, workers=1)
    with pytest.raises(EpisodeError, match="TwoWords: no environments"):
        env.reset()
    env.close()


@pytest.mark.slow
def test_a_worker_that_was_killed_is_noticed() -> None:
    env = adapter(workers=1)
    env.reset()
    process: Any = env._shares[0]._process  # type: ignore[union-attr]
    os.kill(process.pid, signal.SIGKILL)
    with pytest.raises(EpisodeError, match="a worker process has ended, with exit code -9"):
        for _ in range(3):
            env.step(np.full(6, 4))
    env.close()
    env.close()


@pytest.mark.slow
def test_workers_end_when_closed() -> None:
    env = adapter(workers=1)
    env.reset()
    process: Any = env._shares[0]._process  # type: ignore[union-attr]
    assert process.is_alive()
    env.close()
    assert process.exitcode == 0


def test_a_group_runs_alone() -> None:
    """A group is told all that it depends on."""
    moves = random_moves(STEPS, 6)
    rewards = run(adapter(), moves)[1]
    group = Group(lambda size: tiny_env(size), GroupSetting(6, (3, 0), first=0, hold=1))
    group.reset()
    for of_step, expected in zip(moves, rewards, strict=True):
        np.testing.assert_allclose(group.step(of_step).rewards, expected, rtol=1e-6)


ORPHAN = """
from tests.helpers.agent_worlds import tiny_maker
from planners.agents.vector_env import AgentVecEnv
import time
if __name__ == "__main__":
    env = AgentVecEnv(tiny_maker(), num_envs=4, seed=0, workers=1)
    env.reset()
    print(env._shares[0]._process.pid, flush=True)
    time.sleep(600)
"""


@pytest.mark.slow
@needs_proc
def test_workers_end_with_their_parent(tmp_path: Path) -> None:
    script = tmp_path / "orphan.py"
    script.write_text(ORPHAN)
    parent = subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, text=True, env=os.environ | {"PYTHONPATH": str(ROOT)}
    )
    assert parent.stdout is not None
    worker = int(parent.stdout.readline())
    assert Path(f"/proc/{worker}").exists()
    parent.kill()
    parent.wait()
    for outlived in still_running([worker]):
        os.kill(outlived, signal.SIGKILL)
        pytest.fail("the worker outlived its parent")
