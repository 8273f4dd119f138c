"""The names of a user's own classes: `path/to/file.py:Class` or `package.module:Class`, with arguments in brackets."""

import ast
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ehar.errors import UsageError

FORMS = "path/to/file.py:ClassName or package.module:ClassName"
_SPEC = re.compile(r"(?:(?P<place>[^-(\s].*?):(?=[^\W\d]))?(?P<name>[^\W\d][\w.-]*)(?P<call>\(.*\))?", re.DOTALL)


@dataclass(frozen=True)
class ClassSpec:
    """A class, and the arguments of its constructor.

    Args:
        place: a .py file, or a module; empty if the text is only a name.
        name: name of the class, or the name that was given alone.
        arguments: the arguments by name, as Python literals.
    """

    place: str
    name: str
    arguments: Mapping[str, Any] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """The text that named the class, without arguments."""
        return f"{self.place}:{self.name}" if self.place else self.name

    @property
    def is_file(self) -> bool:
        """Whether the place is a file; otherwise it is a module."""
        return self.place.endswith(".py")


def parse_spec(text: str) -> ClassSpec | None:
    """Parse `file.py:Class`, `module:Class` or a name, each with or without `(argument=value, ...)`.

    Values are Python literals: `spiral.py:Spiral(radius=5, turn='left')`. The result is None for any other text.

    Raises:
        UsageError: the brackets hold anything but named literals.
    """
    match = _SPEC.fullmatch(text)
    if match is None or (match["place"] and not match["name"].isidentifier()):
        return None
    return ClassSpec(match["place"] or "", match["name"], _literals(text, match["call"] or "()"))


def arguments_text(arguments: Mapping[str, Any]) -> str:
    """Return arguments as text for people, `radius=5, turn=left`; equal values give equal texts."""
    return ", ".join(f"{name}={_value_text(value)}" for name, value in arguments.items())


def json_arguments(arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Return arguments for JSON, so that they can be made again from it; paths and infinities become text."""
    return {name: _json_value(value) for name, value in arguments.items()}


def _literals(text: str, call: str) -> dict[str, Any]:
    try:
        parsed = ast.parse(f"f{call}", mode="eval").body
        if not isinstance(parsed, ast.Call) or parsed.args or not all(keyword.arg for keyword in parsed.keywords):
            raise ValueError("something without a name")
        if len({keyword.arg for keyword in parsed.keywords}) < len(parsed.keywords):
            raise ValueError("a name twice")
        return {str(keyword.arg): ast.literal_eval(keyword.value) for keyword in parsed.keywords}
    except (SyntaxError, ValueError) as error:
        reason = error.msg if isinstance(error, SyntaxError) else error
        raise UsageError(
            f"{text}: expected arguments as (radius=5, turn='left'), names and Python literals, got {call}: {reason}"
        ) from error


def _value_text(value: Any) -> str:
    if isinstance(value, float):
        short = f"{value:g}"
        return short if float(short) == value else repr(value)
    if isinstance(value, tuple | list):
        return f"({' '.join(map(_value_text, value))})"
    return str(value)


def _json_value(value: Any) -> Any:
    if isinstance(value, tuple | list):
        return [_json_value(part) for part in value]
    if isinstance(value, dict):
        return {str(key): _json_value(part) for key, part in value.items()}
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if not isinstance(value, bool | int | float | str | None):
        return str(value)
    return value
