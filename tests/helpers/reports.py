"""Runs to make reports of, and what a report holds."""

import json
import re
from pathlib import Path
from typing import Any

from ehar.data.motion_file import save_motion
from ehar.planner import Planner
from eval.records.episodes import EpisodeRecords
from eval.reports.page import make_report
from tests.helpers.fakes import tiny_data
from tests.helpers.made_records import write_finished
from tests.helpers.tiny_benchmarks import Log
from tests.helpers.tiny_benchmarks import run as run_tiny

PLANNERS: tuple[str | Planner, ...] = ("no-act", "v-rotate", "random", "oracle")


def tiny_run(directory: Path, planners: tuple[str | Planner, ...] = PLANNERS, **options: Any) -> Path:
    """Run planners on the tiny data, of which the weights are faked, and return the run's folder."""
    save_motion(directory / "tiny.npz", tiny_data(sequences=40))
    run = directory / "run"
    run_tiny(planners, **{"data": directory / "tiny.npz", "starts": 1, "out": run, **options})
    return run


def written_run(directory: Path, records: dict[str, EpisodeRecords], **config: Any) -> Path:
    """Write records as a finished run, of data that is not there."""
    length = next(iter(records.values())).predicted.shape[1]
    return write_finished(directory, records, length=length, **config)


def report_of(run: Path, log: Log | None = None) -> str:
    """Make a report, and return its HTML."""
    return make_report(run, reporter=log or Log()).read_text(encoding="utf-8")


def embedded(page: str, name: str) -> Any:
    """Return the JSON that a report holds, `report` or `replays`."""
    found = re.search(rf'<script type="application/json" id="{name}">(.*?)</script>', page, flags=re.DOTALL)
    assert found is not None
    return json.loads(found[1])
