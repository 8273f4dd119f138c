"""What the README shows runs as it stands there."""

import itertools
from pathlib import Path

import pytest

from ehar.conditions import Conditions
from eval import benchmark
from tests.helpers.pages import README, python_blocks


def test_it_begins_with_a_sentence_a_picture_and_a_short_table() -> None:
    lines = README.read_text().splitlines()
    assert len(lines) <= 150
    title, sentence, picture, *table = [line for line in lines if line]
    assert title.startswith("# ") and sentence.endswith(".") and picture.startswith("![")
    rows = list(itertools.takewhile(lambda line: line.startswith("|"), table))
    assert 3 <= len(rows) <= 2 + 7  # below the head and its rule
    assert len({row.count("|") for row in rows}) == 1


def test_the_planner_has_ten_lines_at_most() -> None:
    lines = [line for line in python_blocks(README)[0].splitlines() if line.strip()]
    assert len(lines) <= 10


@pytest.mark.slow
def test_the_planner_runs_in_the_benchmark(tmp_path: Path) -> None:
    source = tmp_path / "spiral.py"
    source.write_text(python_blocks(README)[0])
    summary = benchmark([f"{source}:Spiral", "no-act"], Conditions(data="duo", part="validation")).summary
    spiral = summary.planner("spiral")
    assert not spiral.privileged
    assert spiral.metrics["path_length_m"] > summary.planner("no-act").metrics["path_length_m"] == 0
