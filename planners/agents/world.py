"""The world in which agents are trained: motion, recogniser, sensor, and the environments and networks that fit."""

from dataclasses import dataclass

import numpy as np

from ehar.data.scenario import Scenarios, split_parts, windows
from ehar.data.variations import with_variations
from ehar.envs.controls import GridControls
from ehar.envs.environment import EpisodeVectorEnv
from ehar.envs.task import EpisodeTask
from ehar.errors import DataError
from planners.agents.config import PAPER_VIEWS, AgentTrainingConfig
from planners.agents.inputs import InputSizes
from planners.agents.network import AgentNetwork, AgentSpec
from planners.agents.validation import Validation
from recognition.setting import Setting, load_setting
from recognition.storage import recogniser_path
from recognition.weight_files import recorded_run


@dataclass(frozen=True, eq=False)
class TrainingWorld:
    """The world in which agents are trained: the policy part of some data with variations, seen by a recogniser.

    Args:
        setting: data, recogniser and sensor.
        scenarios: the scenarios to train on.
        held_out: those to validate on, of other people where the training part names at least three.
        is_held_out: whether they are held out: if no validation sequence is long enough, they are those to train on.
    """

    setting: Setting
    scenarios: Scenarios
    held_out: Scenarios
    is_held_out: bool

    @staticmethod
    def load(config: AgentTrainingConfig) -> "TrainingWorld":
        """Load the world of a training.

        Raises:
            EharError: data or recogniser are missing or malformed, or no policy sequence is long enough.
        """
        setting, length = load_setting(config.conditions, device=config.device), config.conditions.frames
        data = setting.data
        parts = split_parts(data)
        policy, unseen = parts.policy, windows(data, parts.validation, length, 1)
        if not (data.lengths[policy] >= length).any():
            raise DataError(f"{data.name}: expected policy sequences of at least {length} frames, got none")
        motion = with_variations(data, policy, config.variations_of_each)
        scenarios = windows(motion, np.arange(len(motion.labels)), length, 1)
        held_out = unseen if len(unseen) else windows(data, policy, length, 1)
        return TrainingWorld(setting, scenarios, held_out, bool(len(unseen)))

    @property
    def validation(self) -> Validation:
        """The episodes on which agents are validated."""
        return Validation(self.setting.runner, self.held_out)

    def make_env(self, episodes: int, *, copies: int = 1) -> EpisodeVectorEnv:
        """Return a natively batched environment on the grid."""
        task = EpisodeTask(
            scenarios=self.scenarios,
            recogniser=self.setting.runner.recogniser,
            sensor=self.setting.runner.sensor,
            controls=GridControls(workspace=self.setting.world.workspace),
            world=self.setting.world,
            copies=copies,
        )
        return EpisodeVectorEnv(episodes, task)

    def departures(self, config: AgentTrainingConfig) -> tuple[str, ...]:
        """Return in what the recogniser is not the paper's, though the setting is; nothing with another setting."""
        if config.setting != "paper" or config.conditions.directory is None:
            return ()
        run = recorded_run(recogniser_path(config.conditions.directory, config.conditions))
        wanted = {"size": "published", "optimiser": "published", "views": PAPER_VIEWS, "sensor": "perfect"}
        return tuple(
            f"{name} {run.get(name)} in place of {value}" for name, value in wanted.items() if run.get(name) != value
        )

    def network(self, config: AgentTrainingConfig, seed: int) -> AgentNetwork:
        """Return an untrained network."""
        data, classes = self.setting.data, len(self.setting.data.class_names)
        sizes = InputSizes.of(
            persons=data.persons,
            joints=len(data.skeleton.joint_names),
            classes=classes,
            embedding=self.setting.runner.recogniser.embedding_size,
        )
        without = () if config.without == "none" else (config.without,)
        spec = AgentSpec(sizes, without, classes + 2 if config.ppo.hindsight else 0)
        return AgentNetwork(spec, classes=classes, seed=seed)
