"""The paper's own rows, to stand beside ours: accuracy [%] at 10 to 100 % of the frames, and the mean.

Its recogniser, scenarios and unpublished choices are not ours: the rows say what was reached there, not what
ours should equal.
"""

from typing import NamedTuple


class PaperRow(NamedTuple):
    """One planner's row, for learned ones the mean of 5 training runs."""

    name: str
    acc: tuple[float, float, float, float, float, float]
    acc_mean: float


_EXPI = (  # Table 1
    PaperRow("oracle", (55.56, 67.41, 80.74, 89.63, 93.33, 94.81), 77.53),
    PaperRow("no-act", (49.63, 47.41, 51.85, 57.04, 61.48, 62.96), 52.79),
    PaperRow("towards", (48.89, 42.96, 50.37, 57.78, 59.26, 59.26), 50.64),
    PaperRow("h-rotate", (44.44, 48.15, 55.56, 46.67, 33.33, 29.63), 45.23),
    PaperRow("v-rotate", (45.19, 48.15, 57.04, 62.22, 60.74, 60.00), 54.52),
    PaperRow("random", (49.93, 45.78, 51.26, 56.74, 60.59, 62.07), 52.45),
    PaperRow("ppo", (46.07, 50.52, 62.07, 67.11, 65.63, 65.48), 58.51),
    PaperRow("il", (49.33, 53.04, 63.70, 65.33, 65.78, 63.70), 59.61),
    PaperRow("il-ppo", (50.81, 56.30, 66.37, 71.70, 74.81, 74.96), 64.27),
)
_AISTPP = (  # Table 2
    PaperRow("oracle", (21.24, 40.71, 57.52, 60.18, 69.91, 69.03), 51.22),
    PaperRow("no-act", (20.35, 30.97, 37.17, 41.59, 40.71, 43.36), 32.68),
    PaperRow("towards", (19.47, 29.20, 36.28, 35.39, 39.82, 42.48), 31.86),
    PaperRow("h-rotate", (19.47, 27.43, 35.39, 39.82, 40.70, 44.24), 32.77),
    PaperRow("v-rotate", (16.81, 23.01, 33.63, 34.51, 37.17, 39.82), 28.08),
    PaperRow("random", (18.89, 27.14, 36.87, 38.94, 37.61, 41.15), 32.06),
    PaperRow("ppo", (17.88, 35.04, 46.90, 53.81, 58.58, 59.47), 42.59),
    PaperRow("il", (17.26, 31.42, 42.04, 45.58, 45.13, 43.58), 36.38),
    PaperRow("il-ppo", (19.25, 37.61, 50.00, 58.41, 63.72, 67.04), 46.06),
)
ROWS = {"expi": _EXPI, "aistpp": _AISTPP}  # by the name of the data


def paper_gap_closed(rows: tuple[PaperRow, ...], name: str) -> float:
    """Return the gap that a row of the paper closes, computed from its table."""
    acc = {row.name: row.acc_mean for row in rows}
    return (acc[name] - acc["no-act"]) / (acc["oracle"] - acc["no-act"])
