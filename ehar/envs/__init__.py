"""The task as Gymnasium environments: one episode, or a batch in lockstep."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from ehar.envs.controls import Controls as Controls
    from ehar.envs.controls import FlightControls as FlightControls
    from ehar.envs.controls import GridControls as GridControls
    from ehar.envs.environment import EpisodeEnv as EpisodeEnv
    from ehar.envs.environment import EpisodeVectorEnv as EpisodeVectorEnv
    from ehar.envs.task import EpisodeTask as EpisodeTask
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "EpisodeEnv": "ehar.envs.environment",
            "EpisodeVectorEnv": "ehar.envs.environment",
            "EpisodeTask": "ehar.envs.task",
            "Controls": "ehar.envs.controls",
            "GridControls": "ehar.envs.controls",
            "FlightControls": "ehar.envs.controls",
        },
    )
