"""What the README shows runs as it stands there."""

import re
from pathlib import Path
from typing import Any

import gymnasium as gym
import pytest

from eval import benchmark

README = Path(__file__).parents[1] / "README.md"


def python_blocks() -> list[str]:
    return re.findall(r"```python\n(.*?)```", README.read_text(), flags=re.DOTALL)


def test_the_planner_has_ten_lines_at_most() -> None:
    lines = [line for line in python_blocks()[0].splitlines() if line.strip()]
    assert len(lines) <= 10


@pytest.mark.slow
def test_the_planner_runs_in_the_benchmark(tmp_path: Path) -> None:
    source = tmp_path / "spiral.py"
    source.write_text(python_blocks()[0])
    summary = benchmark([f"{source}:Spiral", "no-act"], data="duo")
    spiral = summary.planner("spiral")
    assert not spiral.privileged
    assert spiral.path_length_m > summary.planner("no-act").path_length_m == 0


@pytest.mark.slow
def test_the_environments_are_made() -> None:
    names: dict[str, Any] = {}
    exec(python_blocks()[1], names)
    assert isinstance(names["env"].action_space, gym.spaces.Discrete)
    assert names["envs"].num_envs == 64


@pytest.mark.slow
def test_a_planner_of_other_arguments_is_made_and_runs() -> None:
    names: dict[str, Any] = {}
    exec(python_blocks()[2], names)
    summary = benchmark([names["patient"], "no-act"], data="duo")
    solves = summary.planner("patient").solves
    assert solves is not None
    assert solves.total == 4 * summary.episodes  # frames 0, 15, 30 and 45
