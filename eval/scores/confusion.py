"""Confusions of classes, and the classes that one planner recognises better than another. Axis: K classes."""

from typing import NamedTuple

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.streams.data import NO_ACTIVITY
from eval.records.episodes import EpisodeRecords
from eval.scores.metrics import mean_acc
from eval.scores.resampling.resamples import resample_episodes
from eval.scores.resampling.statistics import BOOTSTRAP_SEED


class ClassGains(NamedTuple):
    """The difference in accuracy between two planners, class by class; NaN for a class without episodes.

    Args:
        gain: (K,), the difference of the accuracies over all frames, -1 to 1.
        ci95: (K, 2), its 95 % interval, bootstrap over the class's people and sequences; NaN with fewer than two
            sequences. It is not corrected for the number of classes, and does not draw training seeds.
    """

    gain: FloatArray
    ci95: FloatArray


def confusion(episodes: EpisodeRecords, classes: int) -> FloatArray:
    """Return how often each class is taken for each, (K, K): the share of the frames of a class.

    In streams the last of the K classes is no activity.

    Rows are true classes and sum to 1; those of a class without frames are NaN. The diagonal is the accuracy of the
    class, the mean over all frames.
    """
    length = episodes.predicted.shape[1]
    true = episodes.label.ravel() if episodes.of_streams else np.repeat(episodes.label, length)
    true, taken = (np.where(named == NO_ACTIVITY, classes - 1, named) for named in (true, episodes.predicted.ravel()))
    pairs = true * classes + taken
    counts = np.bincount(pairs, minlength=classes**2).reshape(classes, classes)
    total = counts.sum(axis=1, keepdims=True)
    shares: FloatArray = counts / np.where(total > 0, total, np.nan)
    return shares


def class_gains(trainings: list[EpisodeRecords], others: list[EpisodeRecords], classes: int) -> ClassGains:
    """Return how much more accurate one planner is than another, by class, as the mean over its trainings.

    Args:
        trainings: records of the first planner's trainings, on the same episodes.
        others: records of the second planner's trainings.
        classes: K.
    """
    reference = trainings[0]
    gained = np.mean([mean_acc(one.correct) for one in trainings], axis=0)
    gained = gained - np.mean([mean_acc(one.correct) for one in others], axis=0)
    gain, ends = np.full(classes, np.nan), np.full((classes, 2), np.nan)
    names = np.array(reference.sequence)
    rng = np.random.default_rng(BOOTSTRAP_SEED)
    for label in np.unique(reference.label):
        members = reference.label == label
        gain[label] = gained[members].mean()
        if len(np.unique(names[members])) > 1:
            resamples = resample_episodes(names[members], reference.subjects[members], rng=rng)
            ends[label] = resamples.interval(gain[label], resamples.means(gained[members]), bounds=(-1, 1))
    return ClassGains(gain, ends)
