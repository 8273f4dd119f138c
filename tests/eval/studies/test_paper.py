"""The paper's tables of a run: every planner, learned ones over their trainings, and where its figures are."""

from pathlib import Path

import numpy as np
import pytest

from ehar.errors import UsageError
from eval.cli.main import main
from eval.running.run import Run, read_run
from eval.scores.metrics import acc_at
from eval.studies.behaviour.analyse import FOLDER
from eval.studies.behaviour.analysis import POSITIONS
from eval.studies.paper import accuracy_table, figures_table, paper, paper_tables
from tests.helpers.made_records import make_records, write_finished

RECORDS = {
    "no-act": make_records(1, episodes=12),
    "il-ppo/0": make_records(2, skill=1.0, episodes=12),
    "il-ppo/1": make_records(3, skill=2.0, episodes=12),
    "il-ppo-no-embedding/0": make_records(4, skill=0.5, episodes=12),
    "oracle": make_records(5, skill=3.0, episodes=12),
}
NAMES = ("nod", "shake", "wave")


@pytest.fixture
def run(tmp_path: Path) -> Run:
    return read_run(write_finished(tmp_path / "run", RECORDS))


def test_table_1_has_every_planner_with_its_spread_over_trainings(run: Run) -> None:
    table = accuracy_table(run)
    assert table.header == ("planner", "trainings", *(f"acc@{at}" for at in (10, 30, 50, 70, 90, 100)), "mean acc")
    assert [row[:2] for row in table.rows] == [
        ("no-act", "1"),
        ("il-ppo", "2"),
        ("il-ppo-no-embedding", "1"),
        ("oracle", "1"),
    ]
    trained = [100 * acc_at(RECORDS[f"il-ppo/{seed}"].correct, 50) for seed in range(2)]
    cell = str(table.rows[1][4])
    assert cell.startswith(f"{np.mean(trained):.1f} ± {np.std(trained, ddof=1):.1f} [")
    assert "±" not in str(table.rows[0][4])


def test_the_mean_s_interval_is_that_of_the_summary(run: Run) -> None:
    for row, planner in zip(accuracy_table(run).rows, run.summary.planners, strict=True):
        assert planner.acc_mean_ci95 is not None
        low, high = planner.acc_mean_ci95
        assert str(row[-1]).startswith(f"{planner.acc_mean:.1f}")
        assert str(row[-1]).endswith(f"[{low:.1f}, {high:.1f}]")


def test_tables_3_and_4(run: Run) -> None:
    _, third, fourth, classes, _ = paper_tables(run, NAMES)
    assert [row[0] for row in third.rows] == ["il-ppo-no-embedding", "il-ppo"]
    assert [row[0] for row in fourth.rows] == [
        "no-act (passive)",
        *(f"{name} (embodied)" for name in ("il-ppo", "il-ppo-no-embedding", "oracle")),
    ]
    for row in fourth.rows:  # each class once
        assert sorted(name for cell in row[1:] for name in str(cell).split("; ") if name in NAMES) == list(NAMES)
    right, label = RECORDS["no-act"].correct, RECORDS["no-act"].label
    expected = [100 * right[label == 0][:, frame].mean() for frame in (0, 1, 3)]
    assert classes.rows[0][:2] == ("nod", " / ".join(f"{share:.0f}" for share in expected))


def test_a_figure_is_named_or_what_draws_it(run: Run) -> None:
    rows = dict(figures_table(run).rows)
    assert rows["6: distance, azimuth, polar angle"] == (
        f"made by `ehar study analyse {run.folder} --planners il-ppo --states il-ppo/0`"
    )
    drawn = run.folder / FOLDER / POSITIONS
    drawn.parent.mkdir()
    drawn.write_bytes(b"")
    assert dict(figures_table(run).rows)["6: distance, azimuth, polar angle"] == str(drawn)


def test_the_command_prints_and_writes(run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["study", "paper", str(run.folder), "--out", str(tmp_path / "tables.md")])
    assert "(Tables 1 and 2)" in capsys.readouterr().out
    written = (tmp_path / "tables.md").read_text()
    assert all(f"Table {number}" in written for number in (3, 4)) and "| il-ppo | 2 |" in written
    with pytest.raises(UsageError, match="expected at least one folder"):
        paper([])
