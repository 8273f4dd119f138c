"""Fits the rules to a price of waiting, on activities that they are not scored on; among them a backward induction."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.errors import DataError
from eval.records.episodes import EpisodeRecords
from eval.scores.deciding.rules import FixedTime, Rule, Sprt, Threshold, Words, decide, waited, words_of_records, worth
from eval.scores.streams.activities import activities

BOUNDS = 200  # candidates of a threshold: quantiles of what was seen
# Candidates: how strongly the slopes of what waiting is worth are drawn to zero, where only time counts; and the share
# of the frames, from a frame on, that say together what waiting in that frame is worth.
SETTINGS = ((0.003, 0.2), (0.003, 0.05), (0.1, 0.2), (0.1, 0.05))
FOLDS = 3  # over sequences, in which one of them is chosen
MOST_LEAD = 8.0  # log-odds against the second class that count as certain

FittedRule = TypeVar("FittedRule", bound=Rule)


@dataclass(frozen=True, eq=False)
class Seen:
    """Activities that rules are fitted on.

    Args:
        words: what was said of B activities.
        label: (B,), their true classes.
        seconds: duration of a frame [s].
        sequence: (B,) the number of the sequence, or stream, that each is from; None if nobody knows.
    """

    words: Words
    label: IntArray
    seconds: float
    sequence: IntArray | None = None

    def __post_init__(self) -> None:
        """Raise DataError unless there is an activity, and a label for each."""
        if not len(self.label) or len(self.label) != len(self.words.answer):
            raise DataError(
                f"deciding: expected a label for each activity, at least 1, got {len(self.label)} labels for "
                f"{len(self.words.answer)} activities"
            )

    def select(self, rows: BoolArray) -> "Seen":
        """Return some of the activities (B,)."""
        sequence = None if self.sequence is None else self.sequence[rows]
        return Seen(self.words.select(rows), self.label[rows], self.seconds, sequence)

    @property
    def right(self) -> BoolArray:
        """Whether an answer after each frame would be right, (B, T)."""
        right: BoolArray = self.words.answer == self.label[:, None]
        return right


def seen_in(records: EpisodeRecords, seconds: float, *, second: bool = True) -> Seen:
    """Return the activities of a planner: its clips, or those that lie within its streams.

    Args:
        records: its records.
        seconds: duration of a frame [s].
        second: whether the probability of the second most probable class may be used, if it is recorded.
    """
    words = words_of_records(records)
    shown = activities(records) if records.of_streams else records
    sequence = np.unique(shown.sequence, return_inverse=True)[1]
    return Seen(words if second else replace(words, second=None), shown.label, seconds, sequence)


def worth_of(rule: Rule, seen: Seen, price: float) -> FloatArray:
    """Return what a rule's answers are worth at a price [points], (B,)."""
    decisions = decide(rule, seen.words)
    return worth(decisions.answer == seen.label, waited(decisions, seen.seconds), price)


def fit_fixed_time(seen: Seen, price: float) -> FixedTime:
    """Return the time that is worth most."""
    return _best([FixedTime(frame) for frame in range(seen.words.shown.shape[1])], seen, price)


def fit_threshold(seen: Seen, price: float) -> Threshold:
    """Return the threshold that is worth most."""
    return _best([Threshold(odds) for odds in _bounds(seen.words.odds, seen)], seen, price)


def fit_sprt(seen: Seen, price: float) -> Sprt:
    """Return the bound of the test that is worth most."""
    return _best([Sprt(lead) for lead in _bounds(seen.words.lead, seen)], seen, price)


def _best(rules: Sequence[FittedRule], seen: Seen, price: float) -> FittedRule:
    """Return the rule that is worth most; of equals, the first."""
    return max(rules, key=lambda rule: float(worth_of(rule, seen, price).mean()))


def _bounds(values: FloatArray, seen: Seen) -> list[float]:
    """Return candidates of a threshold on values (B, T), among them one that all reach, and one that nothing does."""
    said = values[seen.words.open]
    return [-np.inf, *(np.quantile(said, np.linspace(0, 1, BOUNDS)).tolist() if said.size else ()), np.inf]


@dataclass(frozen=True, eq=False)
class Induction:
    """Answers once waiting is expected to cost more than it gains.

    Args:
        weights: (T - 1, 5 or 3), what waiting is worth after each frame but the last [points], for each of `_terms`;
            one at least, and later frames count as the last of these.
    """

    weights: FloatArray

    def stops(self, words: Words) -> BoolArray:
        """Return in which frames the rule would answer, (B, T)."""
        frames = np.minimum(np.arange(words.shown.shape[1]), len(self.weights) - 1)
        gain = np.einsum("btf,tf->bt", _terms(words), self.weights[frames])
        no_gain: BoolArray = gain <= 0
        return no_gain


def fit_induction(seen: Seen, price: float) -> Induction:
    """Return the rule that backward induction finds: from the last frame to the first, is it worth waiting?

    The least-squares method of Longstaff & Schwartz, Valuing American Options by Simulation, Review of Financial
    Studies 2001. In each frame the regression explains what waiting gains: what the answer is worth that the rule goes
    on to give, less what the present answer is worth. The next frames help to estimate it. One of
    `SETTINGS` is chosen in folds over the sequences.
    """
    if seen.sequence is None or not seen.sequence.max() > seen.sequence.min():
        return _induction(seen, price, *SETTINGS[0])
    fold = np.unique(seen.sequence, return_inverse=True)[1] % FOLDS
    parts = [(seen.select(fold != number), seen.select(fold == number)) for number in np.unique(fold)]
    worths = [
        sum(worth_of(_induction(fit, price, *setting), held, price).sum() for fit, held in parts)
        for setting in SETTINGS
    ]
    return _induction(seen, price, *SETTINGS[int(np.argmax(worths))])


def _induction(seen: Seen, price: float, ridge: float, look: float) -> Induction:
    """Return what backward induction finds with one of `SETTINGS`."""
    words = seen.words
    terms, last = _terms(words), words.last
    length = int(last.max()) + 1
    count = terms.shape[-1]
    now = worth(seen.right[:, :length], (np.arange(length) + 1) * seen.seconds, price)
    value = np.take_along_axis(now, last[:, None], axis=1)[:, 0]  # of what the rule does from a frame on
    gain = np.zeros_like(now)
    weights = np.zeros((max(length - 1, 1), count))
    window = max(1, round(look * length))
    penalty = ridge * np.diag([0.0] + [1.0] * (count - 1))
    for frame in range(length - 2, -1, -1):
        gain[:, frame] = value - now[:, frame]
        near = slice(frame, min(frame + window, length - 1))
        open_there = words.open[:, near] & (np.arange(near.start, near.stop) < last[:, None])
        here, there = terms[:, near][open_there], gain[:, near][open_there]
        if len(here):
            weights[frame] = np.linalg.solve(here.T @ here / len(here) + penalty, here.T @ there / len(here))
        elif frame + 1 < len(weights):
            weights[frame] = weights[frame + 1]  # nobody could answer here, so nothing is known of this frame alone
        can = words.open[:, frame] & (last > frame)
        value = np.where(can & (terms[:, frame] @ weights[frame] <= 0), now[:, frame], value)
    return Induction(weights)


def _terms(words: Words) -> FloatArray:
    """Return what the worth of waiting depends on, (B, T, 5 or 3): 1, and two polynomials of the second degree.

    The one is of the probability that the answer is wrong, the other of its lead, 0 to 1, if that is known.
    """
    wrong = 1 - words.top
    terms = [np.ones_like(wrong), wrong, wrong**2]
    if words.second is not None:
        lead = np.minimum(words.lead, MOST_LEAD) / MOST_LEAD
        terms += [lead, lead**2]
    return np.stack(terms, axis=-1)
