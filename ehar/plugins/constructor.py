"""Making an object of a class of one's own: its constructor's arguments, checked against their annotations."""

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
        UsageError: an annotation names what does not exist.
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
        cls: its class.
        spec: the arguments that were given, as text or as Python literals.
        what: it is called in errors: "planner ./spiral.py:Spiral".
        handed: further arguments, as they are.

    Returns:
        the object, and the arguments that were given, converted to what their annotations say.

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
    except Exception as error:
        raise UsageError(f"{what}: its constructor raised {failure(error, cls)}") from error


def _converted(value: Any, parameter: inspect.Parameter, what: str) -> Any:
    """Return a value, or what its text says, as the parameter's type; tyro knows how each is written."""
    wanted = parameter.annotation
    if wanted is _ANY or wanted is Any:
        return value
    if wanted is str and isinstance(value, str):
        return value  # as it is, whatever it begins with
    import tyro  # here, as most planners come without arguments

    try:
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            return tyro.cli(wanted, args=_words(value, wanted), console_outputs=False)
    except (SystemExit, Exception):
        raise UsageError(f"{what}: {parameter.name}: expected {_type_text(wanted)}, got {value!r}") from None


def _words(value: Any, wanted: Any) -> list[str]:
    """Return a value as a command line has it."""
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
