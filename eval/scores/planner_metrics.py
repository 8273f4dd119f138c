"""The numbers of a planner that are columns of every table: one line in `METRICS` each."""

from collections.abc import Callable
from dataclasses import dataclass

from eval.records.episodes import EpisodeRecords
from eval.scores.metrics import ece, nll, path_length


@dataclass(frozen=True)
class Metric:
    """A number of one training of a planner; of several trainings tables show the mean.

    Args:
        key: in summary.json.
        header: of its column, with the unit.
        of_records: computes it.
        digits: behind the decimal point.
        lower_is_better: for sorting.
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
    key="ece",  # expected calibration error, 0 to 1; each training's own, so that their errors do not cancel
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
