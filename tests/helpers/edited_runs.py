"""Makes the figures of a run whose records or configuration were edited agree with them, as who edits might."""

import json
from pathlib import Path

from eval.records.run_files import SUMMARY, TABLE
from eval.render.tables import markdown
from eval.running.run import read_run
from eval.verification.figures import recompute


def rewrite_figures(run: Path) -> None:
    """Write summary.json and table.md anew, from the records."""
    edited, path = read_run(run), run / SUMMARY
    held = json.loads(path.read_text())
    path.write_text(json.dumps(held | recompute(edited.config, edited.records, held, None)))
    (run / TABLE).write_text(markdown(*read_run(run).tables()))
