"""The metrics of a planner: each entry of `METRICS` is a column of every table."""

import numpy as np

from eval.records.episodes import EpisodeRecords
from eval.scores.metrics import Metric, ece, late_ece, nll, path_length
from eval.scores.streams.activities import activities

BLOCK = 1024  # episodes at a time, where steps between places take several times the memory of records


def mean_path_length(records: EpisodeRecords) -> float:
    """Return the mean distance that cameras travelled in an episode [m]."""
    places = records.viewpoint
    return float(np.concatenate([path_length(places[at : at + BLOCK]) for at in range(0, len(places), BLOCK)]).mean())


def ece_of_late_frames(records: EpisodeRecords) -> float:
    """Return the calibration error from half of an episode on; in streams, from half of each activity on."""
    answers = activities(records) if records.of_streams else records
    return late_ece(answers.top_probability, answers.correct)


NLL = Metric(
    key="nll",  # mean negative log-likelihood of the true class [nat]
    header="NLL",
    of_records=lambda records: nll(records.true_probability),
    digits=2,
)
ECE = Metric(
    key="ece",  # expected calibration error, 0 to 1, of each training alone, so that errors do not cancel
    header="ECE",
    of_records=lambda records: ece(records.top_probability, records.correct),
    digits=3,
)
LATE_ECE = Metric(
    key="ece_late",
    header="late ECE",
    of_records=ece_of_late_frames,
    digits=3,
)
PATH_LENGTH = Metric(
    key="path_length_m",  # mean distance travelled in an episode
    header="path [m]",
    of_records=mean_path_length,
    digits=1,
)

METRICS: tuple[Metric, ...] = (NLL, ECE, LATE_ECE, PATH_LENGTH)
