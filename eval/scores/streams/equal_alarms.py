"""Delays at equal false alarms: who answers sooner, if nobody may raise more false alarms than the other."""

from typing import NamedTuple

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.streams.data import NO_ACTIVITY
from eval.records.episodes import EpisodeRecords
from eval.scores.streams.alarms import alarms_per_minute, delays

THRESHOLDS = 200  # probabilities that are tried: quantiles of those that answers have


class Restrained(NamedTuple):
    """What comes of answering only from some probability on."""

    threshold: float  # the probability
    delays: FloatArray  # (M,) frames from each activity's onset until it is recognised for good


def restrained(records: EpisodeRecords, fps: float, most: float) -> Restrained:
    """Return what a reader's delays are if it may raise `most` false alarms a minute.

    It names an activity only where that is at least as probable as a threshold, and says that there is none
    elsewhere. Of the thresholds with few enough false alarms it has the one of the shortest mean delay. They are read
    off these very records, for every reader alike: this compares curves, and is no setting for a use.

    Args:
        records: records of streams.
        fps: frames per second.
        most: false alarms a minute.
    """
    tried = np.unique(np.quantile(records.top_probability, np.linspace(0, 1, THRESHOLDS)))
    best: Restrained | None = None
    for threshold in [0.0, *tried, np.inf]:
        answers = np.where(records.top_probability >= threshold, records.predicted, NO_ACTIVITY)
        if alarms_per_minute(records.label, answers, fps) > most:
            continue
        took, _ = delays(records.label, answers)
        if best is None or took.mean() < best.delays.mean():
            best = Restrained(float(threshold), took)
    assert best is not None  # at an infinite threshold there is no alarm
    return best
