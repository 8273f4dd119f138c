"""The world in which agents are trained: motion, recogniser, sensor, and the environments and networks that fit."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from ehar.arrays import FloatArray
from ehar.data.scenario import Scenarios, split_parts, windows
from ehar.data.streams.data import StreamData
from ehar.data.streams.scenario import StreamScenarios
from ehar.data.variations import with_stream_variations, with_variations
from ehar.envs.controls import Controls, FlightControls, GridControls, check_moves
from ehar.envs.environment import EpisodeVectorEnv
from ehar.envs.task import EpisodeTask
from ehar.errors import DataError, UsageError
from ehar.planner import Context
from ehar.runner import Runner
from ehar.viewpoint import MOVES
from planners.agents.config import PAPER_VIEWS, AgentTrainingConfig
from planners.agents.inputs import InputSizes
from planners.agents.network import AgentNetwork, AgentSpec
from planners.agents.validation import Validation
from planners.heading import move_target
from planners.value.situation import STREAM_WINDOW
from recognition.setting import Setting, load_setting, with_length
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
    scenarios: Scenarios | StreamScenarios
    held_out: Scenarios | StreamScenarios
    is_held_out: bool

    @staticmethod
    def load(config: AgentTrainingConfig) -> "TrainingWorld":
        """Load the world of a training.

        Raises:
            EharError: data or recogniser are missing or malformed, no policy sequence is long enough, or the track is
                your own motion.
        """
        setting = load_setting(config.conditions, device=config.device)
        if setting.runner.track.own is not None:
            raise UsageError(f"track {setting.runner.track.named}: expected ideal or a vehicle to train agents on")
        data = setting.recordings
        length = with_length(config.conditions, data, STREAM_WINDOW).frames
        parts = split_parts(data)
        policy, unseen = parts.policy, windows(data, parts.validation, length, 1)
        if not (data.lengths[policy] >= length).any():
            raise DataError(f"{data.name}: expected policy sequences of at least {length} frames, got none")
        scenarios: Scenarios | StreamScenarios
        if isinstance(data, StreamData):
            streams = with_stream_variations(data, policy, config.variations_of_each)
            scenarios = windows(streams, np.arange(len(streams.lengths)), length, 1)
        else:
            motion = with_variations(data, policy, config.variations_of_each)
            scenarios = windows(motion, np.arange(len(motion.labels)), length, 1)
        held_out = unseen if len(unseen) else windows(data, policy, length, 1)
        return TrainingWorld(setting, scenarios, held_out, bool(len(unseen)))

    @property
    def flown(self) -> dict[str, Any] | None:
        """The limits of the vehicle in which teachers and agents fly, for JSON; None on the grid."""
        vehicle = self.setting.runner.track.vehicle
        return None if vehicle is None else asdict(vehicle)

    @property
    def validation(self) -> Validation:
        """The episodes on which agents are validated."""
        return Validation(self.setting.runner, self.held_out)

    def make_env(self, episodes: int, *, copies: int = 1) -> EpisodeVectorEnv:
        """Return a natively batched environment, on the grid or in flight."""
        runner = self.setting.runner
        streams = isinstance(self.scenarios, StreamScenarios)
        controls: Controls = GridControls(world=runner.world, moving_centre=streams)
        if self.flown is not None:
            controls = HeadingControls(runner)
        task = EpisodeTask(
            scenarios=runner.followed_everywhere(self.scenarios),
            recogniser=runner.recogniser,
            sensor=runner.sensor,
            controls=controls,
            world=self.setting.world,
            copies=copies,
            onset=runner.onset,
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
        data, streams = self.setting.recordings, isinstance(self.scenarios, StreamScenarios)
        classes = len(data.recognised_names)
        sizes = InputSizes.of(
            persons=data.persons,
            joints=len(data.skeleton.joint_names),
            classes=classes,
            embedding=self.setting.runner.recogniser.embedding_size,
            streams=streams,
            flown=self.flown is not None,
            distances=bool(self.setting.world.obstacles),
        )
        without = () if config.without == "none" else (config.without,)
        spec = AgentSpec(sizes, without, classes + 2 if config.ppo.hindsight else 0, streams)
        return AgentNetwork(spec, classes=classes, seed=seed)


class HeadingControls:
    """The 7 moves as an agent flies them: the vehicle heads for where a move leads in a second.

    Observations also have the velocity, as those of `FlightControls` do.

    Args:
        runner: names the track and the world.
    """

    def __init__(self, runner: Runner) -> None:
        """Create the controls."""
        vehicle, streams = runner.track.vehicle, isinstance(runner.data, StreamData)
        assert vehicle is not None
        self._flight = FlightControls(vehicle=vehicle, workspace=runner.world.workspace, moving_centre=streams)
        self.motion, self.observation_spaces = self._flight.motion, self._flight.observation_spaces
        self.action_space = spaces.Discrete(len(MOVES))
        self._context: Context = runner.context(1, None, np.random.default_rng(0))

    def targets(self, actions: npt.NDArray[Any], viewpoint: FloatArray, where: str) -> FloatArray:
        """Return where moves (B,) lead from viewpoints (B, 3) in a second, (B, 3).

        Raises:
            EpisodeError: an action is no move.
        """
        check_moves(actions, len(viewpoint), where)
        return move_target(self._context, viewpoint, actions)

    def observations(self) -> dict[str, FloatArray]:
        """Return the velocities (B, 3)."""
        return self._flight.observations()
