"""Flags after a user's own class."""

import pytest

from ehar.errors import UsageError
from ehar.plugins.class_spec import parse_spec
from eval.cli.commands.benchmark import BENCHMARK
from eval.cli.own_flags import fold_flags

WITH_VALUES = ("--planners", "--recogniser", "--sensor", "--track", "--length", "--frame-rate")
OPTIONS = {**dict.fromkeys(WITH_VALUES, True), **dict.fromkeys(("--help", "--report", "--no-report"), False)}


def folded(line: str) -> str:
    return " ".join(fold_flags(line.split(), OPTIONS))


def test_the_benchmarks_options_are_no_arguments_of_a_class() -> None:
    known = BENCHMARK.options()
    assert known["--workers"] and known["--length"] and not known["--no-report"]
    words = ["a.py:A", "--length", "5", "--radius", "6", "--no-report"]
    assert fold_flags(words, known) == ["a.py:A(radius='6')", "--length", "5", "--no-report"]


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
        ("--sensor s.py:S --noise 3 no-act", "--sensor s.py:S(noise='3') no-act"),
        ("--track=t.py:T --lag 2 a.py:A --r 1", "--track t.py:T(lag='2') a.py:A(r='1')"),
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
