"""Fits the belief to recorded rollouts of training data, and shows the effect of each of its parts."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from ehar.arrays import FloatArray, IntArray
from ehar.errors import DataError
from planners.value.belief.clips import (
    NOISE_BASIS,
    BeliefModel,
    Evidence,
    FilterState,
    filter_frame,
    knot_weights,
    moderated,
    noise_basis,
    readout,
)
from planners.value.view_basis import PAPER_RANGE, DistanceRange
from recognition.calibration import KNOTS

STEPS = 60  # most steps of L-BFGS, which usually needs fewer
MOST_CORRELATION = 0.98

# Means and standard deviations of a normal prior on the parameters. The prior weighs as much as one sequence. It is
# centred on the recogniser, so scarce data changes little.
SCALE_PRIOR = (0.0, 0.5)  # log_scale
GAIN_PRIOR = (0.0, 0.3)  # log_gain + log_scale: together they leave the recogniser as it is
NOISE_PRIOR = (-2.0, 2.0)  # the constant log-variance
NOISE_SLOPE_PRIOR = (0.0, 0.5)  # the log-variance's other weights
PROCESS_PRIOR = (-8.0, 1.5)  # log of process noise over measurement noise
CORRELATION_PRIOR = (0.0, 2.0)  # its logit: receptive fields of neighbouring frames overlap by an unknown amount
VARIANCE_PRIOR = (2.0, 2.0)  # log of the prior variance
PRIORS = (
    (len(KNOTS), SCALE_PRIOR),
    (len(KNOTS), GAIN_PRIOR),
    (1, NOISE_PRIOR),
    (NOISE_BASIS - 1, NOISE_SLOPE_PRIOR),
    (1, PROCESS_PRIOR),
    (1, CORRELATION_PRIOR),
    (1, VARIANCE_PRIOR),
)
PARAMETERS = sum(size for size, _ in PRIORS)
WORSE_WEIGHT = 3.0  # extra weight of a frame where the belief is worse than the recogniser: no frame should lose
KNOT_STEP = 0.2  # standard deviation of the change from one knot to the next


@dataclass(frozen=True)
class BeliefParts:
    """The parts of the belief that are fitted; the filter does without the others.

    Args:
        evidence: "difference", or "accumulated" for the recogniser's outputs as they are.
        whitening: the correlation of neighbouring frames' noise.
        process_noise: noise of the random walk of the log-odds.
        viewpoint: measurement noise that depends on viewpoint and observation ratio.
    """

    evidence: Evidence = "difference"
    whitening: bool = True
    process_noise: bool = True
    viewpoint: bool = True


ABLATIONS = {
    "accumulated": BeliefParts("accumulated", whitening=False, process_noise=False, viewpoint=False),
    "difference": BeliefParts(whitening=False, process_noise=False, viewpoint=False),
    "+ whitening": BeliefParts(process_noise=False, viewpoint=False),
    "+ process noise": BeliefParts(whitening=False, viewpoint=False),
    "+ R(viewpoint, ratio)": BeliefParts(whitening=False, process_noise=False),
    "full": BeliefParts(),
}


class BeliefAblation(NamedTuple):
    """The belief on held-out sequences, with and without each of its parts."""

    labels: IntArray  # (n,)
    log_probs: dict[str, FloatArray]  # of the recogniser and of each of `ABLATIONS`, (n, L, K)


class _Parameters(NamedTuple):
    """The parameters of `BeliefModel` while they are fitted."""

    log_scale: Tensor
    log_gain: Tensor
    noise_weights: Tensor
    process_noise: Tensor
    correlation: Tensor
    prior_variance: Tensor


def fit_belief(
    log_probs: FloatArray,
    viewpoints: FloatArray,
    labels: IntArray,
    groups: IntArray,
    parts: BeliefParts | None = None,
    *,
    span: DistanceRange = PAPER_RANGE,
) -> BeliefModel:
    """Return the belief that minimises the mean NLL of rollouts over all frames, with a weak prior.

    A frame where the belief is worse than the recogniser counts several times. Frames of one sequence are similar, so a
    sequence, not a frame, weighs as one observation against the prior. The same rollouts always give the same belief.

    Args:
        log_probs: (N, L, K), the recogniser's log-probabilities after every frame.
        viewpoints: (N, L, 3).
        labels: (N,), the true classes.
        groups: (N,), the sequence that each rollout was cut from.
        parts: which parts to fit; all of them by default.
        span: the range of distances of the world.

    Raises:
        DataError: there are no rollouts, or their numbers disagree.
    """
    if not len(log_probs) or any(len(array) != len(log_probs) for array in (viewpoints, labels, groups)):
        counts = ", ".join(str(len(array)) for array in (log_probs, viewpoints, labels, groups))
        raise DataError(
            f"belief: expected log_probs, viewpoints, labels and groups in equal number, at least 1, got {counts}"
        )
    parts = parts or BeliefParts()
    length = log_probs.shape[1]
    ratio = np.arange(1, length + 1) / length
    centred = log_probs.astype(np.float64) - log_probs.mean(axis=-1, keepdims=True, dtype=np.float64)
    rollouts = _Rollouts(
        logits=torch.from_numpy(centred.swapaxes(0, 1).copy()),
        terms=torch.from_numpy(noise_basis(viewpoints, ratio, span).swapaxes(0, 1).copy()),
        knots=torch.from_numpy(knot_weights(ratio)),
        labels=torch.from_numpy(labels.astype(np.int64)),
    )
    deviations = torch.zeros(PARAMETERS, dtype=torch.float64, requires_grad=True)
    optimiser = torch.optim.LBFGS([deviations], max_iter=STEPS, history_size=20, line_search_fn="strong_wolfe")
    nll_of_recogniser = torch.stack([functional.cross_entropy(logits, rollouts.labels) for logits in rollouts.logits])
    prior_weight = 0.5 / len(np.unique(groups))

    def closure() -> float:
        optimiser.zero_grad()
        parameters = _parameters(deviations, parts)
        jumps = torch.cat([knots.diff() for knots in (parameters.log_scale, parameters.log_gain)]) / KNOT_STEP
        nll = _nll(parameters, parts.evidence, rollouts)
        loss = nll.mean() + WORSE_WEIGHT * torch.relu(nll - nll_of_recogniser).mean()
        loss = loss + prior_weight * (deviations.square().sum() + jumps.square().sum())
        loss.backward()  # type: ignore[no-untyped-call]
        return float(loss.detach())

    optimiser.step(closure)  # type: ignore[no-untyped-call]
    with torch.no_grad():
        fitted = _parameters(deviations, parts)
    return BeliefModel(
        log_scale=tuple(fitted.log_scale.tolist()),
        log_gain=tuple(fitted.log_gain.tolist()),
        noise_weights=tuple(fitted.noise_weights.tolist()),
        process_noise=float(fitted.process_noise),
        correlation=float(fitted.correlation),
        prior_variance=float(fitted.prior_variance),
        evidence=parts.evidence,
        distances=(span.middle, span.half),
    )


def ablate_belief(
    log_probs: FloatArray,
    viewpoints: FloatArray,
    labels: IntArray,
    groups: IntArray,
    rng: np.random.Generator,
    *,
    span: DistanceRange = PAPER_RANGE,
) -> BeliefAblation:
    """Fit the belief without some of its parts on one half of the sequences; read it out on the other half.

    Each "+" adds one part to "difference" alone. Scores are computed as for any other planner.

    Args:
        log_probs: (N, L, K), the recogniser's log-probabilities.
        viewpoints: (N, L, 3).
        labels: (N,).
        groups: (N,), the sequence that each rollout was cut from.
        rng: draws the halves.
        span: the range of distances of the world.

    Raises:
        DataError: there are fewer than two sequences.
    """
    sequences = rng.permutation(np.unique(groups))
    if len(sequences) < 2:
        raise DataError(
            f"belief: expected rollouts of at least 2 sequences to hold out half of them, got {len(sequences)}"
        )
    held = np.isin(groups, sequences[: len(sequences) // 2])
    believed = {"recogniser": log_probs[held]}
    for name, parts in ABLATIONS.items():
        model = fit_belief(log_probs[~held], viewpoints[~held], labels[~held], groups[~held], parts, span=span)
        believed[name] = readout(model, log_probs[held], viewpoints[held])
    return BeliefAblation(labels[held], believed)


class _Rollouts(NamedTuple):
    """The data of the fit, frames first."""

    logits: Tensor  # (L, N, K), centred
    terms: Tensor  # (L, N, NOISE_BASIS)
    knots: Tensor  # (L, knots)
    labels: Tensor  # (N,)


def _parameters(deviations: Tensor, parts: BeliefParts) -> _Parameters:
    """Return the parameters that lie `deviations` standard deviations from their prior means."""
    blocks = torch.split(deviations, [size for size, _ in PRIORS])
    scale, gain, noise, slopes, process, correlation, variance = (
        mean + deviation * block for (_, (mean, deviation)), block in zip(PRIORS, blocks, strict=True)
    )
    nothing = torch.zeros((), dtype=torch.float64)
    return _Parameters(
        log_scale=scale,
        log_gain=gain - scale,
        noise_weights=torch.cat([noise, slopes if parts.viewpoint else 0 * slopes]),
        process_noise=(process + noise).exp().squeeze() if parts.process_noise else nothing,
        correlation=MOST_CORRELATION * torch.sigmoid(correlation).squeeze() if parts.whitening else nothing,
        prior_variance=variance.exp().squeeze(),
    )


def _nll(parameters: _Parameters, evidence: Evidence, rollouts: _Rollouts) -> Tensor:
    """Return the mean NLL over episodes at every frame, (L,)."""
    length, episodes, classes = rollouts.logits.shape
    logits = (rollouts.knots @ parameters.log_scale).exp()[:, None, None] * rollouts.logits
    noise = (rollouts.terms @ parameters.noise_weights).exp()
    log_gain = rollouts.knots @ parameters.log_gain
    nothing = logits.new_zeros(episodes, classes)
    state = FilterState(nothing, parameters.prior_variance.expand(episodes), nothing, nothing)
    losses = []
    for frame in range(length):
        state = filter_frame(
            state,
            logits[frame],
            frame,
            noise[frame],
            process_noise=parameters.process_noise,
            correlation=parameters.correlation,
            evidence=evidence,
        )
        losses.append(functional.cross_entropy(moderated(state, log_gain[frame]), rollouts.labels))
    return torch.stack(losses)
