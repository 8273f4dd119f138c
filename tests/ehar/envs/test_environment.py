"""The Gymnasium environments: checkers, the reward by hand, determinism, and the batch against the loop."""

import warnings
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.env_checker import check_env as check_env_sb3

from ehar.arrays import FloatArray
from ehar.data.scenario import Scenarios, windows
from ehar.envs.controls import GridControls
from ehar.envs.environment import EpisodeEnv, EpisodeVectorEnv, reward
from ehar.envs.observations import Observations, shown_to_agent
from ehar.envs.task import EpisodeTask
from ehar.errors import EpisodeError, UsageError
from ehar.motion import GridMotion
from ehar.planner import Context, Observation, Planner
from ehar.rollout import rollout
from ehar.sensors.perfect import PerfectSensor
from ehar.sensors.registry import make_sensor
from ehar.viewpoint import HOVER, MOVE_NAMES, Workspace
from ehar.world import CROWD, PAPER
from tests.helpers.fakes import CLASS_NAMES, FakeRecogniser, tiny_context, tiny_data, tiny_scenarios

LENGTH = 10


def parts(sensor: str = "perfect", *, persons: int = 1) -> dict[str, Any]:
    scenarios = tiny_scenarios(length=LENGTH, persons=persons)
    return {
        "scenarios": scenarios,
        "recogniser": FakeRecogniser(),
        "sensor": make_sensor(sensor, scenarios.data),
    }


def task(sensor: str = "perfect", *, persons: int = 1, copies: int = 1) -> EpisodeTask:
    return EpisodeTask(**parts(sensor, persons=persons), controls=GridControls(), copies=copies)


@pytest.mark.parametrize("copies", [1, 2])
def test_passers_by_are_of_other_sequences_however_few_are_watched(copies: int) -> None:
    whole = EpisodeTask(**parts(), controls=GridControls(), copies=copies, world=CROWD)
    for seed in range(4):
        whole.begin(copies, np.random.default_rng(seed))
        around, offsets = whole._batch.surroundings, whole.scenarios.data.offsets
        assert around is not None and around.passers is not None
        passing = np.searchsorted(offsets, around.passers.posture, side="right") - 1
        own = whole.scenarios.sequence[np.random.default_rng(seed).integers(0, len(whole.scenarios), size=1)]
        assert passing.shape[0] == copies and (passing != own).all()


@pytest.fixture
def registered() -> Any:
    """Register the environments with the fake recogniser for the time of a test."""
    name = "ehar-test/Grid-v0"
    gym.register(
        id=name,
        entry_point=lambda **chosen: EpisodeEnv(task(**chosen)),
        vector_entry_point=lambda num_envs, **chosen: EpisodeVectorEnv(num_envs, task(**chosen)),
    )
    yield name
    del gym.registry[name]


@pytest.mark.parametrize(
    ("now", "before", "first", "expected"),
    [
        (True, True, True, 0.1),
        (False, False, True, 0.0),
        (True, False, False, 1.1),
        (True, True, False, 0.1),
        (False, True, False, -1.0),
        (False, False, False, 0.0),
    ],
)
def test_the_reward_of_equation_1_by_hand(now: bool, before: bool, first: bool, expected: float) -> None:
    assert reward(np.array([now]), np.array([before]), 10, first=first)[0] == pytest.approx(expected)


def test_the_return_is_the_paper_s_sum() -> None:
    """The improvements telescope: accuracy / L over all frames, plus the last frame's less the first's."""
    env = EpisodeEnv(task())
    for seed in range(10):
        _, info = env.reset(seed=seed)
        correct, total = [info["correct"]], 0.0
        for _ in range(LENGTH - 1):
            _, step_reward, _, _, info = env.step(env.action_space.sample())
            correct.append(info["correct"])
            total += step_reward
        assert total == pytest.approx(np.mean(correct) + float(correct[-1]) - float(correct[0]))


@pytest.mark.parametrize("sensor", ["perfect", "estimator"])
def test_gymnasium_s_and_stable_baselines_checkers(sensor: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of embeddings without bounds, and joints that are no image
        check_env(EpisodeEnv(task(sensor, persons=2)))
        check_env_sb3(EpisodeEnv(task(sensor, persons=2)))


def test_an_episode_has_l_frames_and_then_terminates() -> None:
    env = EpisodeEnv(task())
    with pytest.raises(EpisodeError, match="expected a reset"):
        env.step(np.int64(HOVER))
    observation, _ = env.reset(seed=0)
    assert observation["ratio"][0] == pytest.approx(1 / LENGTH)
    for frame in range(2, LENGTH + 1):
        observation, _, terminated, truncated, _ = env.step(np.int64(HOVER))
        assert observation["ratio"][0] == pytest.approx(frame / LENGTH)
        assert (terminated, truncated) == (frame == LENGTH, False)
    with pytest.raises(EpisodeError, match=r"step after frame 10 of 10"):
        env.step(np.int64(HOVER))
    assert env.reset()[0]["ratio"][0] == pytest.approx(1 / LENGTH)


class Stays(Planner):
    """Stays, and keeps what an agent would be shown."""

    name = "stays"

    def reset(self, context: Context) -> None:
        self.context = context
        self.shown: list[Observations] = []

    def act(self, observation: Observation) -> FloatArray:
        self.shown.append(shown_to_agent(observation, self.context))
        return observation.viewpoint


@pytest.mark.parametrize("sensor", ["perfect", "estimator"])
def test_an_agent_is_shown_the_frame_that_a_planner_is(sensor: str) -> None:
    whole = task(sensor, persons=2)
    trained = [whole.begin(3, np.random.default_rng(0))]
    batch = whole._batch
    trained += [whole.step(np.full(3, HOVER))[0] for _ in range(LENGTH - 1)]
    stays = Stays()
    rollout(stays, batch, FakeRecogniser(), whole.sensor, GridMotion(), tiny_context(episodes=3, length=LENGTH))
    assert len(stays.shown) == LENGTH - 1
    for frame, shown in enumerate(stays.shown):
        assert shown.keys() == trained[frame].keys()
        for name, values in shown.items():
            np.testing.assert_allclose(trained[frame][name], values, atol=1e-6, err_msg=f"{name} in frame {frame}")


def test_actions_are_the_paper_s_moves() -> None:
    env = EpisodeEnv(task())
    change = {"distance": 0, "polar": 3}
    for move, name in enumerate(MOVE_NAMES):
        for seed in range(5):
            before, _ = env.reset(seed=seed)
            after = env.step(np.int64(move))[0]
            difference = after["viewpoint"] - before["viewpoint"]
            turn = np.arctan2(*after["viewpoint"][1:3]) - np.arctan2(*before["viewpoint"][1:3])
            turn = (turn + np.pi) % (2 * np.pi) - np.pi
            axis, sign = name[:-1], 1 if name.endswith("+") else -1
            size = {"distance": 0.1 / 10, "polar": 3.6 / 90}.get(axis, 0.0)
            for other, column in change.items():
                step = sign * size if other == axis else 0.0
                stayed_at_bound = difference[column] == 0 and before["viewpoint"][column] in (0, 1)
                assert difference[column] == pytest.approx(step, abs=1e-6) or stayed_at_bound
            assert turn == pytest.approx(sign * np.radians(3.6) if axis == "azimuth" else 0.0, abs=1e-5)


@pytest.mark.parametrize("action", [np.int64(-1), np.int64(7), np.float64(1.5), np.float64(3.0), np.float64(np.nan)])
def test_a_move_that_is_none_of_the_seven(action: np.number[Any]) -> None:
    env = EpisodeEnv(task())
    env.reset(seed=0)
    with pytest.raises(EpisodeError, match=rf"frame 1: expected 1 whole moves from 0 to 6, got \[{action}\]"):
        env.step(action)  # type: ignore[arg-type]


@pytest.mark.parametrize("sensor", ["perfect", "estimator"])
def test_a_batch_of_one_is_the_single_environment(sensor: str) -> None:
    single, batched = EpisodeEnv(task(sensor)), EpisodeVectorEnv(1, task(sensor))
    (observation, info), (observations, infos) = single.reset(seed=5), batched.reset(seed=5)
    rng = np.random.default_rng(0)
    for _ in range(LENGTH - 1):
        for key, value in observation.items():
            np.testing.assert_array_equal(value, observations[key][0])
        assert info["correct"] == infos["correct"][0]
        action = rng.integers(0, 7, size=1)
        observation, one, terminated, _, info = single.step(action[0])
        observations, rewards, terminations, _, infos = batched.step(action)
        assert (one, terminated) == (rewards[0], terminations[0])


def test_the_batch_begins_anew_with_the_step_after_the_last() -> None:
    env = EpisodeVectorEnv(8, task())
    assert env.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
    env.reset(seed=0)
    for episode in range(3):
        for frame in range(2, LENGTH + 1):
            observations, rewards, terminated, truncated, infos = env.step(env.action_space.sample())
            assert observations in env.observation_space
            assert rewards.shape == (8,)
            assert (terminated == (frame == LENGTH)).all(), f"episode {episode}"
            assert not truncated.any()
            assert infos["_correct"].all()
        observations, rewards, terminated, truncated, _ = env.step(np.full(8, -1))  # these actions are ignored
        np.testing.assert_allclose(observations["ratio"], 1 / LENGTH)
        assert not rewards.any()
        assert not terminated.any()


def test_the_same_seed_gives_the_same_episodes_and_another_does_not() -> None:
    env = EpisodeVectorEnv(4, task("estimator"))
    first, again, other = (env.reset(seed=seed)[0] for seed in (3, 3, 4))
    for key in first:
        np.testing.assert_array_equal(first[key], again[key])
    assert not np.array_equal(first["viewpoint"], other["viewpoint"])
    assert not np.array_equal(env.reset()[0]["viewpoint"], other["viewpoint"])


def test_by_name_single_and_batched(registered: str) -> None:
    single = gym.make(registered, sensor="estimator")
    assert single.action_space == gym.spaces.Discrete(7)
    assert single.reset(seed=0)[0] in single.observation_space
    batched = gym.make_vec(registered, num_envs=8, vectorization_mode="vector_entry_point")
    assert isinstance(batched.unwrapped, EpisodeVectorEnv)
    observations, _ = batched.reset(seed=0)
    assert observations in batched.observation_space
    assert observations["probabilities"].shape == (8, len(CLASS_NAMES))


def test_a_batch_costs_one_call_of_the_recogniser_a_step() -> None:
    chosen = parts()
    env = EpisodeVectorEnv(16, EpisodeTask(**chosen, controls=GridControls()))
    env.reset(seed=0)
    for _ in range(2 * LENGTH - 1):
        env.step(env.action_space.sample())
    assert chosen["recogniser"].frames_recognised == 16 * 2 * LENGTH


def test_a_small_workspace_bounds_starts_and_moves() -> None:
    workspace = Workspace(
        distance_max=7.0, polar_min=14 * PAPER.workspace.angle_step, polar_max=14 * PAPER.workspace.angle_step
    )
    env = EpisodeEnv(
        EpisodeTask(**parts(), controls=GridControls(world=replace(PAPER, workspace=workspace, start_cells=None)))
    )
    for seed in range(5):
        env.reset(seed=seed)
        for _ in range(LENGTH - 1):
            observation = env.step(env.action_space.sample())[0]
            assert observation in env.observation_space
            assert env.episodes.workspace.contains(env.episodes.viewpoint).all()


def test_an_agent_that_writes_into_what_it_is_shown_changes_nothing() -> None:
    returns = []
    for writes in (False, True):
        env = EpisodeVectorEnv(4, task("estimator"))
        observations, info = env.reset(seed=0)
        total, moves = np.zeros(4), np.random.default_rng(0)
        for _ in range(LENGTH - 1):
            if writes:
                for array in (*observations.values(), *info.values()):
                    array[...] = 0  # the true labels, and what is recognised, among them
            observations, rewards, _, _, info = env.step(moves.integers(0, 7, size=4))
            total += rewards
        returns.append(total)
        with pytest.raises(ValueError, match="read-only"):
            env.episodes.viewpoint[:] = 5.0
    np.testing.assert_array_equal(*returns)


def test_scenarios_that_make_no_episode() -> None:
    data = tiny_data()
    rest = {"recogniser": FakeRecogniser(), "sensor": PerfectSensor()}
    with pytest.raises(UsageError, match="tiny: expected at least one scenario of 50 frames, got none"):
        EpisodeEnv(EpisodeTask(scenarios=windows(data, np.arange(3), 50, 1), **rest, controls=GridControls()))
    with pytest.raises(UsageError, match="tiny: expected episodes of at least 2 frames, got 1"):
        EpisodeEnv(EpisodeTask(scenarios=windows(data, np.arange(3), 1, 1), **rest, controls=GridControls()))


def test_a_recogniser_of_other_classes() -> None:
    recogniser = FakeRecogniser()
    recogniser.class_names = ("jump",)
    scenarios: Scenarios = tiny_scenarios()
    with pytest.raises(UsageError, match="tiny: expected a recogniser of its 3 classes"):
        EpisodeEnv(
            EpisodeTask(scenarios=scenarios, recogniser=recogniser, sensor=PerfectSensor(), controls=GridControls())
        )


@pytest.mark.parametrize("sensor", ["perfect", "estimator"])
def test_copies_differ_in_the_moves_only(sensor: str) -> None:
    """The same scenario, start and noise: what moves alike sees alike, and what does not, does not."""
    episodes = task(sensor, persons=2, copies=3)
    env = EpisodeVectorEnv(6, episodes)
    observations, info = env.reset(seed=0)
    moves = np.random.default_rng(0).integers(0, 7, (LENGTH - 1, 6))
    moves[:, 1] = moves[:, 0]  # the second moves as the first, the third as it likes
    for step in (None, *moves):
        if step is not None:
            observations, rewards, _, _, info = env.step(step)
            assert rewards[0] == rewards[1]
        assert (info["label"].reshape(2, 3) == info["label"][::3, None]).all()
        for values in observations.values():
            np.testing.assert_array_equal(values[0], values[1])
            if step is None:
                np.testing.assert_array_equal(values.reshape(2, 3, -1), values[::3].reshape(2, 1, -1).repeat(3, axis=1))
    assert not np.array_equal(observations["viewpoint"][0], observations["viewpoint"][2])
    assert not np.array_equal(observations["joints"][0], observations["joints"][3])


def test_an_episode_and_its_copies_are_drawn_as_one_would_be() -> None:
    """With the same seed, B episodes are those that 3 B with three copies are copies of."""
    one = EpisodeVectorEnv(2, task("estimator"))
    three = EpisodeVectorEnv(6, task("estimator", copies=3))
    singles, copied = one.reset(seed=4)[0], three.reset(seed=4)[0]
    for move in (4, 2, 0):
        for key, values in singles.items():
            np.testing.assert_array_equal(copied[key], values.repeat(3, axis=0))
        singles, copied = one.step(np.full(2, move))[0], three.step(np.full(6, move))[0]


@pytest.mark.parametrize("episodes", [1, 2, 4])
def test_episodes_that_copies_do_not_divide(episodes: int) -> None:
    env = EpisodeVectorEnv(episodes, task(copies=3))
    with pytest.raises(UsageError, match=f"episodes: expected a multiple of 3 copies, got {episodes}"):
        env.reset(seed=0)
