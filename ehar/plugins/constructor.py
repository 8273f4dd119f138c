"""Makes an object of a user's own class: the arguments of the constructor are checked against its annotations."""

import inspect
import typing
from collections.abc import Mapping
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from typing import Any

from ehar.errors import EharError, UsageError
from ehar.plugins.class_spec import ClassSpec
from ehar.plugins.loading import failure

_ANY = inspect.Parameter.empty


def parameters_of(cls: type[Any], what: str) -> dict[str, inspect.Parameter]:
    """Return the constructor's parameters that can be given by name, their annotations as types.

    Raises:
        UsageError: an annotation has an unknown name.
    """
    by_name = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    try:
        hints = typing.get_type_hints(cls.__init__)
        signature = inspect.signature(cls)
    except (NameError, TypeError, ValueError) as error:
        raise UsageError(f"{what}: its constructor's annotations cannot be read: {failure(error, cls)}") from error
    return {
        name: parameter.replace(annotation=hints.get(name, _ANY))
        for name, parameter in signature.parameters.items()
        if parameter.kind in by_name
    }


def construct(cls: type[Any], spec: ClassSpec, what: str, handed: Mapping[str, Any]) -> tuple[Any, dict[str, Any]]:
    """Make an object.

    Args:
        cls: class of the object.
        spec: the given arguments, as text or as Python literals.
        what: name of the object in errors: "planner ./spiral.py:Spiral".
        handed: more arguments; these are not converted.

    Returns:
        the object, and the given arguments, converted to the types of their annotations.

    Raises:
        UsageError: an argument is unknown, missing or of another type, or the constructor fails.
    """
    parameters = parameters_of(cls, what)
    for name in spec.arguments:
        if name not in parameters:
            known = ", ".join(_described(parameter) for parameter in parameters.values())
            raise UsageError(
                f"{what}: unknown argument {name!r}; " + (f"it takes {known}" if known else "it takes none")
            )
    given = {name: _converted(value, parameters[name], what) for name, value in spec.arguments.items()}
    for name, parameter in parameters.items():
        if parameter.default is _ANY and name not in given and name not in handed:
            raise UsageError(
                f"{what}: expected its argument {_described(parameter)}, got none; "
                f"give it as --{name.replace('_', '-')} VALUE after it, or as {spec.name}({name}=...)"
            )
    try:
        return cls(**{**handed, **given}), given
    except EharError:
        raise
    except (Exception, SystemExit) as error:
        raise UsageError(f"{what}: its constructor raised {failure(error, cls)}") from error


def _converted(value: Any, parameter: inspect.Parameter, what: str) -> Any:
    """Convert a value, or the text of a value, to the parameter's type; tyro parses the text."""
    wanted = parameter.annotation
    if wanted is _ANY or wanted is Any:
        return value
    if wanted is str and isinstance(value, str):
        return value  # tyro would refuse a text that begins with a dash
    import tyro  # imported here: most planners have no arguments

    try:
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            return tyro.cli(wanted, args=_words(value, wanted), console_outputs=False)
    except (SystemExit, Exception):
        raise UsageError(f"{what}: {parameter.name}: expected {_type_text(wanted)}, got {value!r}") from None


def _words(value: Any, wanted: Any) -> list[str]:
    """Return a value as words of a command line."""
    if isinstance(value, tuple | list):
        return [str(part) for part in value]
    alternatives = (wanted, *typing.get_args(wanted))
    if isinstance(value, str) and any((typing.get_origin(one) or one) in (tuple, list) for one in alternatives):
        return value.split()
    text = str(value)
    return [text.capitalize()] if bool in alternatives and text in ("true", "false") else [text]


def _described(parameter: inspect.Parameter) -> str:
    kind = "" if parameter.annotation is _ANY else f": {_type_text(parameter.annotation)}"
    return f"{parameter.name}{kind}" + ("" if parameter.default is _ANY else f" = {parameter.default!r}")


def _type_text(wanted: Any) -> str:
    return (
        wanted.__name__
        if isinstance(wanted, type) and not typing.get_args(wanted)
        else str(wanted).replace("typing.", "")
    )
