"""Rules that say when to answer, and what their answers are worth: pure functions of probabilities."""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.data.streams.data import NO_ACTIVITY
from ehar.errors import DataError
from eval.records.episodes import EpisodeRecords
from eval.scores.metrics import PROBABILITY_FLOOR
from eval.scores.streams.activities import activity_frames


@dataclass(frozen=True, eq=False)
class Words:
    """What a recogniser, or a belief, says of B activities, each from its first frame on.

    Args:
        answer: (B, T), the most probable class after each frame; -1 is no activity, which answers nothing.
        top: (B, T), its probability.
        second: (B, T), the probability of the second most probable class; None if it is not known.
        shown: (B, T), whether the activity has that frame; frames that it does not have come last.
    """

    answer: IntArray
    top: FloatArray
    second: FloatArray | None
    shown: BoolArray

    def __post_init__(self) -> None:
        """Raise DataError unless each activity has its first frame, and no frame after one that it lacks."""
        if not self.shown.shape[1] or not self.shown[:, 0].all() or (self.shown[:, 1:] > self.shown[:, :-1]).any():
            raise DataError("deciding: expected activities of at least one frame, and missing frames only at their end")

    def select(self, rows: BoolArray) -> "Words":
        """Return the words on some of the activities (B,)."""
        second = None if self.second is None else self.second[rows]
        return Words(self.answer[rows], self.top[rows], second, self.shown[rows])

    @property
    def last(self) -> IntArray:
        """The last frame of each activity, (B,)."""
        last: IntArray = self.shown.sum(axis=1) - 1
        return last

    @property
    def open(self) -> BoolArray:
        """Whether an answer can be given after each frame, (B, T): the activity has it, and the word is an activity."""
        can: BoolArray = self.shown & (self.answer != NO_ACTIVITY)
        return can

    @property
    def odds(self) -> FloatArray:
        """The log-odds of the answer against all other classes together, (B, T)."""
        top = np.clip(self.top, PROBABILITY_FLOOR, 1 - PROBABILITY_FLOOR)
        odds: FloatArray = np.log(top) - np.log1p(-top)
        return odds

    @property
    def lead(self) -> FloatArray:
        """The log-odds of the answer against the second most probable class, (B, T).

        Raises:
            DataError: the second probability is not known.
        """
        if self.second is None:
            raise DataError("deciding: expected the second most probable class's probability, got none")
        lead: FloatArray = np.log(np.maximum(self.top, PROBABILITY_FLOOR) / np.maximum(self.second, PROBABILITY_FLOOR))
        return lead


def words_of_records(records: EpisodeRecords) -> Words:
    """Return what was said of the activities of a planner: its clips, or those that lie within its streams.

    The words on an activity of a stream are those from its onset on, (M, T), where T is as long as the longest.

    Raises:
        DataError: no activity lies within a stream.
    """
    if not records.of_streams:
        shown = np.ones(records.predicted.shape, dtype=np.bool_)
        return Words(records.predicted, records.top_probability, records.second_probability, shown)
    episode, begin, end = activity_frames(records.label)
    frames = np.arange((end - begin).max(initial=0))
    shown = frames < (end - begin)[:, None]
    at = episode[:, None], np.minimum(begin[:, None] + frames, end[:, None] - 1)
    second = records.second_probability
    return Words(records.predicted[at], records.top_probability[at], None if second is None else second[at], shown)


class Rule(Protocol):
    """When to answer."""

    def stops(self, words: Words) -> BoolArray:
        """Return in which frames the rule would answer, (B, T)."""
        ...


class Decisions(NamedTuple):
    """The one answer to each activity."""

    frame: IntArray  # (B,), the frame after which it is given, counted from the onset
    answer: IntArray  # (B,), -1 if there is none


def decide(rule: Rule, words: Words) -> Decisions:
    """Return the answers that a rule gives: after the first frame where it stops, or else after the last frame.

    A word of no activity is no answer, so no rule stops there. If it is the last word, nothing is answered.
    """
    stops = rule.stops(words) & words.open
    frame = np.where(stops.any(axis=1), stops.argmax(axis=1), words.last)
    return Decisions(frame, np.take_along_axis(words.answer, frame[:, None], axis=1)[:, 0])


def waited(decisions: Decisions, seconds: float) -> FloatArray:
    """Return how long each answer took [s], (B,); the first frame counts too.

    Args:
        decisions: the answers.
        seconds: duration of a frame [s].
    """
    time: FloatArray = (decisions.frame + 1) * seconds
    return time


def worth(right: BoolArray, time: FloatArray, price: FloatArray | float) -> FloatArray:
    """Return what answers are worth [points], (...): 100 for a right one, less the price of the time.

    Args:
        right: (...), whether the answer is the true class.
        time: (...), how long it took [s].
        price: of waiting [points/s]; it broadcasts against (...).
    """
    value: FloatArray = 100.0 * right - price * time
    return value


@dataclass(frozen=True)
class FixedTime:
    """Answers after the same time, whatever is seen.

    Args:
        frame: the frame after which it answers, from 0.
    """

    frame: int

    def stops(self, words: Words) -> BoolArray:
        """Return in which frames the rule would answer, (B, T)."""
        late: BoolArray = np.broadcast_to(np.arange(words.shown.shape[1]) >= self.frame, words.shown.shape)
        return late


@dataclass(frozen=True)
class Threshold:
    """Answers once the probability of the answer reaches a threshold.

    This is also the sequential probability ratio test (Wald 1945, Sequential Tests of Statistical Hypotheses) of the
    answer against all other classes together, as log-odds grow with the probability; and the test of Baum & Veeravalli,
    A Sequential Procedure for Multihypothesis Testing, IEEE Trans. Inf. Theory 1994.

    Args:
        odds: the threshold on the log-odds of the answer against the rest.
    """

    odds: float

    def stops(self, words: Words) -> BoolArray:
        """Return in which frames the rule would answer, (B, T)."""
        reached: BoolArray = words.odds >= self.odds
        return reached


@dataclass(frozen=True)
class Sprt:
    """The matrix sequential probability ratio test: answers once the log-odds against every other class reach a bound.

    Armitage, Sequential Analysis with More than Two Alternative Hypotheses, 1950; Dragalin, Tartakovsky &
    Veeravalli, Multihypothesis Sequential Probability Ratio Tests I, IEEE Trans. Inf. Theory 1999, with the same bound
    for each pair. With two classes there are two thresholds, as in Wald's. The log-odds are those of the recogniser's
    own probabilities, which are calibrated for each moment. The least of an answer's log-odds is the one against the
    second most probable class.

    Args:
        lead: the bound on the log-odds.
    """

    lead: float

    def stops(self, words: Words) -> BoolArray:
        """Return in which frames the rule would answer, (B, T)."""
        reached: BoolArray = words.lead >= self.lead
        return reached


@dataclass(frozen=True, eq=False)
class ByFold:
    """Answers the activities of each fold by a rule of its own.

    Args:
        rules: one for each fold.
        fold: (B,) the fold of each activity.
    """

    rules: tuple[Rule, ...]
    fold: IntArray

    def stops(self, words: Words) -> BoolArray:
        """Return in which frames the rules would answer, (B, T)."""
        stops: BoolArray = np.zeros(words.shown.shape, dtype=np.bool_)
        for number, rule in enumerate(self.rules):
            rows = self.fold == number
            stops[rows] = rule.stops(words.select(rows))
        return stops
