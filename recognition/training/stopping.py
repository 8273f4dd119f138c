"""When a recogniser has learned: training goes on while twice the clips still gain something on validation."""

from collections.abc import Sequence
from dataclasses import dataclass

LEAST_CLIPS = 20_000  # before, a network that has not begun to learn looks like one that has learned all
WORTH = 0.005  # training goes on while twice the clips gain at least this accuracy on validation
SPREAD = 1.25  # from one evaluation to the next, the clips grow by this factor, but by at least the first interval


@dataclass(frozen=True)
class Evaluation:
    """The result of one evaluation of the weights that count on the validation clips."""

    step: int
    clips: int  # seen in training so far
    train_loss: float
    nll: float
    accuracy: float  # mean over frames, in [0, 1]


@dataclass(frozen=True)
class Outcome:
    """The end of a training.

    Args:
        best: the evaluation of the weights that are kept.
        gain: the accuracy that the last doubling of the clips gained, in [0, 1]; None before there was one.
        cut_short: whether more clips would have been worth it, or nobody knows.
        reason: why it stopped, in words.
    """

    best: Evaluation
    gain: float | None
    cut_short: bool
    reason: str


def doubling_gain(evaluations: Sequence[Evaluation]) -> float | None:
    """Return the accuracy that the last doubling of the clips gained; None before an evaluation at half as many.

    It is the best accuracy so far, minus the best at up to half of the present clips.
    """
    half = [past.accuracy for past in evaluations if 2 * past.clips <= evaluations[-1].clips]
    return max(past.accuracy for past in evaluations) - max(half) if half else None


def has_learned(evaluations: Sequence[Evaluation]) -> bool:
    """Return whether twice the clips gained too little to go on."""
    if not evaluations or evaluations[-1].clips < LEAST_CLIPS:
        return False
    gain = doubling_gain(evaluations)
    return gain is not None and gain < WORTH


def next_evaluation(evaluations: Sequence[Evaluation], interval: int) -> int:
    """Return the step of the next evaluation: at first after each `interval` steps, then ever farther apart."""
    last = evaluations[-1].step if evaluations else 0
    return max(last + interval, int(last * SPREAD))


def enough_clips(evaluations: Sequence[Evaluation], clips: int) -> int:
    """Return the clips after which training has learned, if nothing gets better after the `clips` so far."""
    if not evaluations:
        return LEAST_CLIPS
    best = max(past.accuracy for past in evaluations)
    enough = next(past.clips for past in evaluations if past.accuracy > best - WORTH)
    return max(2 * enough, LEAST_CLIPS, clips)


def conclude(evaluations: Sequence[Evaluation], clips: int, *, runs_to_end: bool, begun: bool = False) -> Outcome:
    """Return why training stopped after some clips, and what it reached.

    Args:
        evaluations: all evaluations, at least one.
        clips: clips seen in training.
        runs_to_end: whether a schedule decides when training ends.
        begun: whether it went on from other weights, whose clips nobody counts: twice its own is not twice all.
    """
    top = max(past.accuracy for past in evaluations)
    best = next(past for past in reversed(evaluations) if past.accuracy == top)
    gain = doubling_gain(evaluations)
    gained = "" if gain is None else f"twice the clips, {clips // 2:,} to {clips:,}, gained {100 * gain:.1f} points"
    if runs_to_end:
        return Outcome(best, gain, False, f"the published schedule ended after {clips:,} clips")
    if has_learned(evaluations):
        counted = ", counted from the weights that it began with" if begun else ""
        return Outcome(best, gain, False, f"it had learned: {gained} on validation{counted}")
    return Outcome(best, gain, True, f"cut short at {clips:,} clips: {gained or 'too few to tell what more bring'}")
