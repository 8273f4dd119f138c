"""The summary.json of a finished run, and who leads in it."""

from collections.abc import Mapping
from typing import Any

from ehar.errors import DataError
from eval.records.json_object import read_object
from eval.records.run_files import SUMMARY
from eval.running.finished_run import FinishedRun
from eval.scores.seed_accuracy import seeds_of
from eval.scores.summary import NO_ACT


def read_summary(run: FinishedRun) -> dict[str, Any]:
    """Return a run's summary.json.

    Raises:
        UsageError: the run has none, as when it was interrupted.
        DataError: it is not that of the run's records.
    """
    summary = read_object(run.directory / SUMMARY, "a finished run of ehar benchmark")
    trainings = seeds_of(run.records)
    names = [of.get("name") for of in summary.get("planners", ()) if isinstance(of, dict)]
    if names != list(trainings):
        raise DataError(
            f"{run.directory / SUMMARY}: expected the planners of the records, {', '.join(trainings)}, "
            f"got {', '.join(map(str, names)) or 'none'}"
        )
    return summary


def lead_planner(summary: Mapping[str, Any]) -> str | None:
    """Return the planner without the truth that is most accurate, no-act left out; None where there is none."""
    rivals = [of for of in summary["planners"] if not of["privileged"] and of["name"] != NO_ACT]
    return max(rivals, key=lambda of: of["acc_mean"])["name"] if rivals else None
