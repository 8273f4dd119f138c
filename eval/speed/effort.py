"""How much is measured by `ehar bench`, and on what."""

from dataclasses import dataclass

DATA = "duo"  # 2 persons of 16 joints
WORKERS = 2  # processes side by side, one a core, that are timed together


@dataclass(frozen=True)
class Effort:
    """How much is measured; the defaults take about two minutes.

    Args:
        length: L, frames of an episode.
        episodes: run in lockstep by the streaming recogniser.
        repeats: of each episode; medians are taken over them.
        small_episodes: run by both forms of the small network, which see every prefix.
        published_episodes: the same for the published widths.
        cameras: moved and seen through together when the world is measured alone.
        flights: that Ruckig is asked for at once.
        plans: that are solved on each track, each from the one before it, 15 in a row.
        rollouts: of PPO that are timed, after one that is not.
    """

    length: int = 60
    episodes: int = 128
    repeats: int = 7
    small_episodes: int = 32
    published_episodes: int = 2
    cameras: int = 2048
    flights: int = 5000
    plans: int = 600
    rollouts: int = 4
