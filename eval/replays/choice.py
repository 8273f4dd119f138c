"""Chooses the episodes and planners of a replay: a report shows few episodes and states the rule."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from eval.records.episodes import EpisodeRecords
from eval.scores.metrics import mean_acc
from eval.scores.planner_summary import NO_ACT

MOST = 8  # episodes
MOST_STREAMS = 4  # episodes of streams, each of which lasts as long as many clips
RULE = (
    "chosen after the fact, so they illustrate and prove nothing: those in which {planner} gains most and loses most "
    "against {other}, the one in which its gain is the median, and those in which planners' accuracies spread most"
)
RULE_ALONE = "chosen after the fact: those in which the accuracies of planners spread most"
OF_CLIPS = ", of different classes as far as there are enough"  # follows a rule


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
    """Return the most telling episodes, none twice, and of different classes until every class has one.

    A stream shows many classes, so those of streams are not told apart by them.

    Args:
        records: records on the same episodes, by record name.
        planner: planner whose best, worst and typical episode against `other` come first; None leaves these out.
        other: planner to compare with; None leaves these episodes out.
        most: largest number of episodes.
    """
    accuracy = np.stack([mean_acc(episodes.correct) for episodes in records.values()])
    label = next(iter(records.values())).label
    label = label if label.ndim == 1 else np.zeros(len(label), dtype=np.int64)
    free = np.ones(len(label), dtype=bool)
    chosen: list[ChosenEpisode] = []

    def take(preference: FloatArray, why: str, numbers: FloatArray) -> None:
        """Take the free episode that is preferred most, the first of equal ones, and bar its class."""
        if free.any() and len(chosen) < most:
            best = int(np.where(free, preference, -np.inf).argmax())
            chosen.append(ChosenEpisode(best, why.format(numbers[best])))
            free[:] = _free(label, [one.episode for one in chosen])

    if planner is not None and other is not None:
        names = list(records)
        gain = 100 * (accuracy[names.index(planner)] - accuracy[names.index(other)])
        against = f"against {other}".replace("{", "{{").replace("}", "}}")
        who = planner.replace("{", "{{").replace("}", "}}")
        take(gain, f"{who} gains most {against}: {{:+.0f}} points", gain)
        take(-gain, f"{who} loses most {against}: {{:+.0f}} points", gain)
        take(-np.abs(gain - np.median(gain)), f"typical: {who} is at its median {against}, {{:+.0f}} points", gain)
    spread = 100 * accuracy.std(axis=0)
    while free.any() and len(chosen) < most:
        take(spread, "planners differ: a standard deviation of {:.0f} points between them", spread)
    return tuple(chosen)


def _free(label: IntArray, taken: list[int]) -> BoolArray:
    """Return which episodes may be taken next: those of the classes with the fewest so far."""
    classes = np.unique(label)
    count = dict.fromkeys(classes.tolist(), 0)
    for episode in taken:
        count[int(label[episode])] += 1
    left = np.ones(len(label), dtype=bool)
    left[taken] = False
    remaining = [count[int(true_class)] for true_class in label[left]]
    if not remaining:
        return left
    fewest = min(remaining)
    free: BoolArray = left & np.array([count[int(true_class)] == fewest for true_class in label])
    return free
