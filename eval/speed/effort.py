"""The effort of `ehar bench`: the data, the processes and the number of measurements."""

from dataclasses import dataclass

DATA = "duo"  # 2 persons of 16 joints
WORKERS = 2  # processes side by side, one a core, that are timed together


@dataclass(frozen=True)
class Effort:
    """The number of measurements; the defaults take about three minutes.

    Args:
        length: L, frames of an episode.
        episodes: episodes that the streaming recogniser runs in lockstep.
        batch: the same on a GPU.
        repeats: repeats of each episode, over which medians are taken.
        small_episodes: episodes that both forms of the small network run, evaluated on every prefix.
        published_episodes: episodes for the same with the published widths.
        cameras: cameras that move and sense together when the world is measured alone.
        flights: flights that Ruckig plans at once.
        plans: plans on each track, 15 in a row, each from the one before it.
        clips: clips that a recogniser is trained on.
        matrix: rows and columns of the matrices whose product shows the machine's peak.
        rollouts: rollouts of PPO that are timed, after one that is not timed.
        streams: streams that are watched at once.
        stream_frames: frames of each of them.
        late_frame: the frame of a stream whose cost is compared with that of an early one.
        dancers: people of whom each does two activities, one after the other.
        compile: whether plans wait for machine code before they are timed.
    """

    length: int = 60
    episodes: int = 128
    batch: int = 4096
    repeats: int = 7
    small_episodes: int = 32
    published_episodes: int = 2
    cameras: int = 2048
    flights: int = 5000
    plans: int = 600
    clips: int = 640
    matrix: int = 2048
    rollouts: int = 4
    streams: int = 32
    stream_frames: int = 600
    late_frame: int = 18_000
    dancers: int = 20
    compile: bool = True
