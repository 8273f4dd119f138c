"""A command of the command line, made from the function that it runs: its parameters are the flags."""

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, get_args, get_type_hints

import tyro

from ehar.conditions import Conditions
from ehar.processes import cores

REQUIRED = inspect.Parameter.empty
_LEFT_OUT = ("reporter", "load", "effort")  # parameters that Python alone can give


@dataclass(frozen=True)
class Flag:
    """How a parameter looks on the command line, where that differs from the function.

    Args:
        kind: its type; None is the parameter's.
        default: its default; None is the parameter's, `REQUIRED` none at all.
        positional: whether it is given without its name.
        metavar: what stands for its value in help.
        hint: what stands for its default in help.
    """

    kind: Any = None
    default: Any = None
    positional: bool = False
    metavar: str | None = None
    hint: str | None = None


SHARED = {  # by every command that has such a parameter
    "models": Flag(hint="those that ship"),
    "fps": Flag(hint="the data's"),
    "recogniser": Flag(hint="ours"),
    "out": Flag(hint="none"),
}


@dataclass(frozen=True)
class Command:
    """A command.

    Args:
        place: of the function, `module:function`; imported when the command is named.
        show: prints what the function returned, and may return an exit code. Its further parameters are flags too.
        text: its help: a line, which lists of commands show, and examples; empty where the function's docstring is it.
        conditions: which fields of `Conditions` are flags, where the function takes them.
        flags: parameters that look otherwise than in Python.
    """

    place: str
    show: Callable[..., int | None]
    text: str = ""
    conditions: tuple[str, ...] = ()
    flags: Mapping[str, Flag] = field(default_factory=dict)

    @property
    def help(self) -> str:
        """What its help begins with."""
        if self.text:
            return inspect.cleandoc(self.text)
        return (inspect.getdoc(self.function) or "").partition("Args:\n")[0].rstrip()

    @property
    def function(self) -> Callable[..., Any]:
        """What it runs."""
        module, _, name = self.place.partition(":")
        found: Callable[..., Any] = getattr(import_module(module), name)
        return found

    def options(self) -> dict[str, bool]:
        """Return its options, such as `--length`, and whether a value follows each."""
        known = {"--help": False}
        for parameter in self._leaves(self._parameters()):
            option = f"--{parameter.name.replace('_', '-')}"
            known[option] = parameter.annotation is not bool
            if parameter.annotation is bool:
                known[f"--no-{option[2:]}"] = False
        return known

    def parse(self, prog: str, words: Sequence[str]) -> Callable[[], int | None]:
        """Return the call that the words ask for.

        Raises:
            SystemExit: help was printed (code 0), or tyro refused a word (2).
        """
        parameters = self._parameters()
        told = _arguments(self.function) + _arguments(self.show)
        doc = f"{self.help}\n\nArgs:\n{told}" if told else self.help
        collect = self._maker(dict, parameters, doc)
        given = tyro.cli(collect, prog=prog, args=words, config=(tyro.conf.DisallowNone,))
        to_show = {name: given.pop(name) for name in self._shown()}
        return lambda: self.show(self.function(**given), **to_show)

    def _parameters(self) -> dict[str, inspect.Parameter]:
        found = {**_parameters_of(self.function), **self._shown()}
        return {name: parameter for name, parameter in found.items() if name not in _LEFT_OUT}

    def _shown(self) -> dict[str, inspect.Parameter]:
        """Return the parameters of `show` behind the first, which is what the function returned."""
        return dict(list(_parameters_of(self.show).items())[1:])

    def _fields(self, kind: Any) -> dict[str, inspect.Parameter]:
        """Return the fields of a data class as parameters; of conditions, those that are flags."""
        if kind is Conditions:
            hints = Conditions.named_types()
        else:
            hints = get_type_hints(kind)
        return {
            part.name: inspect.Parameter(
                part.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=REQUIRED if part.default is MISSING else part.default,
                annotation=hints[part.name],
            )
            for part in fields(kind)
            if kind is not Conditions or part.name in self.conditions
        }

    def _leaves(self, parameters: Mapping[str, inspect.Parameter]) -> Iterator[inspect.Parameter]:
        """Yield the parameters that are flags, also those within data classes."""
        for parameter in parameters.values():
            kind = _without_none(parameter.annotation)
            if is_dataclass(kind):
                yield from self._leaves(self._fields(kind))
            else:
                yield parameter

    def _maker(
        self, make: Callable[..., Any], parameters: Mapping[str, inspect.Parameter], doc: str | None
    ) -> Callable[..., Any]:
        """Return a function for tyro, which reads its signature, that makes something of keywords."""

        def made(**given: Any) -> Any:
            return make(**given)

        flags = {name: self._flag(parameter) for name, parameter in parameters.items()}
        made.__signature__ = inspect.Signature(list(flags.values()))  # type: ignore[attr-defined]
        made.__annotations__ = {name: parameter.annotation for name, parameter in flags.items()}
        made.__doc__ = doc
        return made

    def _flag(self, parameter: inspect.Parameter) -> inspect.Parameter:
        """Return a parameter as the command line has it."""
        name, kind = parameter.name, _without_none(parameter.annotation)
        if is_dataclass(kind):
            constructor = self._maker(kind, self._fields(kind), kind.__doc__)  # type: ignore[arg-type]
            whole: Any = Annotated[kind, tyro.conf.arg(name="", constructor=constructor)]
            return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=whole)
        flag = self.flags.get(name) or SHARED.get(name, Flag())
        default = parameter.default if flag.default is None else flag.default
        if name == "workers":
            default = cores()
        annotation = flag.kind or _plain(parameter.annotation)
        hint = flag.hint if default is None or default == () else None
        marks: list[Any] = [tyro.conf.Positional] if flag.positional else []
        if flag.metavar or hint:
            marks.append(tyro.conf.arg(metavar=flag.metavar, help_behavior_hint=hint and f"(default: {hint})"))
        for mark in marks:
            annotation = Annotated[annotation, mark] if not isinstance(mark, type(Annotated)) else mark[annotation]
        return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def _arguments(function: Callable[..., Any]) -> str:
    """Return what a docstring says of arguments."""
    _, _, rest = (inspect.getdoc(function) or "").partition("Args:\n")
    return rest.partition("\n\n")[0].rstrip() + "\n" if rest else ""


def _parameters_of(function: Callable[..., Any]) -> Mapping[str, inspect.Parameter]:
    """Return a function's parameters; annotations that are text, as of what takes long to import, stay so."""
    return inspect.signature(function).parameters


def _without_none(kind: Any) -> Any:
    """Return a type without None, where it is one other."""
    others = [choice for choice in get_args(kind) if choice is not type(None)]
    return others[0] if len(others) == 1 and type(None) in get_args(kind) else kind


def _plain(kind: Any) -> Any:
    """Return the type that a command line gives where Python takes several: a path, or else text."""
    choices = get_args(kind)
    if str not in choices:
        return kind
    plain = Path if Path in choices else str
    return plain | None if type(None) in choices else plain
