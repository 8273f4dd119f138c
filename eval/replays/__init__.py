"""Replays: one episode as a film, a recording, or a part of a report."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from eval.replays.episode import EpisodeReplay as EpisodeReplay
    from eval.replays.replay import WrittenReplay as WrittenReplay
    from eval.replays.replay import make_replay as make_replay
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "make_replay": "eval.replays.replay",
            "WrittenReplay": "eval.replays.replay",
            "EpisodeReplay": "eval.replays.episode",
        },
    )
