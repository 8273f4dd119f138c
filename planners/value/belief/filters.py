"""The Bayes filter over activities in streams: many streams at once, or a single one by filterpy."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.streams.data import NO_ACTIVITY
from planners.value.belief.chain import Chain, advance, begin, classes_of_states, transition_matrix
from planners.value.belief.clips import noise_basis
from planners.value.belief.streams import VIEW_TERMS, StreamBeliefModel

LEAST_LOG_PROB = -16.0  # log-probabilities below it count as it: the difference of two infinite ones is no evidence
LEAST_LOG_LIKELIHOOD = -60.0  # below the likeliest class; filterpy's update divides by zero where every product is zero


class Evidence:
    """The evidence of each frame alone, from the outputs of a recogniser that accumulates.

    Args:
        model: the parameters.
    """

    def __init__(self, model: StreamBeliefModel) -> None:
        """Begin with a recogniser that has said nothing."""
        self._model = model
        self._prior = np.log(model.prior)
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
        """Return the expected share of each class in frames to come, (..., B, K + 1).

        Args:
            shares: (..., S, K + 1), as `coming_shares` has them.
        """
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
