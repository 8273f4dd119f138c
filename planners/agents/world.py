"""What agents are trained in: motion, recogniser and sensor, and the environments and networks that fit them."""

from dataclasses import dataclass

import numpy as np

from ehar.data.motion_data import MotionData
from ehar.data.scenario import Scenarios, split_parts, windows
from ehar.data.source import load_data
from ehar.data.variations import with_variations
from ehar.envs.controls import GridControls
from ehar.envs.environment import EpisodeVectorEnv
from ehar.envs.task import Episodes
from ehar.errors import DataError
from ehar.sensors.registry import make_sensor
from ehar.sensors.sensor import Sensor
from planners.agents.config import AgentTrainingConfig
from planners.agents.inputs import InputSizes
from planners.agents.network import AgentNetwork, AgentSpec
from recognition.storage import load_recogniser
from recognition.streaming import PrefixRecogniser, StreamingRecogniser


@dataclass(frozen=True, eq=False)
class TrainingWorld:
    """What agents are trained in: the policy part of some data and variations of it, seen by a recogniser."""

    data: MotionData
    scenarios: Scenarios
    recogniser: StreamingRecogniser | PrefixRecogniser
    sensor: Sensor

    @staticmethod
    def load(config: AgentTrainingConfig) -> "TrainingWorld":
        """Load it.

        Raises:
            EharError: data or recogniser are missing or malformed, or no policy sequence is long enough.
        """
        data = load_data(config.data, fps=config.fps)
        sensor = make_sensor(config.sensor, data.skeleton)
        recogniser = load_recogniser(config.models, data, sensor=config.sensor, views=config.views)
        policy = split_parts(data).policy
        if not (data.lengths[policy] >= config.length).any():
            raise DataError(f"{data.name}: expected policy sequences of at least {config.length} frames, got none")
        motion = with_variations(data, policy, config.variations_of_each)
        scenarios = windows(motion, np.arange(len(motion.labels)), config.length, 1)
        return TrainingWorld(data, scenarios, recogniser, sensor)

    def make_env(self, episodes: int, *, copies: int = 1) -> EpisodeVectorEnv:
        """Return a natively batched environment on the grid."""
        task = Episodes(
            scenarios=self.scenarios,
            recogniser=self.recogniser,
            sensor=self.sensor,
            controls=GridControls(),
            copies=copies,
        )
        return EpisodeVectorEnv(episodes, task)

    def network(self, config: AgentTrainingConfig, seed: int) -> AgentNetwork:
        """Return an untrained network."""
        data, classes = self.data, len(self.data.class_names)
        sizes = InputSizes.of(
            persons=data.persons,
            joints=len(data.skeleton.joint_names),
            classes=classes,
            embedding=self.recogniser.embedding_size,
        )
        without = () if config.without == "none" else (config.without,)
        return AgentNetwork(AgentSpec(sizes, without, classes + 2 if config.ppo.hindsight else 0), seed=seed)
