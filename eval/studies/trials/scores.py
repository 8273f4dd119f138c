"""Scores of trials on one data set: accuracy and calibration on the people of all folds that have begun."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import log_softmax, logsumexp

from ehar.arrays import BoolArray, FloatArray, IntArray
from eval.scores.metrics import acc_at, late_ece, mean_acc, nll
from eval.scores.resampling.resamples import Basis, resample_episodes
from eval.scores.resampling.statistics import Interval, pair, why_no_intervals
from recognition.calibration import fit_temperature
from recognition.trials.changes import ROWS, USUAL, Row


@dataclass(frozen=True, eq=False)
class Answered:
    """What the trainings of one fold say about the clips of the people who were left out.

    Args:
        logits: (N, L, K) by training.
        labels: (N,) true classes.
        sequences: (N,) names of the clips' sequences.
        subjects: (N, P) who performs.
    """

    logits: Mapping[str, FloatArray]
    labels: IntArray
    sequences: np.ndarray
    subjects: IntArray


@dataclass(frozen=True)
class Score:
    """A row on one data set.

    Args:
        row: name of the row.
        accuracy: mean accuracy [%] over frames.
        acc_end: accuracy [%] after all frames.
        nll: of the true class [nat], mean over frames.
        ece_late: calibration error, 0 to 1, of the frames from `CALIBRATED_FROM` on.
        nll_calibrated: the same with temperatures that were fitted on the people of other folds; None with one fold, or
            where everybody performs with somebody of another fold.
        ece_calibrated: likewise.
        gain: accuracy minus that of the usual training [points].
        gain_ci95: its interval, corrected for all rows of the data set; None where there can be none.
    """

    row: str
    accuracy: float
    acc_end: float
    nll: float
    ece_late: float
    nll_calibrated: float | None
    ece_calibrated: float | None
    gain: float
    gain_ci95: Interval | None


@dataclass(frozen=True)
class SetScores:
    """All rows on one data set.

    Args:
        data: title of the data.
        folds: number of folds whose usual training is there.
        clips: number of clips of people who were left out.
        basis: the people that intervals rest on.
        rows: the rows.
    """

    data: str
    folds: int
    clips: int
    basis: Basis
    rows: tuple[Score, ...]


def score_set(data: str, folds: Sequence[Answered]) -> SetScores:
    """Score every row whose trainings are done in all given folds."""
    labels = np.concatenate([fold.labels for fold in folds])
    sequences = np.concatenate([fold.sequences for fold in folds])
    subjects = np.concatenate([fold.subjects for fold in folds])
    rows = [row for row in ROWS if all(name in fold.logits for fold in folds for name in row.trainings)]
    said = {row.name: [_together(fold, row) for fold in folds] for row in rows}
    right = {name: _right(np.concatenate(pieces), labels) for name, pieces in said.items()}
    resamples = resample_episodes(
        sequences, subjects, why_none=why_no_intervals(len(np.unique(sequences)), len(np.unique(labels)))
    )
    others = [row.name for row in rows if row.name != USUAL]
    gains = np.array([mean_acc(right[name]) - mean_acc(right[USUAL]) for name in others]).reshape(len(others), -1)
    ends: dict[str, Interval | None] = {}
    if resamples.full and others:
        found = resamples.together(gains.mean(axis=1), resamples.means(gains)).ends
        ends = {name: pair(100 * both) for name, both in zip(others, found, strict=True)}
    return SetScores(
        data=data,
        folds=len(folds),
        clips=len(labels),
        basis=resamples.basis,
        rows=tuple(
            _score(row.name, said[row.name], folds, right[row.name], float(mean_acc(right[USUAL]).mean()), ends)
            for row in rows
        ),
    )


def _together(fold: Answered, row: Row) -> FloatArray:
    """Return the logarithm of the mean probability of a row's trainings, (N, L, K)."""
    each = [log_softmax(fold.logits[name].astype(np.float64), axis=-1) for name in row.trainings]
    mean: FloatArray = logsumexp(each, axis=0) - np.log(len(each))
    return mean


def _right(log_probs: FloatArray, labels: IntArray) -> BoolArray:
    return np.asarray(log_probs.argmax(axis=-1) == labels[:, None])


def _calibrated(said: Sequence[FloatArray], folds: Sequence[Answered]) -> FloatArray | None:
    """Return each fold's log-probabilities with the temperatures that the other folds' people ask for.

    A couple of whom each is left out in another fold is in both. So clips of other folds that show anybody of the own
    one are left out; None where no clip remains.
    """
    length = said[0].shape[1]
    ratio = np.arange(1, length + 1) / length
    pieces = []
    for own, fold in enumerate(folds):
        others = [
            (said[number][apart], other.labels[apart])
            for number, other in enumerate(folds)
            if number != own and (apart := ~np.isin(other.subjects, fold.subjects).any(axis=1)).any()
        ]
        if not others:
            return None
        fitted = fit_temperature(*(np.concatenate(parts) for parts in zip(*others, strict=True)))
        pieces.append(log_softmax(said[own] / fitted.at(ratio)[:, None], axis=-1))
    return np.concatenate(pieces)


def _score(
    name: str,
    said: Sequence[FloatArray],
    folds: Sequence[Answered],
    right: BoolArray,
    usual: float,
    ends: Mapping[str, Interval | None],
) -> Score:
    """Return the figures of a row."""
    labels = np.concatenate([fold.labels for fold in folds])
    plain = _sure(np.concatenate(said), labels, right)
    by_others = _calibrated(said, folds)
    calibrated = (None, None) if by_others is None else _sure(by_others, labels, right)
    accuracy = float(mean_acc(right).mean())
    return Score(
        row=name,
        accuracy=100 * accuracy,
        acc_end=100 * acc_at(right, 100),
        nll=plain[0],
        ece_late=plain[1],
        nll_calibrated=calibrated[0],
        ece_calibrated=calibrated[1],
        gain=100 * (accuracy - usual),
        gain_ci95=ends.get(name),
    )


def _sure(log_probs: FloatArray, labels: IntArray, right: BoolArray) -> tuple[float, float]:
    """Return the NLL, and the calibration error of late frames."""
    probabilities = np.exp(log_probs)
    true = np.take_along_axis(probabilities, labels[:, None, None], axis=-1)[..., 0]
    return nll(true), late_ece(probabilities.max(axis=-1), right)
