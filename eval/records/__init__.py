"""The records of a run: what happened in each frame, and the files that hold it."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from eval.records.config import PlannerConfig as PlannerConfig
    from eval.records.config import RunConfig as RunConfig
    from eval.records.config import read_config as read_config
    from eval.records.episode_lines import read_episodes as read_episodes
    from eval.records.episodes import EpisodeRecords as EpisodeRecords
    from eval.records.flights import FlightRecords as FlightRecords
    from eval.records.solves import Solves as Solves
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "RunConfig": "eval.records.config",
            "PlannerConfig": "eval.records.config",
            "read_config": "eval.records.config",
            "EpisodeRecords": "eval.records.episodes",
            "read_episodes": "eval.records.episode_lines",
            "FlightRecords": "eval.records.flights",
            "Solves": "eval.records.solves",
        },
    )
