"""A Markov chain of activities that last and follow each other: its states, a frame later, and what is to come."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.data.streams.data import NO_ACTIVITY
from planners.value.belief.streams import StreamBeliefModel


class Chain(NamedTuple):
    """The probability of each state of B streams; all of a stream sum to 1."""

    activity: FloatArray  # (B, K, n), by phase
    gap: FloatArray  # (B, K, m), by the activity before the gap, and by phase

    @property
    def classes(self) -> FloatArray:
        """The probability of each activity and, last, of none, (B, K + 1)."""
        activity, gap = self.activity.sum(axis=-1), self.gap.sum(axis=(1, 2))
        together: FloatArray = np.concatenate([activity, gap[:, None]], axis=-1)
        return together


def begin(model: StreamBeliefModel, streams: int) -> Chain:
    """Return the states before the first frame: a stream is cut in anywhere, so each phase is as likely."""
    share = np.array(model.share)
    activity, none = share[:NO_ACTIVITY], share[NO_ACTIVITY]
    before = activity / activity.sum()
    one = Chain(
        np.repeat(activity[:, None] / model.phases, model.phases, axis=1),
        np.repeat(none * before[:, None] / model.gap_phases, model.gap_phases, axis=1),
    )
    return Chain(*(np.repeat(part[None], streams, axis=0) for part in one))


def advance(model: StreamBeliefModel, chain: Chain, seconds: float) -> Chain:
    """Return the states one frame of `seconds` later, before anything is seen of it."""
    moving = chain.activity * leave_shares(np.array(model.rates), model.phases, seconds)[:, None]
    closing = chain.gap * leave_shares(np.array(model.gap_rate), model.gap_phases, seconds)
    into_gap = moving[..., -1] * np.array(model.gap_share)
    starting = (moving[..., -1] - into_gap + closing[..., -1]) @ np.array(model.follows)
    return Chain(
        chain.activity - moving + np.concatenate([starting[..., None], moving[..., :-1]], axis=-1),
        chain.gap - closing + np.concatenate([into_gap[..., None], closing[..., :-1]], axis=-1),
    )


def leave_shares(rates: FloatArray, phases: int, seconds: float) -> FloatArray:
    """Return the probability that a phase is left within a frame; where a frame is longer than a phase, it is 1."""
    shares: FloatArray = np.minimum(phases * rates * seconds, 1.0)
    return shares


def classes_of_states(model: StreamBeliefModel) -> IntArray:
    """Return the class of each state of `transition_matrix`: K stands for no activity."""
    activities = np.repeat(np.arange(model.classes), model.phases)
    return np.concatenate([activities, np.full(model.classes * model.gap_phases, model.classes)])


def transition_matrix(model: StreamBeliefModel, seconds: float) -> FloatArray:
    """Return the probability of each state (columns) one frame of `seconds` after each state (rows).

    States are the phases of the first activity, of the second, ..., and then those of the gap after each activity.
    """
    activities, gaps = model.classes * model.phases, model.classes * model.gap_phases
    each = np.eye(activities + gaps)
    chain = Chain(
        each[:, :activities].reshape(-1, model.classes, model.phases),
        each[:, activities:].reshape(-1, model.classes, model.gap_phases),
    )
    later = advance(model, chain, seconds)
    return np.concatenate([part.reshape(len(each), -1) for part in later], axis=1)


def coming_shares(model: StreamBeliefModel, *, fps: float, ends: Sequence[int]) -> FloatArray:
    """Return the share of frames to come that is expected to show each class, from each state, (E, S, K + 1).

    Nothing is seen of them yet: the present activity goes on for as long as such ones last, and then comes what
    follows it. States are those of `transition_matrix`.

    Args:
        model: the parameters.
        fps: frames per second.
        ends: the last frame of each part of the time to come, counted from 1 and rising; a part begins where the one
            before it ends.
    """
    step = transition_matrix(model, 1 / fps)
    later = np.eye(model.classes + 1)[classes_of_states(model)]
    shares = np.zeros((len(ends), *later.shape))
    for part, (begin, end) in enumerate(pairwise((0, *ends))):
        for _ in range(begin, end):
            later = step @ later
            shares[part] += later / (end - begin)
    return shares
