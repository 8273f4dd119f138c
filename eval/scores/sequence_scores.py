"""Interquartile mean and probability of improvement, of accuracies by sequence and training seed.

After Agarwal et al., Deep RL at the Edge of the Statistical Precipice, NeurIPS 2021, with sequences for their tasks and
trainings for their runs. They draw runs within each task; here whole sequences and trainings are drawn, as in every
interval of a report.
"""

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray

_BLOCK = 1000  # resamples at a time, which limits the memory


def accuracy_by_sequence(correct: BoolArray, clusters: IntArray) -> FloatArray:
    """Return the accuracy in each sequence over all its episodes and frames, (S,).

    Answers are counted before they are divided, so that equal accuracies are equal numbers: ties count half below.

    Args:
        correct: (N, L), whether the predicted class is the true one.
        clusters: (N,), the sequence of each episode, 0 to S - 1.
    """
    right = np.bincount(clusters, weights=correct.sum(axis=1))
    accuracy: FloatArray = right / (np.bincount(clusters) * correct.shape[1])
    return accuracy


def interquartile_mean(by_sequence: FloatArray) -> float:
    """Return the mean of accuracies (G, S) without the lowest and the highest quarter of all G S numbers."""
    return float(_interquartile_means(by_sequence.ravel(), np.ones((1, by_sequence.size)))[0])


def resampled_interquartile_means(by_sequence: FloatArray, counts: IntArray, draws: IntArray) -> FloatArray:
    """Return the interquartile mean in every resample, (R,).

    Args:
        by_sequence: (G, S), the accuracy of each training in each sequence.
        counts: (R, S), how often each sequence is drawn.
        draws: (R, G), how often each training is drawn.
    """
    means = np.empty(len(counts))
    for block in range(0, len(counts), _BLOCK):
        rows = slice(block, block + _BLOCK)
        weights = draws[rows, :, None] * counts[rows, None, :]
        means[rows] = _interquartile_means(by_sequence.ravel(), weights.reshape(len(weights), -1))
    return means


def _interquartile_means(values: FloatArray, weights: FloatArray | IntArray) -> FloatArray:
    """Return the mean without the quarter at either end, (R,).

    Args:
        values: (n,).
        weights: (R, n), how often each value is drawn. Where people are drawn, with sequences of their own, a resample
            may have more values than another.
    """
    order = np.argsort(values)
    drawn = weights.sum(axis=1, keepdims=True)  # (R, 1)
    cut = drawn // 4
    kept = np.clip(np.cumsum(weights[:, order], axis=1), cut, drawn - cut) - cut
    # Summation by parts: the number of kept values that are no higher than each value, times the step to the next.
    below: FloatArray = kept[:, :-1] @ np.diff(values[order])
    means: FloatArray = values[order[-1]] - below / (drawn - 2 * cut)[:, 0]
    return means


def wins(by_sequence: FloatArray, other: FloatArray) -> FloatArray:
    """Return whether each training of one planner is more accurate than each of another, (G, H, S); a tie is a half.

    Args:
        by_sequence: (G, S), the accuracy of each training of the one planner in each sequence.
        other: (H, S), the same of the other planner.
    """
    won: FloatArray = 0.5 + 0.5 * np.sign(by_sequence[:, None] - other[None])
    return won


def probability_of_improvement(won: FloatArray) -> float:
    """Return the chance that a training of one planner beats one of another in a sequence, from (G, H, S) of `wins`.

    P(X > Y) of Agarwal et al., averaged over sequences; it does not say how large an improvement is.
    """
    return float(won.mean())


def resampled_improvements(won: FloatArray, counts: IntArray, draws: IntArray, other: IntArray) -> FloatArray:
    """Return the probability of improvement in every resample, (R,).

    Args:
        won: (G, H, S) of `wins`.
        counts: (R, S), how often each sequence is drawn.
        draws: (R, G), how often each training of the one planner is drawn.
        other: (R, H), how often each training of the other planner is drawn.
    """
    by_training = won @ (counts / counts.sum(axis=1, keepdims=True)).T  # people have unlike numbers of sequences
    chances: FloatArray = np.einsum("rg,rh,ghr->r", draws / won.shape[0], other / won.shape[1], by_training)
    return chances
