"""Chooses the episodes and planners of a replay: a report shows few episodes and states the rule."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from eval.records.episodes import EpisodeRecords
from eval.scores.metrics import mean_acc
from eval.scores.planner_summary import NO_ACT
from eval.scores.streams.activities import activities, activity_frames

MOST = 8  # episodes
MOST_STREAMS = 4  # episodes of streams, each of which lasts as long as many clips
RULE = (
    "chosen after the fact, so they illustrate and prove nothing: those in which {planner} gains most and loses most "
    "against {other}, the one in which its gain is nearest to the median, and those in which planners' "
    "accuracies spread most"
)
RULE_ALONE = "chosen after the fact: those in which the accuracies of planners spread most"
OF_CLIPS = ", first of classes that are not shown yet"  # follows a rule


class ChosenEpisode(NamedTuple):
    """An episode to replay, and why."""

    episode: int
    why: str


def choose_planners(names: Sequence[str], lead: str | None) -> tuple[str, ...]:
    """Return the one or two planners to show first: the leading planner, or else the first one, beside no-act.

    Args:
        names: names of the run's planners, at least one.
        lead: name of the most accurate planner without the truth; None if there is none.
    """
    first = lead or names[0]
    return (first, NO_ACT) if NO_ACT in names and first != NO_ACT else (first,)


def choose_episodes(
    records: Mapping[str, EpisodeRecords], planner: str | None, other: str | None, *, most: int = MOST
) -> tuple[ChosenEpisode, ...]:
    """Return the most telling episodes, none twice.

    The best, worst and typical one are chosen among all episodes. Then come those in which planners differ most, each
    of a class with the fewest so far. A stream shows many classes, so those of streams are not told apart by them; its
    accuracy is that of its activities, as in the tables, and one that shows no whole activity is left out.

    Args:
        records: records on the same episodes, by record name.
        planner: planner whose best, worst and typical episode against `other` come first; None leaves these out.
        other: planner to compare with; None leaves these episodes out.
        most: largest number of episodes.
    """
    accuracy = np.stack([_accuracy(episodes) for episodes in records.values()])
    label = next(iter(records.values())).label
    label = label if label.ndim == 1 else np.zeros(len(label), dtype=np.int64)
    left = ~np.isnan(accuracy[0])
    chosen: list[ChosenEpisode] = []

    def take(among: BoolArray, preference: FloatArray, why: str, numbers: FloatArray) -> None:
        """Take the episode among some that is preferred most, the first of equal ones."""
        if among.any() and len(chosen) < most:
            best = int(np.where(among, preference, -np.inf).argmax())
            chosen.append(ChosenEpisode(best, why.format(numbers[best])))
            left[best] = False

    if planner is not None and other is not None:
        names = list(records)
        gain = 100 * (accuracy[names.index(planner)] - accuracy[names.index(other)])
        against = f"against {other}".replace("{", "{{").replace("}", "}}")
        who = planner.replace("{", "{{").replace("}", "}}")
        away = np.abs(gain - np.nanmedian(gain))
        take(left, gain, f"{who} gains most {against}: {{:+.0f}} points", gain)
        take(left, -gain, f"{who} loses most {against}: {{:+.0f}} points", gain)
        take(left, -away, f"typical: {who} is nearest to its median {against}, {{:+.0f}} points", gain)
    spread = 100 * accuracy.std(axis=0)
    while left.any() and len(chosen) < most:
        among = _of_rarest(label, left)
        take(among, spread, "planners differ: a standard deviation of {:.0f} points between them", spread)
    return tuple(chosen)


def _accuracy(records: EpisodeRecords) -> FloatArray:
    """Return the mean accuracy of each episode, (N,); NaN for a stream that shows no whole activity."""
    if not records.of_streams:
        return mean_acc(records.correct)
    episode, _, _ = activity_frames(records.label)
    count = np.bincount(episode, minlength=len(records))
    right = np.bincount(episode, mean_acc(activities(records).correct), minlength=len(records))
    of_each: FloatArray = np.divide(right, count, out=np.full(len(records), np.nan), where=count > 0)
    return of_each


def _of_rarest(label: IntArray, left: BoolArray) -> BoolArray:
    """Return the episodes that are left, of the classes that have been taken least often."""
    taken = (label[:, None] == label[~left]).sum(axis=1)
    rarest: BoolArray = left & (taken == taken[left].min())
    return rarest
