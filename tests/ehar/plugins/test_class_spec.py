"""The names of a user's own classes."""

from pathlib import Path
from typing import Any

import pytest

from ehar.errors import UsageError
from ehar.plugins.class_spec import ClassSpec, arguments_text, json_arguments, parse_spec


@pytest.mark.parametrize(
    ("text", "place", "name", "arguments"),
    [
        ("./spiral.py:Spiral", "./spiral.py", "Spiral", {}),
        ("my_lab.views:Spiral()", "my_lab.views", "Spiral", {}),
        ("spiral.py:Spiral(radius=5, turn='left')", "spiral.py", "Spiral", {"radius": 5, "turn": "left"}),
        ("a (b)/x.py:S(path='a:b.py:C(d=1)')", "a (b)/x.py", "S", {"path": "a:b.py:C(d=1)"}),
        (r"C:\lab\x.py:S(at=(1, -2.5), on=None)", r"C:\lab\x.py", "S", {"at": (1, -2.5), "on": None}),
        ("spiral", "", "spiral", {}),
        ("spiral-2.b(radius=5)", "", "spiral-2.b", {"radius": 5}),
    ],
)
def test_forms(text: str, place: str, name: str, arguments: dict[str, Any]) -> None:
    assert parse_spec(text) == ClassSpec(place, name, arguments)


@pytest.mark.parametrize(
    "text", ["", "spiral.py:", "spiral.py:3D", ":Spiral", "--radius", "a b", "spiral.py:Spiral(", "il/0"]
)
def test_what_is_no_such_name(text: str) -> None:
    assert parse_spec(text) is None


@pytest.mark.parametrize(
    "call", ["(5)", "(radius=five)", "(radius=)", "(**{'a': 1})", "(a=1, a=2)", "(open('x'))", "(a=open('x'))"]
)
def test_arguments_are_names_and_literals(call: str) -> None:
    with pytest.raises(UsageError) as error:
        parse_spec(f"x.py:S{call}")
    assert str(error.value).startswith(
        f"x.py:S{call}: expected arguments as (radius=5, turn='left'), names and Python "
    )
    assert "\n" not in str(error.value)


def test_arguments_are_written_shortly_and_exactly() -> None:
    arguments = {"radius": 5.0, "turn": 0.1 + 0.2, "way": "left", "at": (1, 2.0), "path": Path("a/b"), "on": None}
    assert arguments_text(arguments) == "radius=5, turn=0.30000000000000004, way=left, at=(1 2), path=a/b, on=None"
    assert json_arguments(arguments) == {**arguments, "at": [1, 2.0], "path": "a/b"}
    assert json_arguments({"far": float("inf"), "of": {1: (2,)}}) == {"far": "inf", "of": {"1": [2]}}
