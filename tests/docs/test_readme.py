"""What the README shows runs as it stands there."""

from pathlib import Path

import pytest

from eval import benchmark
from tests.helpers.pages import README, python_blocks


def test_the_planner_has_ten_lines_at_most() -> None:
    lines = [line for line in python_blocks(README)[0].splitlines() if line.strip()]
    assert len(lines) <= 10


@pytest.mark.slow
def test_the_planner_runs_in_the_benchmark(tmp_path: Path) -> None:
    source = tmp_path / "spiral.py"
    source.write_text(python_blocks(README)[0])
    summary = benchmark([f"{source}:Spiral", "no-act"], data="duo")
    spiral = summary.planner("spiral")
    assert not spiral.privileged
    assert spiral.path_length_m > summary.planner("no-act").path_length_m == 0
