"""The metrics of a planner: each entry of `METRICS` is a column of every table."""

from eval.scores.metrics import Metric, ece, nll, path_length

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
