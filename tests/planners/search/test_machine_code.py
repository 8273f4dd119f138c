"""Machine code: plans are the same with it, it is made in the background and kept, and nobody needs a compiler."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from ehar.world import PAPER
from planners.search import machine_code, solver
from planners.search.machine_code import MachineCode, has_compiler
from planners.search.scene import SceneSize
from planners.search.solver import Solution, TrajectorySolver
from tests.helpers.trajectory_tasks import FLIGHT, random_task

FAILS = 'rm -f "$0.c"; false'  # a compilation
NODES, NODE_TIME = 6, 0.2
FEW = 3  # nodes, where all that matters is whether there is machine code: half as much to compile
needs_compiler = pytest.mark.skipif(not has_compiler(), reason="there is no C compiler, `cc`")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an empty cache, which is in use."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "ehar"


def plans(planning: TrajectorySolver, count: int = 4, nodes: int = FEW) -> list[Solution]:
    """Return plans in flight, each from where the one before leads, and judged by all functions."""
    rng = np.random.default_rng(0)
    found: list[Solution] = []
    for _ in range(count):
        task = random_task(rng, horizon=nodes, limits=FLIGHT, node_time=NODE_TIME)
        found.append(planning.solve_best(task, PAPER.sample_starts(rng, 8), found[-1] if found else None, NODE_TIME))
    return found


def assert_same(some: list[Solution], others: list[Solution]) -> None:
    for one, other in zip(some, others, strict=True):
        for part, same in zip(one.trajectory, other.trajectory, strict=True):
            np.testing.assert_array_equal(part, same)
        assert (one.objective, one.violation, one.status) == (other.objective, other.violation, other.status)


@needs_compiler
def test_plans_are_the_same_bit_by_bit() -> None:
    interpreted, compiled = TrajectorySolver(horizon=NODES, flown=True), TrajectorySolver(horizon=NODES, flown=True)
    assert compiled.compile()
    assert_same(plans(compiled, nodes=NODES), plans(interpreted, nodes=NODES))


@needs_compiler
def test_a_problem_is_compiled_once_and_its_code_is_kept(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert TrajectorySolver(horizon=FEW, flown=True).compile()
    monkeypatch.setattr(machine_code, "COMPILE", FAILS)
    assert TrajectorySolver(horizon=FEW, flown=True).compile()
    assert not TrajectorySolver(horizon=FEW, flown=True, scene=SceneSize(1, 0, 0, 1, 0)).compile()  # another problem
    assert len(list(cache.glob("*.so"))) == 1
    assert not list(cache.glob("*.c"))


@needs_compiler
def test_who_plans_often_gets_machine_code_while_planning_goes_on(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[subprocess.Popen[bytes]] = []
    start = subprocess.Popen

    def popen(*arguments: object, **options: object) -> object:
        started.append(start(*arguments, **options))  # type: ignore[call-overload]
        return started[-1]

    monkeypatch.setattr(machine_code.subprocess, "Popen", popen)
    monkeypatch.setattr(solver, "PATIENCE", 3)
    planning = TrajectorySolver(horizon=FEW, flown=True)
    first = plans(planning, 2)
    assert not started
    plans(planning, 1)
    assert len(started) == 1
    others = TrajectorySolver(horizon=FEW, flown=True)
    plans(others, 4)
    assert len(started) == 1  # as the first one's has not ended, or has made it
    started[0].wait()
    assert list(cache.glob("*.so"))
    assert_same(plans(planning, 2), first)
    assert planning.compile()


def test_without_a_compiler_plans_are_interpreted(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine_code, "COMPILER", "no-such-compiler")
    planning = TrajectorySolver(horizon=FEW, flown=True)
    assert not planning.compile()
    assert not any(plan.held for plan in plans(planning))
    assert not cache.exists()


@needs_compiler
@pytest.mark.parametrize("fault", ["the compiler fails", "no cache", "a damaged library"])
def test_what_goes_wrong_costs_time_alone(fault: str, cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if fault == "the compiler fails":
        monkeypatch.setattr(machine_code, "COMPILER", "false")
    elif fault == "no cache":
        cache.write_text("not a folder")
    else:
        assert TrajectorySolver(horizon=FEW, flown=True).compile()
        monkeypatch.setattr(machine_code, "COMPILE", FAILS)
        for library in cache.glob("*.so"):
            library.unlink()  # written anew, as the old one is in use
            library.write_bytes(b"damaged")
    planning = TrajectorySolver(horizon=FEW, flown=True)
    assert not planning.compile()
    assert not any(plan.held for plan in plans(planning))


@needs_compiler
def test_code_in_a_folder_that_others_may_write_into_is_not_run(cache: Path) -> None:
    cache.mkdir()
    cache.chmod(0o777)
    assert not TrajectorySolver(horizon=FEW, flown=True).compile()
    assert not list(cache.iterdir())
    cache.chmod(0o700)
    assert TrajectorySolver(horizon=FEW, flown=True).compile()
    cache.chmod(0o770)
    assert not TrajectorySolver(horizon=FEW, flown=True).compile()


@needs_compiler
def test_code_that_nobody_has_used_for_long_is_removed(cache: Path) -> None:
    import casadi as ca

    x = ca.SX.sym("x")
    codes = [MachineCode([ca.Function("power", [x], [x**exponent])]) for exponent in (2, 3, 4)]
    for code in codes[:2]:
        code.make(wait=True)
    for path in cache.iterdir():
        os.utime(path, (0, 0))
    assert codes[0].load() is not None  # which uses it
    codes[2].make(wait=True)
    assert [code.load() is not None for code in codes] == [True, False, True]
    assert len(list(cache.glob("*.lock"))) == 2


def test_an_ipopt_of_its_own_is_not_compiled() -> None:
    assert not TrajectorySolver(horizon=FEW, flown=True, solver="ipopt").compile()


@needs_compiler
def test_the_key_is_of_the_formulas(cache: Path) -> None:
    import casadi as ca

    x = ca.SX.sym("x")
    square, cube = (ca.Function("power", [x], [x**exponent]) for exponent in (2, 3))
    for function in (square, cube, square):
        MachineCode([function]).make(wait=True)
    assert len(list(cache.glob("*.so"))) == 2
    for function in (square, cube):
        compiled = MachineCode([function]).load()
        assert compiled is not None
        assert float(compiled["power"](1.7)) == float(function(1.7))
