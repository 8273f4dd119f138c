"""The metrics of a planner: each entry of `METRICS` is a column of every table."""

from collections.abc import Callable
from dataclasses import dataclass

from eval.records.episodes import EpisodeRecords
from eval.scores.metrics import ece, nll, path_length


@dataclass(frozen=True)
class Metric:
    """A number of one training of a planner; tables show the mean over several trainings.

    Args:
        key: its key in summary.json.
        header: header of its column, with the unit.
        of_records: computes it from the records of one training.
        digits: number of decimals.
        lower_is_better: whether lower numbers are better, for sorting.
    """

    key: str
    header: str
    of_records: Callable[[EpisodeRecords], float]
    digits: int
    lower_is_better: bool = True


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
PATH_LENGTH = Metric(
    key="path_length_m",  # mean distance travelled in an episode
    header="path [m]",
    of_records=lambda records: float(path_length(records.viewpoint).mean()),
    digits=1,
)

METRICS: tuple[Metric, ...] = (NLL, ECE, PATH_LENGTH)
