"""Gymnasium environments of the task: `GridEnv`, and `GridVectorEnv` for a batch of episodes in lockstep."""

from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.errors import EpisodeError, UsageError
from ehar.recogniser import Recogniser
from ehar.rollout import Batch
from ehar.scenario import Scenarios
from ehar.sensor import Sensed, Sensor, draw_noise
from ehar.viewpoint import AZIMUTH, DISTANCE, MOVES, POLAR, Workspace, apply_moves, sample_starts

Observations = dict[str, FloatArray]


def reward(correct_now: BoolArray, correct_before: BoolArray, length: int, *, first: bool) -> FloatArray:
    """Return the reward of one frame, Eq. 1, (B,).

    Args:
        correct_now: whether the label is recognised after this frame, (B,).
        correct_before: and after the frame before, (B,); of no effect on the first frame.
        length: L, frames in an episode.
        first: whether this is the first frame, t = 1 in Eq. 1.
    """
    accuracy = correct_now.astype(np.float64)
    improvement = 0.0 if first else accuracy - correct_before
    total: FloatArray = accuracy / length + improvement
    return total


class GridEpisodes:
    """The task behind both environments: B episodes in lockstep, moved by the paper's 7 moves.

    An episode of L frames is a reset, which shows frame 1 from the start viewpoint, and L - 1 steps. Eq. 1
    rewards frame 1 too, where nothing has been decided yet: its reward comes with that of the first step, so
    that the undiscounted return is the paper's sum over t = 1..L.

    An observation holds, all in float32, each with a leading B:

    - `joints` (P, J, 2): the sensed joints from the image centre, in half image widths
    - `confidence` (P, J), in [0, 1]
    - `viewpoint` (4,): distance and polar angle scaled to [0, 1] over the workspace, first and last; between
      them sine and cosine of the azimuth
    - `probabilities` (K,): the recogniser's, of all classes
    - `embedding` (D,): the recogniser's
    - `ratio` (1,): the share of the episode that has been observed, in (0, 1]

    Args:
        scenarios: what episodes are drawn from, uniformly.
        recogniser: sees every frame.
        sensor: what the recogniser sees.
        workspace: where the camera may be; the paper's by default.

    Raises:
        UsageError: there is no scenario, episodes have no step, or the recogniser knows other classes.
    """

    def __init__(
        self, *, scenarios: Scenarios, recogniser: Recogniser, sensor: Sensor, workspace: Workspace | None = None
    ) -> None:
        """Create the task; nothing is drawn before `begin`."""
        data = scenarios.data
        if len(scenarios) == 0:
            raise UsageError(f"{data.name}: expected at least one scenario of {scenarios.length} frames, got none")
        if scenarios.length < 2:
            raise UsageError(f"{data.name}: expected episodes of at least 2 frames, got {scenarios.length}")
        if recogniser.class_names != data.class_names:
            raise UsageError(f"{data.name}: expected a recogniser of its {len(data.class_names)} classes")
        self.scenarios = scenarios
        self.recogniser = recogniser
        self.sensor = sensor
        self.workspace = workspace or Workspace()
        self.frame = -1  # no episode has begun

    @property
    def observation_space(self) -> spaces.Dict:
        """The space of one episode's observations."""
        data = self.scenarios.data
        persons, joints = data.persons, len(data.skeleton.joint_names)
        return spaces.Dict(
            {
                "joints": spaces.Box(-np.inf, np.inf, (persons, joints, 2), np.float32),
                "confidence": spaces.Box(0, 1, (persons, joints), np.float32),
                "viewpoint": spaces.Box(np.array([0, -1, -1, 0], dtype=np.float32), np.ones(4, dtype=np.float32)),
                "probabilities": spaces.Box(0, 1, (len(data.class_names),), np.float32),
                "embedding": spaces.Box(-np.inf, np.inf, (self.recogniser.embedding_size,), np.float32),
                "ratio": spaces.Box(0, 1, (1,), np.float32),
            }
        )

    @property
    def action_space(self) -> spaces.Discrete:
        """The 7 moves, numbered as in `ehar.viewpoint.MOVES`."""
        return spaces.Discrete(len(MOVES))

    @property
    def over(self) -> bool:
        """Whether the last frame has been seen, or no episode has begun."""
        return self.frame in (-1, self.scenarios.length - 1)

    def begin(self, episodes: int, rng: np.random.Generator) -> Observations:
        """Draw scenarios, starts and noise of `episodes` new episodes, and see frame 1."""
        data = self.scenarios.data
        indices = rng.integers(0, len(self.scenarios), size=episodes)
        leading = (episodes, self.scenarios.length)
        self._batch = Batch(
            positions=self.scenarios.positions(indices),
            labels=self.scenarios.labels[indices],
            starts=self.workspace.clip(sample_starts(rng, episodes)),
            noise=draw_noise(rng, leading, data.persons, len(data.skeleton.joint_names)),
            names=tuple(data.sequence_names[sequence] for sequence in self.scenarios.sequence[indices]),
        )
        self.frame = 0
        self.viewpoint = self._batch.starts
        self._state = self.recogniser.start(episodes)
        return self._see()

    def step(self, moves: IntArray) -> tuple[Observations, FloatArray]:
        """Make moves (B,) and see the next frame; return what is seen, and the rewards (B,).

        Raises:
            EpisodeError: the episodes are over, or a move is not one of the 7.
        """
        if self.over:
            raise EpisodeError(f"step after frame {self.frame + 1} of {self.scenarios.length}: expected a reset")
        if moves.shape != self._batch.labels.shape or ((moves < 0) | (moves >= len(MOVES))).any():
            raise EpisodeError(
                f"frame {self.frame + 1}: expected {len(self._batch.labels)} moves from 0 to {len(MOVES) - 1}, "
                f"got {moves.tolist()}"
            )
        before, length = self.correct, self.scenarios.length
        self.viewpoint = apply_moves(self.viewpoint, moves, self.workspace)
        self.frame += 1
        observations = self._see()
        rewards = reward(self.correct, before, length, first=False)
        if self.frame == 1:
            rewards = rewards + reward(before, before, length, first=True)
        return observations, rewards

    @property
    def info(self) -> dict[str, Any]:
        """For analysis, not for the agent: the true labels (B,), and whether they are recognised (B,)."""
        return {"label": self._batch.labels, "correct": self.correct}

    def _see(self) -> Observations:
        """Sense and recognise the present frame."""
        noise = self._batch.noise.frame(self.frame)
        sensed = self.sensor.sense(self._batch.positions[:, self.frame], self.viewpoint, noise)
        recognition, self._state = self.recogniser.step(self._state, sensed, self.viewpoint)
        self.correct = np.argmax(recognition.log_probs, axis=1) == self._batch.labels
        return {
            "joints": self._scaled_joints(sensed),
            "confidence": sensed.confidence.astype(np.float32),
            "viewpoint": self._scaled_viewpoint(),
            "probabilities": np.clip(np.exp(recognition.log_probs), 0, 1).astype(np.float32),
            "embedding": recognition.embedding.astype(np.float32),
            "ratio": np.full((len(self.correct), 1), (self.frame + 1) / self.scenarios.length, dtype=np.float32),
        }

    def _scaled_joints(self, sensed: Sensed) -> FloatArray:
        camera = self.sensor.camera
        centre = np.array([camera.width / 2, camera.height / 2])
        scaled: FloatArray = (sensed.joints_2d - centre) / (camera.width / 2)
        return scaled.astype(np.float32)

    def _scaled_viewpoint(self) -> FloatArray:
        workspace, azimuth = self.workspace, self.viewpoint[:, AZIMUTH]
        distance = (self.viewpoint[:, DISTANCE] - workspace.distance_min) / max(
            workspace.distance_max - workspace.distance_min, 1e-9
        )
        polar = (self.viewpoint[:, POLAR] - workspace.polar_min) / max(workspace.polar_max - workspace.polar_min, 1e-9)
        scaled = np.stack([np.clip(distance, 0, 1), np.sin(azimuth), np.cos(azimuth), np.clip(polar, 0, 1)], axis=1)
        return scaled.astype(np.float32)


class GridEnv(gym.Env[dict[str, Any], np.int64]):
    """One episode at a time of the task that `GridEpisodes` describes.

    The last frame terminates an episode, it does not truncate it: the task ends there by its definition, and
    `ratio` tells the agent when, so there is no value beyond to bootstrap from.

    Args:
        scenarios: what episodes are drawn from, uniformly.
        recogniser: sees every frame.
        sensor: what the recogniser sees.
        workspace: where the camera may be; the paper's by default.
    """

    metadata = {"render_modes": []}  # noqa: RUF012  as gym.Env declares it

    def __init__(
        self, *, scenarios: Scenarios, recogniser: Recogniser, sensor: Sensor, workspace: Workspace | None = None
    ) -> None:
        """Create the environment."""
        self.episodes = GridEpisodes(scenarios=scenarios, recogniser=recogniser, sensor=sensor, workspace=workspace)
        self.observation_space = self.episodes.observation_space
        self.action_space = self.episodes.action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin an episode and return frame 1; there are no options."""
        super().reset(seed=seed)
        observations = self.episodes.begin(1, self.np_random)
        return _only(observations), _only(self.episodes.info)

    def step(self, action: np.int64) -> tuple[Observations, float, bool, bool, dict[str, Any]]:
        """Make one of the 7 moves and see the next frame."""
        observations, rewards = self.episodes.step(np.array([action]))
        return _only(observations), float(rewards[0]), self.episodes.over, False, _only(self.episodes.info)


class GridVectorEnv(gym.vector.VectorEnv[Observations, IntArray, npt.NDArray[Any]]):
    """A batch of episodes in lockstep: one call of the sensor and of the recogniser a step.

    All episodes have L frames, so all end with the same step. Autoreset is by the next step, Gymnasium's
    default: the step after the last ignores its actions, begins new episodes and rewards 0.

    Args:
        num_envs: episodes at a time, B.
        scenarios: what episodes are drawn from, uniformly.
        recogniser: sees every frame.
        sensor: what the recogniser sees.
        workspace: where the camera may be; the paper's by default.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012  as VectorEnv's

    def __init__(
        self,
        *,
        num_envs: int,
        scenarios: Scenarios,
        recogniser: Recogniser,
        sensor: Sensor,
        workspace: Workspace | None = None,
    ) -> None:
        """Create the environments."""
        self.num_envs = num_envs
        self.episodes = GridEpisodes(scenarios=scenarios, recogniser=recogniser, sensor=sensor, workspace=workspace)
        self.single_observation_space = self.episodes.observation_space
        self.single_action_space = self.episodes.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin B episodes and return frame 1 of each; there are no options."""
        super().reset(seed=seed)
        return self.episodes.begin(self.num_envs, self.np_random), self._masked_info()

    def step(self, actions: IntArray) -> tuple[Observations, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Make moves (B,) and see the next frame of each episode."""
        rewards: FloatArray = np.zeros(self.num_envs)
        if self.episodes.frame == self.episodes.scenarios.length - 1:
            observations = self.episodes.begin(self.num_envs, self.np_random)
        else:
            observations, rewards = self.episodes.step(np.asarray(actions))
        terminated = np.full(self.num_envs, self.episodes.over)
        return observations, rewards, terminated, np.zeros(self.num_envs, dtype=bool), self._masked_info()

    def _masked_info(self) -> dict[str, Any]:
        """Return the info with the mask that Gymnasium keeps beside each key."""
        info = self.episodes.info
        return info | {f"_{key}": np.ones(self.num_envs, dtype=bool) for key in info}


def _only(batched: dict[str, Any]) -> dict[str, Any]:
    """Return the first entry of every array."""
    return {key: array[0] for key, array in batched.items()}
