"""The belief in streams: a Bayes filter over activities that last and follow each other, many streams at once."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.data.streams.data import NO_ACTIVITY
from ehar.errors import ModelError
from planners.value.belief import NOISE_BASIS, BeliefModel, noise_basis, readout
from planners.value.view_basis import PAPER_RANGE, DistanceRange

VIEW_TERMS = NOISE_BASIS - 1  # the terms of `noise_basis` but the last: a stream has no observation ratio
LEAST_LOG_PROB = -16.0  # log-probabilities below it count as it: the difference of two infinite ones is no evidence
LEAST_PROBABILITY = 1e-12  # of a class that is read out; its logarithm is finite
LEAST_LOG_LIKELIHOOD = -60.0  # below the likeliest class; filterpy's update divides by zero where every product is zero


@dataclass(frozen=True, kw_only=True)
class StreamBeliefModel:
    r"""The parameters of the belief in a stream; learned on training data (`planners.value.stream_belief_fit`).

    The state is one of K activities, or a gap: no activity. A gap remembers the activity before it, since what comes
    next depends on that one. An activity passes through n phases one by one, and leaves each within a frame with the
    probability :math:`n r_k / f` at f frames per second. So it lasts :math:`1 / r_k` seconds in the mean, with the
    standard deviation :math:`\approx 1 / (r_k \sqrt{n})`: a phase-type distribution (Neuts 1981, Matrix-Geometric
    Solutions in Stochastic Models, Sec. 2.2). A hazard that depends on the age would need a state for each frame of
    the longest activity. Phases make an ordinary Markov chain of a few states, so the filter is exact, and a frame
    costs the same after an hour.

    An activity k is followed by a gap with the probability `gap_share[k]`. Then, or else at once, comes activity j with
    the probability `follows[k][j]`.

    A recogniser that accumulates says in each frame nearly what it said before. Its outputs are therefore not
    independent evidence. Let :math:`y_t` be its log-probabilities, less the log of `share`, which it knows from its
    training. The log-likelihood of frame t is the weighted increment

    .. math:: z_t = e^{w \cdot \psi_t} (y_t - \rho\, y_{t-1}), \quad y_0 = 0,

    with the terms :math:`\psi` of `planners.value.belief.noise_basis` but its last. Where nothing ever ends and all
    increments count alike, the belief is what the recogniser says (`believing`).

    Args:
        follows: (K, K), the activity that comes after each one; rows sum to 1.
        rates: (K,), one over the mean duration of each activity [1/s].
        gap_share: (K,), how likely each activity is followed by a gap.
        gap_rate: one over the mean duration of a gap [1/s].
        share: (K + 1,), the share of time of each activity and, last, of no activity; where a stream begins.
        phases: n of activities.
        gap_phases: n of gaps.
        view_weights: w.
        kept: rho, in [0, 1], at the frame rate of the fit: 1 counts increments, 0 takes each output as new evidence.
        distances: middle and half of the range of distances of the world that it was fitted in [m].
    """

    follows: tuple[tuple[float, ...], ...]
    rates: tuple[float, ...]
    gap_share: tuple[float, ...]
    gap_rate: float
    share: tuple[float, ...]
    phases: int = 1
    gap_phases: int = 1
    view_weights: tuple[float, ...] = (0.0,) * VIEW_TERMS
    kept: float = 1.0
    distances: tuple[float, float] = (PAPER_RANGE.middle, PAPER_RANGE.half)

    def __post_init__(self) -> None:
        """Raise ModelError if a parameter is out of range."""
        classes = len(self.rates)
        for name, values, least, most in (
            ("rates", self.rates, 0.0, np.inf),
            ("gap_share", self.gap_share, 0.0, 1.0),
            ("gap_rate", (self.gap_rate,), 0.0, np.inf),
            ("share", self.share, 0.0, 1.0),
            ("kept", (self.kept,), 0.0, 1.0),
            ("view_weights", self.view_weights, -np.inf, np.inf),
            ("distances", self.distances, -np.inf, np.inf),
        ):
            size = {"gap_share": classes, "share": classes + 1, "view_weights": VIEW_TERMS, "distances": 2}
            held = np.asarray(values, dtype=np.float64)
            if held.shape != (size.get(name, len(values)),) or not (
                np.isfinite(held).all() and (held >= least).all() and (held <= most).all()
            ):
                raise ModelError(
                    f"stream belief: {name}: expected {size.get(name, len(values))} finite numbers "
                    f"from {least:g} to {most:g}, got {values}"
                )
        follows = np.asarray(self.follows, dtype=np.float64) if {*map(len, self.follows)} == {classes} else np.empty(0)
        if follows.shape != (classes, classes) or not _sums_to_one(follows):
            raise ModelError(f"stream belief: follows: expected {classes} rows of {classes} shares that sum to 1")
        if not _sums_to_one(np.array(self.share)) or min(self.share) <= 0:
            raise ModelError(f"stream belief: share: expected shares above 0 that sum to 1, got {self.share}")
        for name, count in (("phases", self.phases), ("gap_phases", self.gap_phases)):
            if count < 1:
                raise ModelError(f"stream belief: {name}: expected at least 1, got {count}")
        if not self.span.half > 0:
            raise ModelError(f"stream belief: distances: expected a half above 0, got {self.distances}")

    @staticmethod
    def believing(share: tuple[float, ...]) -> "StreamBeliefModel":
        """Return the model that believes a recogniser as it is; `share` (K + 1,) is how often it met each class."""
        classes = len(share) - 1
        return StreamBeliefModel(
            follows=((1 / classes,) * classes,) * classes,
            rates=(0.0,) * classes,
            gap_share=(0.5,) * classes,
            gap_rate=0.0,
            share=share,
        )

    @property
    def classes(self) -> int:
        """The number of activities, K; "no activity" is not counted."""
        return len(self.rates)

    @property
    def span(self) -> DistanceRange:
        """The range of distances of the world."""
        return DistanceRange(*self.distances)

    def without_transitions(self) -> "StreamBeliefModel":
        """Return the model that does not know what follows what, nor after which activities gaps come."""
        count = self.classes
        mean = float(np.mean(self.gap_share))
        return replace(self, follows=((1 / count,) * count,) * count, gap_share=(mean,) * count)

    def without_durations(self) -> "StreamBeliefModel":
        """Return the model in which all activities last equally long in the mean, and age says nothing."""
        moving = np.array(self.rates)
        pooled = 0.0 if (moving == 0).any() else float(1 / np.mean(1 / moving))
        return replace(self, rates=(pooled,) * self.classes, phases=1, gap_phases=1)

    def without_viewpoint(self) -> "StreamBeliefModel":
        """Return the model to which a frame tells as much from everywhere."""
        return replace(self, view_weights=(self.view_weights[0], *(0.0,) * (VIEW_TERMS - 1)))


def _sums_to_one(shares: FloatArray) -> bool:
    return bool((shares >= 0).all() and np.allclose(shares.sum(axis=-1), 1, atol=1e-6))


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


class Evidence:
    """The evidence of each frame alone, from the outputs of a recogniser that accumulates.

    Args:
        model: the parameters.
    """

    def __init__(self, model: StreamBeliefModel) -> None:
        """Begin with a recogniser that has said nothing."""
        self._model = model
        self._prior = np.log(model.share)
        self._before: FloatArray = np.zeros(model.classes + 1)

    def likelihood(self, log_probs: FloatArray, viewpoint: FloatArray) -> FloatArray:
        """Return how likely a frame is under each class, (..., K + 1), up to a factor; the likeliest has 1.

        Args:
            log_probs: (..., K + 1), the recogniser's log-probabilities after the frame.
            viewpoint: (..., 3), the camera's viewpoint.
        """
        said = np.maximum(np.asarray(log_probs, dtype=np.float64), LEAST_LOG_PROB) - self._prior
        terms = noise_basis(np.asarray(viewpoint, dtype=np.float64), 0.0, self._model.span)[..., :VIEW_TERMS]
        weight = np.exp(terms @ np.array(self._model.view_weights))
        log_likelihood = weight[..., None] * (said - self._model.kept * self._before)
        self._before = said
        log_likelihood = log_likelihood - log_likelihood.max(axis=-1, keepdims=True)
        likelihood: FloatArray = np.exp(np.maximum(log_likelihood, LEAST_LOG_LIKELIHOOD))
        return likelihood


class StreamBelief:
    """The filter over B streams in lockstep; a frame costs the same however long they last.

    Args:
        model: the parameters.
        fps: frames per second.
    """

    def __init__(self, model: StreamBeliefModel, *, fps: float) -> None:
        """Create the filter; `start` it before the first frame."""
        self.model = model
        self._seconds = 1 / fps
        self.start(1)

    def start(self, streams: int) -> None:
        """Forget everything, and begin B streams."""
        self._evidence, self._first = Evidence(self.model), True
        self._chain = begin(self.model, streams)

    def update(self, log_probs: FloatArray, viewpoint: FloatArray) -> None:
        """Take in the recognition after one more frame.

        Args:
            log_probs: (B, K + 1), the recogniser's log-probabilities; the last class is no activity.
            viewpoint: (B, 3), the camera's viewpoint.
        """
        before = self._chain if self._first else advance(self.model, self._chain, self._seconds)
        likelihood = self._evidence.likelihood(log_probs, viewpoint)
        activity = before.activity * likelihood[:, :NO_ACTIVITY, None]
        gap = before.gap * likelihood[:, NO_ACTIVITY, None, None]
        total = activity.sum(axis=(1, 2)) + gap.sum(axis=(1, 2))
        self._chain = Chain(activity / total[:, None, None], gap / total[:, None, None])
        self._first = False

    @property
    def probabilities(self) -> FloatArray:
        """The believed probabilities of the K activities and, last, of none, (B, K + 1)."""
        return self._chain.classes

    def expected(self, shares: FloatArray) -> FloatArray:
        """Return the expected share of each class in the frames to come, (B, K + 1); `shares` are `coming_shares`."""
        states = np.concatenate([part.reshape(len(part), -1) for part in self._chain], axis=1)
        expected: FloatArray = states @ shares
        return expected


class OneStreamBelief:
    """The filter over a single stream, live: filterpy's discrete Bayes filter.

    `filterpy.discrete_bayes.predict` shifts and convolves, which suits places along a line. Activities follow each
    other in any order, so the prediction is a product with the matrix of transitions. The update is filterpy's.

    Args:
        model: the parameters.
        fps: frames per second.
    """

    def __init__(self, model: StreamBeliefModel, *, fps: float) -> None:
        """Create the filter; `start` it before the first frame."""
        self.model = model
        self._transitions = transition_matrix(model, 1 / fps)
        self.start()

    def start(self) -> None:
        """Forget everything, and begin a stream."""
        self._evidence, self._first = Evidence(self.model), True
        self._states = np.concatenate([part.ravel() for part in begin(self.model, 1)])

    def update(self, log_probs: FloatArray, viewpoint: FloatArray) -> None:
        """Take in the recognition after one more frame.

        Args:
            log_probs: (K + 1,), the recogniser's log-probabilities; the last class is no activity.
            viewpoint: (3,), the camera's viewpoint.
        """
        from filterpy.discrete_bayes import update  # imported here: batches do not need it

        before = self._states if self._first else self._states @ self._transitions
        likelihood = self._evidence.likelihood(log_probs, viewpoint)
        self._states = update(likelihood[classes_of_states(self.model)], before)
        self._first = False

    @property
    def probabilities(self) -> FloatArray:
        """The believed probabilities of the K activities and, last, of none, (K + 1,)."""
        of_class: FloatArray = np.bincount(classes_of_states(self.model), weights=self._states).astype(np.float64)
        return of_class


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


def coming_shares(model: StreamBeliefModel, *, fps: float, frames: int) -> FloatArray:
    """Return the share of the next frames that is expected to show each class, from each state, (S, K + 1).

    Nothing is seen of them yet: the present activity goes on for as long as such ones last, and then comes what
    follows it. States are those of `transition_matrix`.

    Args:
        model: the parameters.
        fps: frames per second.
        frames: number of frames to come.
    """
    step = transition_matrix(model, 1 / fps)
    later = np.eye(model.classes + 1)[classes_of_states(model)]
    total = np.zeros_like(later)
    for _ in range(frames):
        later = step @ later
        total += later
    return total / frames


def read_streams(
    model: StreamBeliefModel,
    log_probs: FloatArray,
    viewpoints: FloatArray,
    *,
    fps: float,
    shares: FloatArray | None = None,
) -> FloatArray:
    """Return the belief after every frame of recorded streams.

    Args:
        model: the parameters.
        log_probs: (B, T, K + 1), the recogniser's log-probabilities after every frame.
        viewpoints: (B, T, 3).
        fps: frames per second.
        shares: `coming_shares`, for what is expected to come instead of what is shown now.

    Returns:
        probabilities (B, T, K + 1).
    """
    belief = StreamBelief(model, fps=fps)
    belief.start(len(log_probs))
    believed = np.empty(log_probs.shape)
    for frame in range(log_probs.shape[1]):
        belief.update(log_probs[:, frame], viewpoints[:, frame])
        believed[:, frame] = belief.probabilities if shares is None else belief.expected(shares)
    return believed


def read_belief(
    model: BeliefModel | StreamBeliefModel, log_probs: FloatArray, viewpoints: FloatArray, *, fps: float
) -> FloatArray:
    """Return the believed log-probabilities after every frame of recorded rollouts, of clips or of streams.

    Args:
        model: the parameters.
        log_probs: (B, L, K), the recogniser's log-probabilities after every frame.
        viewpoints: (B, L, 3).
        fps: frames per second.
    """
    if isinstance(model, BeliefModel):
        return readout(model, log_probs, viewpoints)
    believed: FloatArray = np.log(np.maximum(read_streams(model, log_probs, viewpoints, fps=fps), LEAST_PROBABILITY))
    return believed
