"""The environment of streams: the reward of each activity by hand, the checkers, and an end that is no end."""

import warnings
from typing import Any

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as check_env_sb3

from ehar.data.scenario import windows
from ehar.envs.controls import GridControls
from ehar.envs.environment import EpisodeEnv, EpisodeVectorEnv
from ehar.envs.task import EpisodeTask, activity_lengths
from ehar.onsets import Onset
from ehar.sensors.registry import make_sensor
from ehar.viewpoint import HOVER
from tests.helpers.streams import StreamRecogniser, raising_streams

LENGTH = 35  # frames: three activities of a second, and what is between them


def task(onset: Onset = "unknown") -> EpisodeTask:
    data = raising_streams()
    return EpisodeTask(
        scenarios=windows(data, np.arange(3), LENGTH, 1),
        recogniser=StreamRecogniser(),
        sensor=make_sensor("estimator", data),
        controls=GridControls(),
        onset=onset,
    )


def test_the_frames_of_each_activity_by_hand() -> None:
    frames, onset = activity_lengths(np.array([[3, 3, 0, 0, 0, 1], [2, 2, 2, 2, 2, 2]]))
    assert frames.tolist() == [[2, 2, 3, 3, 3, 1], [6] * 6]
    assert onset.tolist() == [[True, False, True, False, False, True], [True, *[False] * 5]]


def equation_1(correct: list[bool]) -> float:
    """Return what a clip is rewarded with: the mean accuracy, and the last frame's less the first's."""
    return float(np.mean(correct)) + float(correct[-1]) - float(correct[0])


def test_the_return_is_the_sum_of_what_each_activity_is_rewarded_with() -> None:
    env = EpisodeEnv(task())
    returns = []
    for seed in range(6):
        _, info = env.reset(seed=seed)
        told, total = [info], 0.0
        for _ in range(LENGTH - 1):
            _, reward, _, _, info = env.step(env.action_space.sample())
            told.append(info)
            total += reward
        expected, activity = 0.0, []
        for one, after in zip(told, [*told[1:], {"label": None}], strict=True):
            activity.append(bool(one["correct"]))
            if after["label"] != one["label"]:
                expected += equation_1(activity) if one["label"] < 3 else 0.0
                activity = []
        assert total == pytest.approx(expected)
        returns.append(total)
    assert max(returns) > 0.5


@pytest.mark.parametrize("checked", [check_env, check_env_sb3])
def test_gymnasium_s_and_stable_baselines_checkers(checked: Any) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of embeddings without bounds, and joints that are no image
        checked(EpisodeEnv(task()))


def test_a_recogniser_that_is_told_of_onsets_forgets_what_was_before() -> None:
    said = {}
    for onset in ("unknown", "known"):
        env = EpisodeEnv(task(onset))
        observation, info = env.reset(seed=1)
        told = [(info["label"], observation["probabilities"])]
        for _ in range(LENGTH - 1):
            observation, _, _, _, info = env.step(HOVER)
            told.append((info["label"], observation["probabilities"]))
        said[onset] = told
    labels = [int(label) for label, _ in said["known"]]
    differs = [
        not np.array_equal(one, other) for (_, one), (_, other) in zip(said["unknown"], said["known"], strict=True)
    ]
    begun = [frame for frame in range(1, LENGTH) if labels[frame] != labels[frame - 1] and labels[frame] < 3]
    assert begun and not any(differs[: begun[0]]) and all(differs[begun[0] : begun[0] + 3])


def test_an_episode_is_truncated_and_time_goes_on() -> None:
    env = EpisodeEnv(task())
    observation, info = env.reset(seed=0)
    assert "ratio" not in observation
    assert observation["probabilities"].shape == (4,)  # no activity among them
    for frame in range(1, LENGTH):
        observation, _, terminated, truncated, info = env.step(np.int64(HOVER))
        assert observation["time"][0] == pytest.approx(frame / 10)
        assert (terminated, truncated) == (False, frame == LENGTH - 1)
        assert 0 <= info["label"] <= 3


def test_a_batch_is_what_single_episodes_are() -> None:
    env = EpisodeVectorEnv(5, task())
    env.reset(seed=0)
    for frame in range(1, LENGTH + 2):
        observations, rewards, terminated, truncated, info = env.step(np.full(5, HOVER))
        assert observations in env.observation_space
        assert not terminated.any()
        assert (truncated == (frame == LENGTH - 1)).all()
        assert info["label"].shape == rewards.shape == (5,)
