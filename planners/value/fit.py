"""Fits gain fields to branching rollouts: ridge regression of gained probability on paths and situations."""

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve

from ehar.arrays import BoolArray, FloatArray, IntArray
from planners.value.belief.chain import coming_shares
from planners.value.belief.clips import BeliefModel, readout
from planners.value.belief.filters import read_streams
from planners.value.belief.streams import StreamBeliefModel
from planners.value.collection import Collection
from planners.value.field import GainField, feature_matrix
from planners.value.situation import PARTS, STREAM_LOOKAHEAD, STREAM_PARTS, Situation, frames_ahead, views_counted
from planners.value.view_basis import BASIS_SIZE, SINES, basis_at, mean_direction, turned

VARIANTS: dict[str, tuple[str, ...]] = {
    "full": PARTS,
    "no-belief": tuple(part for part in PARTS if part != "belief"),
    "no-embedding": tuple(part for part in PARTS if part != "embedding"),
    "no-facing": tuple(part for part in PARTS if part != "facing"),
}
STREAM_VARIANTS = {name: tuple(part for part in parts if part in STREAM_PARTS) for name, parts in VARIANTS.items()}
EMBEDDING_DIRECTIONS = 12  # directions of most variance that the regression sees
PENALTIES = (1.0, 3.0, 10.0, 30.0, 100.0)  # candidates, as a share of the mean curvature
CONSTANT_SHARES = (0.003, 0.01, 0.03, 0.1, 0.3)  # candidates: share of the penalty for terms that do not vary
HANDEDNESS = 4.0  # factor of the penalty for functions that tell left from right: people are nearly symmetric
FOLDS = 5
SMALLEST_DEVIATION = 1e-9  # least standard deviation of a feature that is used
CHUNK = 256  # forks at a time, to save memory


class Scores(NamedTuple):
    """How well a field tells what paths gain, on people or sequences that it was not fitted on."""

    explained: float  # explained share of the squared gains
    chosen_gain: float  # gained probability of the path that the field picks at a fork, which may be to stay
    best_gain: float  # gained probability of the best path at a fork, known only in hindsight


class Fit(NamedTuple):
    """A field, and its scores in cross-validation."""

    field: GainField
    penalties: tuple[float, float]  # for terms that depend on the situation, and for those that do not
    scores: Scores


@dataclass(frozen=True, eq=False)
class _Rows:
    """The data of the regression: N forks of M - 1 paths, each compared with staying."""

    features: FloatArray  # (N, C) standardised, the first column 1
    path: FloatArray  # (N, M - 1, S): the basis along each path less that of staying
    spread: FloatArray  # (N, M - 1): how much more the path's directions spread
    gain: FloatArray  # (N, M - 1)
    weight: FloatArray  # (N,)

    def part(self, inside: BoolArray) -> "_Rows":
        return _Rows(*(getattr(self, field.name)[inside] for field in fields(self)))


class _Moments(NamedTuple):
    """The sums behind a ridge solution; those of two sets of rows add up.

    S is 20 or 40, without the constant function, which is no reason to go anywhere. Where something is in the way at
    times, it is 21 or 42.
    """

    moments: FloatArray  # (C * S + 1, C * S + 1), second moments of features x path, and of the spread
    response: FloatArray  # (C * S + 1,), their moments with the gain
    curvature: FloatArray  # (), the mean of the moments' diagonal over the constant's block


def fork_situations(collection: Collection, belief: BeliefModel) -> Situation:
    """Return the situations at all N forks of a collection of clips."""
    episode, frame = collection.episode, collection.frame
    believed = np.exp(readout(belief, collection.log_probs, collection.viewpoints))
    seen = np.cumsum(basis_at(collection.viewpoints, belief.span), axis=1)
    return Situation(
        ratio=(frame + 1) / believed.shape[1],
        belief=believed[episode, frame],
        embedding=collection.embedding,
        facing=collection.facing,
        facing_std=collection.facing_std,
        position=collection.position,
        seen=seen[episode, frame] / (frame + 1)[:, None],
    )


def stream_situations(
    collection: Collection,
    belief: StreamBeliefModel,
    *,
    fps: float,
    memory: float,
    lookahead: float = STREAM_LOOKAHEAD,
) -> Situation:
    """Return the situations at all N forks of a collection of streams.

    Args:
        collection: the rollouts.
        belief: the fitted belief.
        fps: frames per second.
        memory: time that a view counts for [s].
        lookahead: time over which the shares of activities are expected [s].
    """
    episode, frame = collection.episode, collection.frame
    shares = coming_shares(belief, fps=fps, ends=[frames_ahead(1 / fps, lookahead)])[0]
    expected = read_streams(belief, collection.log_probs, collection.viewpoints, fps=fps, shares=shares)
    seen, keep = basis_at(collection.viewpoints, belief.span), float(np.exp(-1 / (fps * memory)))
    for late in range(1, seen.shape[1]):
        seen[:, late] += keep * seen[:, late - 1]
    return Situation(
        ratio=None,
        belief=expected[episode, frame],
        embedding=collection.embedding,
        facing=collection.facing,
        facing_std=collection.facing_std,
        position=collection.position,
        seen=seen[episode, frame] / views_counted(keep, frame + 1)[:, None],
    )


def fit_field(
    collection: Collection, situation: Situation, parts: tuple[str, ...], groups: IntArray | None = None
) -> Fit:
    """Fit a field that depends on some parts of the situation; penalties are chosen by grouped cross-validation.

    Args:
        collection: the rollouts.
        situation: the situations at its forks.
        parts: parts of the situation.
        groups: (E,), who performs in each episode, so that folds differ in people; None means the sequences.
    """
    raw = feature_matrix(situation, parts)
    standardise = _standardiser(raw, situation, parts)
    frames = [collection.path]
    if "facing" in parts:
        frames.append(turned(collection.path, situation.reference[:, None]))
    spread = _spread(collection.path)
    length = collection.log_probs.shape[1]
    functions = BASIS_SIZE - int(np.ptp(collection.path[..., 0], axis=1).max() < SMALLEST_DEVIATION)
    rows = _Rows(
        features=raw @ standardise,
        path=np.concatenate([(along[:, 1:] - along[:, :1])[..., -functions:] for along in frames], axis=-1),
        spread=spread[:, 1:] - spread[:, :1],
        gain=collection.worth[:, 1:] - collection.worth[:, :1],
        weight=collection.frames / length,
    )
    groups = collection.sequences if groups is None else groups
    penalties, scores = _cross_validate(rows, groups[collection.episode])
    situated, spread_weight = _solve(_moments(rows), penalties, rows.features.shape[1])
    solution = standardise @ situated
    # In the open the constant function has weight 0: only differences are fitted. Without a reference direction, the
    # field has no relative terms.
    absolute, relative = np.zeros((2, len(solution), BASIS_SIZE))
    absolute[:, -functions:] = solution[:, :functions]
    if "facing" in parts:
        relative[:, -functions:] = solution[:, functions:]
    return Fit(GainField(parts, absolute, relative, spread_weight), penalties, scores)


def score_field(field: GainField, collection: Collection, situation: Situation) -> Scores:
    """Return how well a field does on rollouts that it was not fitted on, in the situations at their forks."""
    weights = field.weights(situation)
    value = np.einsum("nmk,nk->nm", collection.path, weights) + field.spread * _spread(collection.path)
    length = collection.log_probs.shape[1]
    gain = collection.worth[:, 1:] - collection.worth[:, :1]
    return _scores(value[:, 1:] - value[:, :1], gain, collection.frames / length)


def _spread(path: FloatArray) -> FloatArray:
    """Return how much the directions of paths (N, M, 21) spread, (N, M): 0 if all views are the same, or hidden."""
    spread: FloatArray = path[..., 0] ** 2 - (mean_direction(path) ** 2).sum(axis=-1)
    return spread


def _scores(predicted: FloatArray, gain: FloatArray, weight: FloatArray) -> Scores:
    """Return the scores of predicted gains (N, M - 1) of paths over staying, where each fork has a weight (N,)."""
    pick = np.argmax(predicted, axis=1)
    chosen = np.where(predicted.max(axis=1) > 0, gain[np.arange(len(pick)), pick], 0.0)
    lost, whole = (((values**2) * weight[:, None]).sum() for values in (predicted - gain, gain))
    best = np.average(np.maximum(gain.max(axis=1), 0), weights=weight)
    return Scores(float(1 - lost / whole), float(np.average(chosen, weights=weight)), float(best))


def _standardiser(raw: FloatArray, situation: Situation, parts: tuple[str, ...]) -> FloatArray:
    """Return the map (1 + F, C) to a constant and features of mean 0 and variance 1, with embeddings reduced."""
    mean, deviation = raw.mean(axis=0), raw.std(axis=0)
    scale = np.diag(np.where(deviation > SMALLEST_DEVIATION, 1 / np.maximum(deviation, SMALLEST_DEVIATION), 0.0))
    scale[0, 0] = 1.0
    columns = [scale]
    if "embedding" in parts:
        after = situation.features()["facing"].shape[1] if "facing" in parts else 0
        inside = slice(raw.shape[1] - after - situation.embedding.shape[1], raw.shape[1] - after)
        _, singular, directions = np.linalg.svd(raw[:, inside] - mean[inside], full_matrices=False)
        kept = slice(0, min(EMBEDDING_DIRECTIONS, int((singular > SMALLEST_DEVIATION).sum())))
        reduced = np.zeros((raw.shape[1], kept.stop))
        reduced[inside] = directions[kept].T * np.sqrt(len(raw)) / singular[kept]
        columns = [scale[:, : inside.start], reduced, scale[:, inside.stop :]]
    standardise = np.concatenate(columns, axis=1)
    standardise[0, 1:] -= mean[1:] @ standardise[1:, 1:]
    return standardise


def _moments(rows: _Rows) -> _Moments:
    """Return the weighted second moments of features x path, with each other and with the gain."""
    size = rows.path.shape[2]
    columns = rows.features.shape[1] * size + 1
    moments, response = np.zeros((columns, columns)), np.zeros(columns)
    for begin in range(0, len(rows.path), CHUNK):
        part = slice(begin, begin + CHUNK)
        weight = np.sqrt(rows.weight[part])[:, None]
        design = np.einsum("nf,npk->npfk", rows.features[part], rows.path[part] * weight[..., None])
        spread = (rows.spread[part] * weight).reshape(-1, 1)
        flat = np.concatenate([design.reshape(-1, columns - 1), spread], axis=1)
        moments += flat.T @ flat
        response += flat.T @ (rows.gain[part] * weight).ravel()
    return _Moments(moments, response, np.trace(moments[:size, :size]) / size)


def _solve(sums: _Moments, penalties: tuple[float, float], features: int) -> tuple[FloatArray, float]:
    """Return the ridge solution for C features, (C, S), and the weight of the spread, which no penalty shrinks.

    The weight is at least 0. Where the best one is not, the best of those that may be is 0, and the rest is solved for
    without it.
    """
    size = (len(sums.response) - 1) // features
    functions = BASIS_SIZE - int(size % BASIS_SIZE > 0)  # without the constant one, S is 20 or 40
    harmonics = np.ones(BASIS_SIZE)
    harmonics[SINES] = HANDEDNESS
    penalty = np.tile(harmonics[-functions:], (features, size // functions)) * penalties[0]
    penalty[0] *= penalties[1] / penalties[0]
    ridge = sums.moments + sums.curvature * np.diag(np.append(penalty.ravel(), 0.0))
    solution: FloatArray = solve(ridge, sums.response, assume_a="pos")
    if solution[-1] < 0:
        solution = np.append(solve(ridge[:-1, :-1], sums.response[:-1], assume_a="pos"), 0.0)
    return solution[:-1].reshape(features, size), float(solution[-1])


def _cross_validate(rows: _Rows, group: IntArray) -> tuple[tuple[float, float], Scores]:
    """Return the best penalties, and the scores of the fields that were fitted with them on other groups."""
    names, number = np.unique(group, return_inverse=True)
    folds = min(FOLDS, len(names))
    fold = (np.random.default_rng(0).permutation(len(names)) % folds)[number]
    penalties = [(penalty, share * penalty) for penalty in PENALTIES for share in CONSTANT_SHARES]
    predicted = np.zeros((len(penalties), *rows.gain.shape))
    held_out = [_moments(rows.part(fold == index)) for index in range(folds)]
    total = _Moments(*(np.sum(parts, axis=0) for parts in zip(*held_out, strict=True)))
    for index in range(folds):
        rest = _Moments(*(whole - part for whole, part in zip(total, held_out[index], strict=True)))
        inside = rows.part(fold == index)
        for row, pair in enumerate(penalties):
            situated, spread_weight = _solve(rest, pair, rows.features.shape[1])
            along = np.einsum("nk,npk->np", inside.features @ situated, inside.path)
            predicted[row, fold == index] = along + spread_weight * inside.spread
    lost = ((predicted - rows.gain) ** 2 * rows.weight[:, None]).sum(axis=(1, 2))
    best = int(np.argmin(lost))
    return penalties[best], _scores(predicted[best], rows.gain, rows.weight)
