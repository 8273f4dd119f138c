"""Learns the belief in streams: how long activities last and what follows what, and what a frame tells."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit, gammaln

from ehar.arrays import FloatArray, IntArray
from ehar.data.streams.data import NO_ACTIVITY, StreamData
from ehar.errors import DataError
from planners.value.belief.filters import read_streams
from planners.value.belief.streams import VIEW_TERMS, StreamBeliefModel
from planners.value.view_basis import PAPER_RANGE, DistanceRange
from recognition.training.frame_weights import frame_weights

MOST_PHASES = 8  # the standard deviation of a duration is then a third of its mean
SMOOTHINGS = (1.0, 3.0, 10.0, 30.0, 100.0, 1000.0)  # activities that a row of transitions may be smoothed by
TIE = 1e-9  # log-likelihoods that differ by less are equal
GAP_SECONDS = 1.0  # the prior mean of a gap: joins of stitched streams last 0.5 to 1.5 s
STEPS = 40  # most steps of L-BFGS

# Means and standard deviations of a normal prior on the parameters of the evidence. The prior weighs as much as one
# rollout, of which a stream has many. It is centred on the recogniser's increments as they are, so scarce data changes
# little.
WEIGHT_PRIOR = (0.0, 0.5)  # the constant of view_weights
SLOPE_PRIOR = (0.0, 0.5)  # the others
KEPT_PRIOR = (3.0, 2.0)  # the logit of kept


class Spans(NamedTuple):
    """The activities and gaps of some streams."""

    classes: IntArray  # (N,)
    seconds: FloatArray  # (N,)
    gaps: FloatArray  # (G,), the durations of gaps [s], also at the beginning and end of a stream
    followed: IntArray  # (n, 2), each activity and the next one of its stream
    gap_after: IntArray  # (n,), 1 if there is a gap between these two, or else 0


def learn_chain(streams: StreamData, part: IntArray, known: IntArray) -> StreamBeliefModel:
    """Return the belief with the durations and transitions of some streams; it takes increments as they are.

    A duration is smoothed by one activity of mean duration. Transitions are smoothed by how often each activity comes,
    as much as makes left-out ones likeliest: where activities come in any order, few pairs were seen, and say nothing.
    The number of phases is the likeliest one, the same for all activities: each is judged by what the others say of its
    duration, or few would seem to vary less than they do. Activities that the end of a stream cuts off
    count as if they had ended there.

    Args:
        streams: streams with their segments.
        part: indices of the streams to learn from, of the policy part.
        known: indices of the streams that the recogniser learned from. How often it met a class there it expects it.

    Raises:
        DataError: there are no streams, or one of the classes has no segment in them.
    """
    spans, met = spans_of(streams, part), spans_of(streams, known)
    count = len(streams.class_names)
    times = np.bincount(spans.classes, minlength=count)
    if not times.all():
        absent = ", ".join(repr(streams.class_names[label]) for label in np.flatnonzero(times == 0))
        raise DataError(
            f"{streams.name}: expected segments of every class in the {len(part)} streams that the belief learns from, "
            f"got none of {absent}"
        )
    pooled = spans.seconds.mean()
    total = np.bincount(spans.classes, weights=spans.seconds, minlength=count)
    mean, by_others = (total + pooled) / (times + 1), (total + pooled)[spans.classes] - spans.seconds
    gap_mean = (spans.gaps.sum() + GAP_SECONDS) / (len(spans.gaps) + 1)
    pairs = np.zeros((count, count))
    np.add.at(pairs, tuple(spans.followed.T), 1)
    gaps = np.bincount(spans.followed[:, 0], weights=spans.gap_after, minlength=count)
    usual = (spans.gap_after.sum() + 0.5) / (len(spans.gap_after) + 1)
    weights = frame_weights(streams, known)
    learned = _shares(met, count, pooled) * (1.0 if weights is None else weights)
    follows = pairs + likeliest_smoothing(pairs, times / times.sum()) * times / times.sum()
    return StreamBeliefModel(
        follows=tuple(map(tuple, (follows / follows.sum(axis=1, keepdims=True)).tolist())),
        rates=tuple((1 / mean).tolist()),
        gap_share=tuple(((gaps + usual) / (pairs.sum(axis=1) + 1)).tolist()),
        gap_rate=float(1 / gap_mean),
        share=tuple(_shares(spans, count, pooled).tolist()),
        learned=tuple((learned / learned.sum()).tolist()),
        phases=likeliest_phases(spans.seconds, by_others / times[spans.classes], streams.fps),
        gap_phases=likeliest_phases(spans.gaps, np.full(len(spans.gaps), gap_mean), streams.fps),
    )


def _shares(spans: Spans, count: int, seconds: float) -> FloatArray:
    """Return the share of time of each activity and, last, of none, (K + 1,); `seconds` are divided among all."""
    times = np.append(np.bincount(spans.classes, weights=spans.seconds, minlength=count), spans.gaps.sum())
    times = times + seconds / (count + 1)
    shares: FloatArray = times / times.sum()
    return shares


def spans_of(streams: StreamData, part: IntArray) -> Spans:
    """Return the activities and gaps of the streams with these indices."""
    kept = streams.segments[np.isin(streams.stream_of, part)]
    stream = np.searchsorted(streams.offsets, kept[:, 0], side="right") - 1
    same = stream[1:] == stream[:-1]
    between = kept[1:, 0] - kept[:-1, 1]
    gaps = [*between[same & (between > 0)].tolist()]
    for index in part:
        inside = kept[stream == index]
        first, end = streams.offsets[index], streams.offsets[index + 1]
        ends = (inside[0, 0] - first, end - inside[-1, 1]) if len(inside) else (end - first,)
        gaps += [int(frames) for frames in ends if frames > 0]
    return Spans(
        classes=kept[:, 2],
        seconds=(kept[:, 1] - kept[:, 0]) / streams.fps,
        gaps=np.array(gaps, dtype=np.float64) / streams.fps,
        followed=np.stack([kept[:-1, 2], kept[1:, 2]], axis=1)[same],
        gap_after=(between > 0)[same].astype(np.int64),
    )


def likeliest_smoothing(pairs: FloatArray, usual: FloatArray) -> float:
    """Return the one of `SMOOTHINGS` under which each transition is likeliest, given all others.

    Args:
        pairs: (K, K), how often each activity is followed by each one.
        usual: (K,), the share of each activity.
    """
    weight = np.array(SMOOTHINGS)[:, None, None]
    others, of_row = np.maximum(pairs - 1, 0), np.maximum(pairs.sum(axis=1, keepdims=True) - 1, 0)
    log_likelihood = np.log((others + weight * usual) / (of_row + weight))
    total = (pairs * log_likelihood).sum(axis=(1, 2))
    return SMOOTHINGS[int(np.flatnonzero(total > total.max() - TIE)[-1])]  # of several, the one that claims least


def likeliest_phases(seconds: FloatArray, means: FloatArray, fps: float) -> int:
    """Return the number of phases, up to `MOST_PHASES`, under which durations with these means are likeliest.

    With n phases, each of which is left with the probability p = n / (mean fps) in a frame, a duration has the variance
    (1 - p) mean^2 / n. It is scored as the gamma distribution of that mean and variance, of shape n / (1 - p). So many
    phases that a frame is longer than one of them are not for the chain: durations could not vary.

    Args:
        seconds: (N,), the durations [s]; if there are none, the answer is 1.
        means: (N,), what each is expected to be [s].
        fps: frames per second of the chain.
    """
    phases = np.arange(1, MOST_PHASES + 1)[:, None]
    left = phases / (means * fps)
    shape = phases / np.maximum(1 - left, 1e-9)
    scale = means / shape
    log_likelihood = (shape - 1) * np.log(seconds) - seconds / scale - shape * np.log(scale) - gammaln(shape)
    total = np.where((left < 1).all(axis=1), log_likelihood.sum(axis=1), -np.inf)
    return int(total.argmax()) + 1


def fit_evidence(
    model: StreamBeliefModel,
    log_probs: FloatArray,
    viewpoints: FloatArray,
    labels: IntArray,
    *,
    fps: float,
    viewpoint: bool = True,
    span: DistanceRange = PAPER_RANGE,
) -> StreamBeliefModel:
    """Return the belief with the weights of evidence that minimise the mean NLL of recorded streams, with a weak prior.

    The five parameters are few enough for finite differences. The same streams always give the same belief.

    Args:
        model: the belief with its transitions, which stay.
        log_probs: (N, T, K + 1), the recogniser's log-probabilities after every frame of rollouts.
        viewpoints: (N, T, 3).
        labels: (N, T), the true class of each frame; `NO_ACTIVITY` where there is none.
        fps: frames per second.
        viewpoint: whether a frame may tell more from some places than from others.
        span: the range of distances of the world.

    Raises:
        DataError: there are no streams, or shapes disagree.
    """
    expected = (*labels.shape, model.classes + 1)
    if not labels.size or log_probs.shape != expected or viewpoints.shape != (*labels.shape, 3):
        raise DataError(
            f"stream belief: expected at least one stream, log_probs {expected} and viewpoints {(*labels.shape, 3)}, "
            f"got {log_probs.shape} and {viewpoints.shape}"
        )
    prior_weight = 0.5 / len(labels)
    true = np.where(labels == NO_ACTIVITY, model.classes, labels)[..., None]

    def loss(deviations: FloatArray) -> float:
        candidate = _with_evidence(model, deviations, viewpoint, span)
        believed = read_streams(candidate, log_probs, viewpoints, fps=fps)
        of_true = np.take_along_axis(believed, true, axis=-1)
        return float(-np.log(np.maximum(of_true, 1e-12)).mean() + prior_weight * np.square(deviations).sum())

    found = minimize(loss, np.zeros(VIEW_TERMS + 1), method="L-BFGS-B", options={"maxiter": STEPS})
    return _with_evidence(model, found.x, viewpoint, span)


def _with_evidence(
    model: StreamBeliefModel, deviations: FloatArray, viewpoint: bool, span: DistanceRange
) -> StreamBeliefModel:
    """Return the belief whose evidence lies `deviations` standard deviations from the prior means."""
    (weight, weight_sd), (slope, slope_sd), (kept, kept_sd) = WEIGHT_PRIOR, SLOPE_PRIOR, KEPT_PRIOR
    slopes = (slope + slope_sd * deviations[1:VIEW_TERMS]) * viewpoint
    return replace(
        model,
        view_weights=(float(weight + weight_sd * deviations[0]), *slopes.tolist()),
        kept=float(expit(kept + kept_sd * deviations[VIEW_TERMS])),
        distances=(span.middle, span.half),
    )
