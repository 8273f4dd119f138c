"""The parameters of the belief in streams: how long activities last, what follows what, and what a frame tells."""

from dataclasses import dataclass, replace

import numpy as np

from ehar.arrays import FloatArray
from ehar.errors import ModelError
from planners.value.belief.clips import NOISE_BASIS
from planners.value.view_basis import PAPER_RANGE, DistanceRange

VIEW_TERMS = NOISE_BASIS - 1  # the terms of `noise_basis` but the last: a stream has no observation ratio


@dataclass(frozen=True, kw_only=True)
class StreamBeliefModel:
    r"""The parameters of the belief in a stream; learned on training data (`planners.value.belief.streams_fit`).

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
    independent evidence. Let :math:`y_t` be its log-probabilities, less the log of `learned`: what it expects before it
    sees anything. The log-likelihood of frame t is the weighted increment

    .. math:: z_t = e^{w \cdot \psi_t} (y_t - \rho\, y_{t-1}), \quad y_0 = 0,

    with the terms :math:`\psi` of `planners.value.belief.clips.noise_basis` but its last. Where nothing ever ends and
    all increments count alike, the belief is what the recogniser says (`believing`).

    Args:
        follows: (K, K), the activity that comes after each one; rows sum to 1.
        rates: (K,), one over the mean duration of each activity [1/s].
        gap_share: (K,), how likely each activity is followed by a gap.
        gap_rate: one over the mean duration of a gap [1/s].
        share: (K + 1,), the share of time of each activity and, last, of no activity; where a stream begins.
        learned: (K + 1,), the same in the recogniser's training, as frames counted there; None means `share`.
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
    learned: tuple[float, ...] | None = None
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
            ("kept", (self.kept,), 0.0, 1.0),
            ("view_weights", self.view_weights, -np.inf, np.inf),
            ("distances", self.distances, -np.inf, np.inf),
        ):
            size = {"gap_share": classes, "view_weights": VIEW_TERMS, "distances": 2}
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
            raise ModelError(
                f"stream belief: follows: expected {classes} rows of {classes} shares that sum to 1, got {self.follows}"
            )
        for name, shares in (("share", self.share), ("learned", self.prior)):
            if len(shares) != classes + 1 or not _sums_to_one(np.array(shares)) or min(shares) <= 0:
                raise ModelError(
                    f"stream belief: {name}: expected {classes + 1} shares above 0 that sum to 1, got {shares}"
                )
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
    def prior(self) -> tuple[float, ...]:
        """What the recogniser expects before it sees anything, (K + 1,)."""
        return self.share if self.learned is None else self.learned

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


def _sums_to_one(shares: FloatArray) -> bool:
    return bool((shares >= 0).all() and np.allclose(shares.sum(axis=-1), 1, atol=1e-6))
