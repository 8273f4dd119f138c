"""The table of streams: how soon and how wrongly activities are named, one row for each planner."""

from collections.abc import Mapping

from eval.records.episodes import EpisodeRecords
from eval.render.tables import NONE, Table
from eval.scores.streams.scores import stream_scores

STREAM_HEADER = (
    *("frames right %", "no activity right %", "delay [s]", "recognised %", "false alarms/min"),
    *("F1 %", "p-mAP %"),
)
STREAM_NOTES = (
    "Delay: from the onset until the answer is right and stays right; an activity for which it never does counts in "
    "full. Recognised: the share of activities for which it does.",
    "A false alarm is an answer that names an activity that is not shown while it is given.",
    "F1: of activities' classes, the mean over 20 observation ratios. p-mAP: of detected starts that lie within 1, 2, "
    "... 10 s of the true ones, the mean.",
)


def stream_table(records: Mapping[str, EpisodeRecords], fps: float, episodes: int) -> Table:
    """Return a table with one row per planner: how soon activities are recognised in streams, and how often wrongly.

    Args:
        records: records of streams, by planner; those of several trainings one after another.
        fps: frames per second.
        episodes: number of episodes of each training.
    """
    whole = next(iter(records.values()))
    return Table(
        title=f"In streams: {episodes} episodes of {whole.label.shape[1] / fps:.4g} s",
        header=("planner", *STREAM_HEADER),
        rows=tuple((name, *stream_row(held, fps)) for name, held in records.items()),
        footnotes=STREAM_NOTES,
    )


def stream_row(records: EpisodeRecords, fps: float) -> tuple[str, ...]:
    """Return the scores of streams as texts, in the order of `STREAM_HEADER`."""
    scores = stream_scores(records, fps)
    return (
        f"{scores.frames_right:.1f}",
        NONE if scores.no_activity_right is None else f"{scores.no_activity_right:.1f}",
        f"{scores.delay_s:.2f}",
        f"{scores.recognised:.1f}",
        f"{scores.false_alarms_per_min:.1f}",
        f"{scores.f1_mean:.1f}",
        f"{scores.point_map_mean:.1f}",
    )
