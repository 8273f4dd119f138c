"""Makes the environments `ehar/Grid-v0`, `ehar/Flight-v0` and `ehar/Stream-v0` for Gymnasium from conditions."""

from dataclasses import replace

from ehar.conditions import Conditions
from ehar.data.scenario import Scenarios, windows
from ehar.data.streams.data import StreamData
from ehar.data.streams.scenario import StreamScenarios
from ehar.envs.controls import Controls, FlightControls, GridControls
from ehar.envs.environment import EpisodeEnv, EpisodeVectorEnv
from ehar.envs.task import EpisodeTask
from ehar.errors import UsageError
from ehar.track import IDEAL
from recognition.setting import Setting, load_setting

TRAINED_ON = Conditions(part="policy")  # the usual conditions of an environment
STREAMS = Conditions(data="solo-stream", sensor="estimator", part="policy")  # those of streams


def make_env(*, conditions: Conditions = TRAINED_ON, track: str = IDEAL) -> EpisodeEnv:
    """Return one environment.

    Args:
        conditions: data, sensor, recogniser, world, part and length.
        track: name of the track, for conditions that name none.

    Raises:
        EharError: a part of the conditions is unknown, missing or malformed.
    """
    return EpisodeEnv(_clips(conditions, track))


def make_vector_env(num_envs: int = 1, *, conditions: Conditions = TRAINED_ON, track: str = IDEAL) -> EpisodeVectorEnv:
    """Return `num_envs` environments in lockstep; the other arguments are those of `make_env`."""
    return EpisodeVectorEnv(num_envs, _clips(conditions, track))


def make_stream_env(*, conditions: Conditions = STREAMS) -> EpisodeEnv:
    """Return one environment of streams, on the track of the conditions.

    Args:
        conditions: data, sensor, recogniser, world, track, part and length; 30 s if they name none.

    Raises:
        EharError: a part of the conditions is unknown, missing or malformed, or the data are no streams.
    """
    return EpisodeEnv(_streams(conditions))


def make_stream_vector_env(num_envs: int = 1, *, conditions: Conditions = STREAMS) -> EpisodeVectorEnv:
    """Return `num_envs` environments in lockstep; the conditions are those of `make_stream_env`."""
    return EpisodeVectorEnv(num_envs, _streams(conditions))


def _clips(conditions: Conditions, track: str) -> EpisodeTask:
    setting = load_setting(replace(conditions, track=track) if conditions.track == IDEAL else conditions)
    return _task(setting, windows(setting.data, setting.sequences, setting.conditions.frames, 1))


def _streams(conditions: Conditions) -> EpisodeTask:
    setting = load_setting(conditions)
    streams = setting.recordings
    if not isinstance(streams, StreamData):
        raise UsageError(f"{streams.name}: expected streams, got trimmed sequences: `ehar/Grid-v0` takes them")
    return _task(setting, windows(streams, setting.sequences, setting.conditions.frames, 1))


def _task(setting: Setting, scenarios: Scenarios | StreamScenarios) -> EpisodeTask:
    """Return the task of some scenarios in a setting."""
    if setting.runner.track.own is not None:
        raise UsageError(
            f"track {setting.runner.track.named}: expected {IDEAL} or a vehicle: what actions mean to a motion of your "
            "own is not known"
        )
    vehicle, world = setting.runner.track.vehicle, setting.runner.world
    streams = isinstance(scenarios, StreamScenarios)
    controls: Controls = GridControls(world=world, moving_centre=streams)
    if vehicle is not None:
        controls = FlightControls(vehicle=vehicle, workspace=world.workspace, moving_centre=streams)
    return EpisodeTask(
        scenarios=setting.runner.followed_everywhere(scenarios),
        recogniser=setting.runner.recogniser,
        sensor=setting.runner.sensor,
        controls=controls,
        world=world,
        onset=setting.runner.onset,
    )
