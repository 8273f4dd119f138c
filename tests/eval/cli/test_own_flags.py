"""Flags after a class of one's own."""

from dataclasses import dataclass

import pytest

from ehar.errors import UsageError
from ehar.plugins.class_spec import parse_spec
from eval.cli.commands import Benchmark
from eval.cli.own_flags import fold_flags, options_of


@dataclass
class Options:
    planners: tuple[str, ...] = ()
    recogniser: str | None = None
    length: int = 60
    frame_rate: float = 1.0
    report: bool = True


OPTIONS = options_of(Options)


def folded(line: str) -> str:
    return " ".join(fold_flags(line.split(), OPTIONS))


def test_which_options_a_command_has() -> None:
    values = {"--planners": True, "--recogniser": True, "--length": True, "--frame-rate": True}
    assert OPTIONS == {"--help": False, **values, "--report": False, "--no-report": False}
    assert options_of(Benchmark)["--workers"]


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("no-act --length 5 oracle", "no-act --length 5 oracle"),
        ("a.py:A no-act", "a.py:A no-act"),
        ("a.py:A --radius 5 no-act", "a.py:A(radius='5') no-act"),
        ("a.py:A --radius=5 --turn -0.2 m.n:B --far x", "a.py:A(radius='5', turn='-0.2') m.n:B(far='x')"),
        ("a.py:A --radius 4 a.py:A --radius 6", "a.py:A(radius='4') a.py:A(radius='6')"),
        ("a.py:A(b=1) --c 2", "a.py:A(b=1, c='2')"),
        ("a.py:A() --c (1,2)", "a.py:A(c=(1,2))"),
        ("a.py:A --turn-rate 5", "a.py:A(turn_rate='5')"),
        ("a.py:A --length 5 --radius 6 --no-report", "a.py:A(radius='6') --length 5 --no-report"),
        ("--report a.py:A --radius 6", "--report a.py:A(radius='6')"),
        ("--recogniser m.py:M --depth 3 no-act", "--recogniser m.py:M(depth='3') no-act"),
        ("--recogniser=m.py:M --depth 3 a.py:A --r 1", "--recogniser m.py:M(depth='3') a.py:A(r='1')"),
        ("no-act --radius 5", "no-act --radius 5"),
        ("a.py:A no-act --radius 5", "a.py:A no-act --radius 5"),
        ("a.py:A --help", "a.py:A --help"),
        ("a.py:A --length", "a.py:A --length"),
        ("--recogniser", "--recogniser"),
    ],
)
def test_they_become_its_arguments(line: str, expected: str) -> None:
    assert folded(line) == expected


def test_text_stays_what_it_was_whatever_is_in_it() -> None:
    awkward = 'it\'s "5"\\ \n(x)'
    spec = parse_spec(fold_flags(["a.py:A", "--word", awkward], OPTIONS)[0])
    assert spec is not None
    assert spec.arguments == {"word": awkward}


@pytest.mark.parametrize(("line", "got"), [("a.py:A --radius", "none"), ("a.py:A --radius --turn 3", "--turn")])
def test_a_flag_without_a_value(line: str, got: str) -> None:
    with pytest.raises(UsageError) as error:
        folded(line)
    assert str(error.value) == f"a.py:A: expected a value after --radius, got {got}"
