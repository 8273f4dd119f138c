"""The task behind the Gymnasium environments: B episodes in lockstep, and the reward of the paper."""

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from ehar.arrays import BoolArray, FloatArray, IntArray, read_only
from ehar.batch import Batch
from ehar.data.scenario import Scenarios, localised
from ehar.data.streams.scenario import StreamScenarios
from ehar.data.surroundings import surroundings_of
from ehar.envs.controls import Controls
from ehar.envs.observations import Observations as Observations
from ehar.envs.observations import shown
from ehar.errors import EpisodeError, UsageError
from ehar.motion import CarriedMotion, keep_clear
from ehar.obstacles.free_ways import WAYS
from ehar.obstacles.surroundings import Surroundings
from ehar.onsets import Onset, ToldOnsets, begins
from ehar.plugins.blame import blamed
from ehar.recogniser import Recogniser
from ehar.rollout import check_recognition
from ehar.sensors.sensor import Sensor, SensorNoise, draw_noise
from ehar.world import PAPER, World


def reward(
    correct_now: BoolArray, correct_before: BoolArray, length: int | IntArray, *, first: bool | BoolArray
) -> FloatArray:
    """Return the reward of one frame, Eq. 1, (B,).

    Args:
        correct_now: whether the label is recognised after this frame, (B,).
        correct_before: whether it was recognised after the frame before, (B,); not used on the first frame.
        length: L, frames in an episode; in a stream those of the activity, (B,).
        first: whether this is the first frame, t = 1 in Eq. 1; in a stream that of the activity, (B,).
    """
    accuracy = correct_now.astype(np.float64)
    improvement = np.where(first, 0.0, accuracy - correct_before)
    total: FloatArray = accuracy / length + improvement
    return total


def activity_lengths(labels: IntArray) -> tuple[IntArray, BoolArray]:
    """Return how many frames the activity of each frame has, and whether it begins there, both (B, L).

    Args:
        labels: (B, L), the class of each frame. Frames of one class in a row are one activity.
    """
    onset: BoolArray = np.ones(labels.shape, dtype=bool)
    onset[:, 1:] = labels[:, 1:] != labels[:, :-1]
    activity = np.cumsum(onset.ravel()) - 1
    return np.bincount(activity)[activity].reshape(labels.shape), onset


class EpisodeTask:
    """B episodes in lockstep, of clips or of streams; an agent moves their cameras by its controls.

    An episode of L frames is a reset, which shows frame 1 from the start viewpoint, and L - 1 steps. Eq. 1 also rewards
    frame 1, before the agent has decided anything. That reward is added to the first step's, so the undiscounted return
    is the paper's sum over t = 1..L.

    In a stream, each activity is rewarded as a clip is: L is the number of its frames, and its first frame, t = 1, is
    no improvement. Frames that show no activity are worth 0. So the return is the sum of what Eq. 1 gives each
    activity.

    An observation holds these float32 arrays, each with a leading B:

    - `joints` (P, J, 2): the sensed joints from the image centre, in half image widths
    - `confidence` (P, J), in [0, 1]
    - `viewpoint` (4,): distance and polar angle scaled to [0, 1] over the workspace, first and last; between
      them sine and cosine of the azimuth
    - `probabilities` (K,) of all classes, from the recogniser
    - `embedding` (D,), from the recogniser
    - `ratio` (1,): the share of the episode that has been observed, in (0, 1]; in a stream, whose end nobody knows,
      there is `time` (1,) instead: seconds since its first frame
    - `distances` (6,), in worlds where something stands: how far the camera may go each way, in the order of the moves,
      before it is too near to an obstacle, from 0 to 1 over 4 m
    - the arrays that the controls add

    Args:
        scenarios: the scenarios that episodes are drawn from, uniformly.
        recogniser: sees every frame.
        sensor: gives the recogniser its joints.
        controls: define the actions and the workspace.
        world: the world whose starts are drawn, and in which people are localised; its workspace should be that of
            the controls.
        copies: number of successive episodes with the same scenario, start and noise; only the agent's actions differ.
        onset: whether the recogniser is told when an activity of a stream begins.

    Raises:
        UsageError: there is no scenario, episodes have no step, or the recogniser knows other classes.
    """

    def __init__(
        self,
        *,
        scenarios: Scenarios | StreamScenarios,
        recogniser: Recogniser,
        sensor: Sensor,
        controls: Controls,
        world: World = PAPER,
        copies: int = 1,
        onset: Onset = "unknown",
    ) -> None:
        """Create the task; nothing is drawn before `begin`."""
        data = scenarios.data
        if len(scenarios) == 0:
            raise UsageError(f"{data.name}: expected at least one scenario of {scenarios.length} frames, got none")
        if scenarios.length < 2:
            raise UsageError(f"{data.name}: expected episodes of at least 2 frames, got {scenarios.length}")
        if tuple(recogniser.class_names) != data.recognised_names:
            raise UsageError(f"{data.name}: expected a recogniser of its {len(data.recognised_names)} classes")
        self.scenarios = localised(scenarios, world)
        self.recogniser = recogniser
        self.onset = onset
        self.sensor = sensor
        self.controls = controls
        self.world = world
        self.copies = copies
        self.workspace = controls.motion.workspace
        self.frame = -1  # no episode has begun

    @property
    def in_streams(self) -> bool:
        """Whether episodes are parts of streams, which go on after them."""
        return isinstance(self.scenarios, StreamScenarios)

    @property
    def observation_space(self) -> spaces.Dict:
        """The space of one episode's observations."""
        data = self.scenarios.data
        persons, joints = data.persons, len(data.skeleton.joint_names)
        when = ("time", np.inf) if self.in_streams else ("ratio", 1)
        return spaces.Dict(
            {
                "joints": spaces.Box(-np.inf, np.inf, (persons, joints, 2), np.float32),
                "confidence": spaces.Box(0, 1, (persons, joints), np.float32),
                "viewpoint": spaces.Box(np.array([0, -1, -1, 0], dtype=np.float32), np.ones(4, dtype=np.float32)),
                "probabilities": spaces.Box(0, 1, (len(data.recognised_names),), np.float32),
                "embedding": spaces.Box(-np.inf, np.inf, (self.recogniser.embedding_size,), np.float32),
                when[0]: spaces.Box(0, when[1], (1,), np.float32),
                **({"distances": spaces.Box(0, 1, (WAYS,), np.float32)} if self.world.obstacles else {}),
                **self.controls.observation_spaces,
            }
        )

    @property
    def over(self) -> bool:
        """Whether the last frame has been seen, or no episode has begun."""
        return self.frame in (-1, self.scenarios.length - 1)

    def begin(self, episodes: int, rng: np.random.Generator) -> Observations:
        """Draw scenarios, starts and noise of `episodes` new episodes, and see frame 1.

        Raises:
            UsageError: `episodes` is not a multiple of `copies`.
        """
        if episodes % self.copies:
            raise UsageError(f"episodes: expected a multiple of {self.copies} copies, got {episodes}")
        data, drawn = self.scenarios.data, episodes // self.copies
        indices = rng.integers(0, len(self.scenarios), size=drawn).repeat(self.copies)
        # The labels of all windows of streams would fill the memory, so those that are not drawn are left out first.
        scenarios = replace(
            self.scenarios, sequence=self.scenarios.sequence[indices], first=self.scenarios.first[indices]
        )
        leading = (drawn, self.scenarios.length)
        noise = draw_noise(rng, leading, data.persons, len(data.skeleton.joint_names))
        self._batch = Batch.of(
            scenarios,
            np.arange(episodes),
            starts=self.workspace.clip(self.world.sample_starts(rng, drawn).repeat(self.copies, axis=0)),
            noise=SensorNoise(*(draws.repeat(self.copies, axis=0) for draws in noise)),
            surroundings=self._surroundings(indices, rng),
        )
        self._frames_of_activity, self._onset = activity_lengths(self._batch.frame_labels)
        self.frame = 0
        self.viewpoint = read_only(self._batch.starts)
        keep_clear(self.controls.motion, self._batch.surroundings)
        if isinstance(self.controls.motion, CarriedMotion):
            self.controls.motion.centre = self._batch.centre
        self.controls.motion.reset(self.viewpoint, 1 / data.fps)
        with blamed(self.recogniser, f"recogniser {type(self.recogniser).__name__}, start"):
            self._watching: Recogniser = self.recogniser
            if self.onset == "known":
                none = len(data.class_names)
                self._watching = ToldOnsets(self.recogniser, begins(self._batch.frame_labels, none))
            self._state = self._watching.start(episodes)
        return self._see()

    def step(self, actions: npt.NDArray[Any]) -> tuple[Observations, FloatArray]:
        """Carry out actions (B, ...) and see the next frame; return the observations and the rewards (B,).

        Raises:
            EpisodeError: the episodes are over, or an action is not in the action space.
        """
        if self.over:
            raise EpisodeError(f"step after frame {self.frame + 1} of {self.scenarios.length}: expected a reset")
        targets = self.controls.targets(actions, self.viewpoint, f"frame {self.frame + 1}")
        before = self.correct
        self.viewpoint = read_only(self.controls.motion.advance(targets))
        self.frame += 1
        observations = self._see()
        rewards = self._reward(before)
        if self.frame == 1:
            rewards = rewards + self._reward_of_first(before)
        return observations, rewards

    def _reward(self, before: BoolArray) -> FloatArray:
        """Return the reward of the present frame, (B,), from whether the frame before was recognised (B,)."""
        length, onset = self._frames_of_activity[:, self.frame], self._onset[:, self.frame]
        return self._shows_activity(self.frame) * reward(self.correct, before, length, first=onset)

    def _reward_of_first(self, correct: BoolArray) -> FloatArray:
        """Return the reward of frame 0, (B,), from whether it was recognised (B,)."""
        return self._shows_activity(0) * reward(correct, correct, self._frames_of_activity[:, 0], first=True)

    def _shows_activity(self, frame: int) -> BoolArray:
        """Return whether a frame shows an activity, (B,); a clip always does."""
        return self._batch.frame_labels[:, frame] < len(self.scenarios.data.class_names)

    @property
    def info(self) -> dict[str, Any]:
        """For analysis, not for the agent: the frame's true labels (B,), and whether they are recognised (B,)."""
        return {"label": self._batch.frame_labels[:, self.frame].copy(), "correct": self.correct.copy()}

    def _surroundings(self, indices: IntArray, rng: np.random.Generator) -> Surroundings | None:
        """Return what stands and walks around scenarios (B,); copies of an episode have the same passers-by."""
        drawn = surroundings_of(self.scenarios, indices[:: self.copies], self.world, rng)
        return None if drawn is None else drawn.select(np.arange(len(indices)) // self.copies)

    def _see(self) -> Observations:
        """Sense and recognise the present frame."""
        where = f"frame {self.frame}"
        sensed = self._batch.sense(self.sensor, self.frame, self.viewpoint, where)
        with blamed(self.recogniser, f"recogniser {type(self.recogniser).__name__}, {where}"):
            recognition, self._state = self._watching.step(
                self._state, sensed, self._batch.seen_from(self.frame, self.viewpoint)
            )
        check_recognition(recognition, self.recogniser, len(self._batch.labels), where)
        self.correct = np.argmax(recognition.log_probs, axis=1) == self._batch.frame_labels[:, self.frame]
        around = self._batch.surroundings
        return {
            **shown(
                joints_2d=sensed.joints_2d,
                confidence=sensed.confidence,
                viewpoint=self.viewpoint,
                log_probs=recognition.log_probs,
                embedding=recognition.embedding,
                ratio=None if self.in_streams else (self.frame + 1) / self.scenarios.length,
                time=self.frame / self.scenarios.data.fps,
                workspace=self.workspace,
                camera=self.sensor.camera,
                obstacles=self.world.obstacles,
                centre=None if around is None or around.moved is None else around.moved[:, self.frame],
            ),
            **self.controls.observations(),
        }
