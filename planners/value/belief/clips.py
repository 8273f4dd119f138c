"""The belief about the activity: a Kalman filter over class log-odds, many episodes at once."""

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from scipy.special import log_softmax

from ehar.arrays import FloatArray
from ehar.errors import ModelError
from ehar.viewpoint import DISTANCE, POLAR
from planners.value.view_basis import PAPER_RANGE, DistanceRange
from recognition.calibration import KNOTS

Evidence = Literal["difference", "accumulated"]

NOISE_BASIS = 5  # the terms of `noise_basis`
CERTAIN = -8.0  # log-variance of evidence beside which the default prior is flat and moderation has no effect


@dataclass(frozen=True)
class BeliefModel:
    r"""The parameters of the belief about an activity; fitted on training data (`planners.value.belief.clips_fit`).

    The state :math:`x_t \in R^K` holds the centred log-odds of the classes. It is a random walk, since an activity
    unfolds:

    .. math:: x_t = x_{t-1} + w_t, \quad w_t \sim N(0, q I), \quad x_1 \sim N(0, p_0 I).

    The recogniser averages over the frames so far. Its outputs are therefore not independent evidence, and a product
    of them would count early frames many times. Let :math:`y_n` be its centred log-probabilities, scaled by
    :math:`e^{a(n / L)}`. The evidence of frame n alone is the difference

    .. math:: z_n = n y_n - (n - 1) y_{n-1} = x_n + v_n, \quad v_n = \rho v_{n-1} + e_n, \quad e_n \sim N(0, R_n I),

    Its noise is still coloured, because neighbouring frames are seen through overlapping windows. Measurement
    differencing (Bryson and Henrikson 1968) whitens it: :math:`z_n - \rho z_{n-1} = (1 - \rho) x_n + \rho w_n + e_n`.
    The noise of this measurement is correlated with that of the process. The noise depends on the viewpoint and on the
    observation ratio: :math:`R_n = \exp(r \cdot \psi)` with the terms of `noise_basis`.

    Probabilities are the softmax of :math:`e^{g(n / L)} \kappa(P) x_n`. The factor
    :math:`\kappa(P) = (1 + \pi P / 8)^{-1/2}` moderates an uncertain mean (MacKay 1992, The evidence framework applied
    to classification networks). Functions a and g are linear between the knots of `recognition.calibration`.

    The default believes the recogniser: its mean and its probabilities are the recogniser's.

    Args:
        log_scale: a at the knots; it undoes the effect of the recogniser's temperature.
        log_gain: g at the knots.
        noise_weights: r, one for each term of `noise_basis`.
        process_noise: q, for each frame.
        correlation: rho, in [0, 1).
        prior_variance: p_0.
        evidence: "difference" as above; "accumulated" takes :math:`y_n` itself as new evidence (for comparison).
        distances: middle and half of the range of distances of the world that it was fitted in [m].
    """

    log_scale: tuple[float, ...] = (0.0,) * len(KNOTS)
    log_gain: tuple[float, ...] = (0.0,) * len(KNOTS)
    noise_weights: tuple[float, ...] = (CERTAIN,) + (0.0,) * (NOISE_BASIS - 1)
    process_noise: float = 0.0
    correlation: float = 0.0
    prior_variance: float = 1.0
    evidence: Evidence = "difference"
    distances: tuple[float, float] = (PAPER_RANGE.middle, PAPER_RANGE.half)

    def __post_init__(self) -> None:
        """Raise ModelError if a parameter is out of range."""
        for name, size in (("log_scale", len(KNOTS)), ("log_gain", len(KNOTS)), ("noise_weights", NOISE_BASIS)):
            values = getattr(self, name)
            if len(values) != size or not np.isfinite(values).all():
                raise ModelError(f"belief: {name}: expected {size} finite numbers, got {values}")
        if not (np.isfinite(self.process_noise) and self.process_noise >= 0):
            raise ModelError(f"belief: process_noise: expected a finite number of at least 0, got {self.process_noise}")
        if not 0 <= self.correlation < 1:
            raise ModelError(f"belief: correlation: expected a number in [0, 1), got {self.correlation}")
        if not (np.isfinite(self.prior_variance) and self.prior_variance > 0):
            raise ModelError(f"belief: prior_variance: expected a finite number above 0, got {self.prior_variance}")
        if self.evidence not in get_args(Evidence):
            raise ModelError(f"belief: evidence: expected {' or '.join(get_args(Evidence))}, got {self.evidence!r}")
        if not (np.isfinite(self.distances).all() and self.span.half > 0):
            raise ModelError(f"belief: distances: expected a middle, and a half above 0, got {self.distances}")

    @property
    def span(self) -> DistanceRange:
        """The range of distances of the world."""
        return DistanceRange(*self.distances)


class FilterState(NamedTuple):
    """What the filter remembers of B episodes; arrays of numpy or torch."""

    mean: Any  # (B, K)
    variance: Any  # (B,)
    total: Any  # (B, K), the evidence of all frames so far
    evidence: Any  # (B, K), the evidence of the last frame


def noise_basis(viewpoint: FloatArray, ratio: FloatArray | float, span: DistanceRange) -> FloatArray:
    """Return the terms (..., 5) of the log-variance of evidence: 1, s, cos(polar), its square, observation ratio.

    Args:
        viewpoint: (..., 3). The distance enters as s, in [-1, 1] over the world's workspace.
        ratio: the observation ratio; it broadcasts against (...,).
        span: the range of distances of the world.
    """
    distance = (viewpoint[..., DISTANCE] - span.middle) / span.half
    height = np.cos(viewpoint[..., POLAR])
    share = np.broadcast_to(ratio, distance.shape)
    return np.stack([np.ones_like(distance), distance, height, height**2, share], axis=-1)


def knot_weights(ratio: FloatArray) -> FloatArray:
    """Return the share (..., knots) of each knot in the linear interpolation at observation ratios (...,)."""
    return np.stack([np.interp(ratio, KNOTS, unit) for unit in np.eye(len(KNOTS))], axis=-1)


def filter_frame(
    state: FilterState,
    logits: Any,
    frame: int,
    noise: Any,
    *,
    process_noise: Any,
    correlation: Any,
    evidence: Evidence,
) -> FilterState:
    """Return the state after one more frame; the formula serves numpy, and torch for the fit.

    Transition, measurement and every covariance are multiples of the K x K identity. Products, sums and inverses of
    such matrices are multiples of it too. So one variance for each episode is the exact covariance of all K classes.

    Args:
        state: the state before the frame.
        logits: (B, K), the recogniser's logits, centred and scaled.
        frame: index of the frame, 0 for the first of an episode.
        noise: R (B,).
        process_noise: q.
        correlation: rho.
        evidence: as in `BeliefModel`.
    """
    total = (frame + 1) * logits
    new = total - state.total if evidence == "difference" else logits
    if frame == 0:
        stationary = noise / (1 - correlation**2)  # the variance of v, where e has variance R
        gain = state.variance / (state.variance + stationary)
        return FilterState(state.mean + gain[:, None] * (new - state.mean), gain * stationary, total, new)
    sensitivity = 1 - correlation
    # The covariance of the new state with the measurement; divided by the variance of the measurement, it is the gain.
    covariance = sensitivity * state.variance + process_noise
    gain = covariance / (sensitivity**2 * state.variance + process_noise + noise)
    innovation = new - correlation * state.evidence - sensitivity * state.mean
    variance = state.variance + process_noise - gain * covariance
    return FilterState(state.mean + gain[:, None] * innovation, variance, total, new)


def moderated(state: FilterState, log_gain: Any) -> Any:
    """Return the logits (B, K) whose softmax gives the believed probabilities, as an array of the state's kind.

    Args:
        state: the state after a frame.
        log_gain: g at that frame, a number or a tensor.
    """
    return np.e**log_gain * (1 + np.pi / 8 * state.variance)[:, None] ** -0.5 * state.mean


class Belief:
    """The filter over B episodes in lockstep, in float64.

    Args:
        model: the fitted parameters.
    """

    def __init__(self, model: BeliefModel) -> None:
        """Create the filter; `start` it before the first frame."""
        self.model = model
        self.start(0, 1)

    def start(self, episodes: int, classes: int) -> None:
        """Forget everything, and begin B episodes with K classes."""
        nothing = np.zeros((episodes, classes))
        self._state = FilterState(nothing, np.full(episodes, self.model.prior_variance), nothing, nothing)
        self._log_gain = 0.0

    def update(self, log_probs: FloatArray, viewpoint: FloatArray, ratio: float, frame: int) -> None:
        """Take in the recognition after one more frame.

        Args:
            log_probs: (B, K), the recogniser's log-probabilities.
            viewpoint: (B, 3), the camera's viewpoint.
            ratio: the share of the episode that has been observed, in (0, 1].
            frame: index of the frame, 0 for the first; frames come one by one.
        """
        wide = np.asarray(log_probs, dtype=np.float64)
        knots = knot_weights(np.asarray(ratio))
        self._log_gain = float(knots @ self.model.log_gain)
        self._state = filter_frame(
            self._state,
            np.exp(knots @ self.model.log_scale) * (wide - wide.mean(axis=-1, keepdims=True)),
            frame,
            np.exp(noise_basis(viewpoint, ratio, self.model.span) @ np.array(self.model.noise_weights)),
            process_noise=self.model.process_noise,
            correlation=self.model.correlation,
            evidence=self.model.evidence,
        )

    @property
    def mean(self) -> FloatArray:
        """The believed log-odds, (B, K)."""
        mean: FloatArray = self._state.mean
        return mean

    @property
    def variance(self) -> FloatArray:
        """The variance of the log-odds, (B,), the same for every class."""
        variance: FloatArray = self._state.variance
        return variance

    @property
    def log_probs(self) -> FloatArray:
        """The believed log-probabilities, (B, K)."""
        log_probs: FloatArray = log_softmax(moderated(self._state, self._log_gain), axis=-1)
        return log_probs


def readout(model: BeliefModel, log_probs: FloatArray, viewpoints: FloatArray) -> FloatArray:
    """Return the belief after every frame of recorded rollouts.

    Args:
        model: the parameters of the belief.
        log_probs: (B, L, K), the recogniser's log-probabilities after every frame.
        viewpoints: (B, L, 3).

    Returns:
        log-probabilities (B, L, K).
    """
    episodes, length, classes = log_probs.shape
    belief = Belief(model)
    belief.start(episodes, classes)
    believed = np.empty((episodes, length, classes))
    for frame in range(length):
        belief.update(log_probs[:, frame], viewpoints[:, frame], (frame + 1) / length, frame)
        believed[:, frame] = belief.log_probs
    return believed
