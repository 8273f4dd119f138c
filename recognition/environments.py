"""Makes the environments `ehar/Grid-v0` and `ehar/Flight-v0` for Gymnasium from conditions."""

from dataclasses import replace

from ehar.conditions import Conditions
from ehar.data.scenario import windows
from ehar.envs.controls import FlightControls, GridControls
from ehar.envs.environment import EpisodeEnv, EpisodeVectorEnv
from ehar.envs.task import EpisodeTask
from ehar.errors import UsageError
from ehar.track import IDEAL
from recognition.setting import load_setting

TRAINED_ON = Conditions(part="policy")  # the usual conditions of an environment


def make_env(*, conditions: Conditions = TRAINED_ON, track: str = IDEAL) -> EpisodeEnv:
    """Return one environment.

    Args:
        conditions: data, sensor, recogniser, world, part and length.
        track: name of the track, for conditions that name none.

    Raises:
        EharError: a part of the conditions is unknown, missing or malformed.
    """
    return EpisodeEnv(_load(conditions, track))


def make_vector_env(num_envs: int = 1, *, conditions: Conditions = TRAINED_ON, track: str = IDEAL) -> EpisodeVectorEnv:
    """Return `num_envs` environments in lockstep; the other arguments are those of `make_env`."""
    return EpisodeVectorEnv(num_envs, _load(conditions, track))


def _load(conditions: Conditions, track: str) -> EpisodeTask:
    setting = load_setting(replace(conditions, track=track) if conditions.track == IDEAL else conditions)
    if setting.runner.track.own is not None:
        raise UsageError(
            f"track {setting.runner.track.named}: expected {IDEAL} or a vehicle: what actions mean to a motion of your "
            "own is not known"
        )
    vehicle, world = setting.runner.track.vehicle, setting.runner.world
    space = world.workspace
    return EpisodeTask(
        scenarios=windows(setting.data, setting.sequences, conditions.frames, 1),
        recogniser=setting.runner.recogniser,
        sensor=setting.runner.sensor,
        controls=GridControls(workspace=space) if vehicle is None else FlightControls(vehicle=vehicle, workspace=space),
        world=world,
    )
