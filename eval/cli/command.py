"""A command of the command line, made from the function that it runs: its parameters are the flags."""

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_args, get_type_hints

import tyro

from ehar.conditions import Conditions
from ehar.processes import cores

REQUIRED = inspect.Parameter.empty
_FIRST = ("planners", "data", "models", "out", "report", "sensor", "track")  # in help; the others as they come
_LEFT_OUT = ("reporter", "load", "effort")  # parameters that Python alone can give


@dataclass(frozen=True)
class Flag:
    """How a parameter looks on the command line, where that differs from the function.

    Args:
        text: what help says of it; None is what the function's docstring says.
        kind: its type; None is the parameter's.
        default: its default; None is the parameter's, `REQUIRED` none at all.
        positional: whether it is given without its name.
        metavar: what stands for its value in help.
        hint: what stands for its default in help, or for `required`.
    """

    text: str | None = None
    kind: Any = None
    default: Any = None
    positional: bool = False
    metavar: str | None = None
    hint: str | None = None


SHARED = {  # by every command that has such a parameter
    "models": Flag(metavar="PATH", hint="those that ship"),
    "fps": Flag(hint="the data's"),
    "recogniser": Flag("your own: file.py:Class, then --argument value.", hint="ours"),
    "out": Flag(hint="none"),
}


class Leaf(NamedTuple):
    """A parameter that becomes a flag, and what the docstring that it stands in says of it."""

    parameter: inspect.Parameter
    text: str


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
        doc = inspect.getdoc(self.function) or ""
        return re.split(r"^(?:Args|Returns|Raises):$", doc, flags=re.MULTILINE)[0].rstrip()

    @property
    def function(self) -> Callable[..., Any]:
        """What it runs."""
        module, _, name = self.place.partition(":")
        found: Callable[..., Any] = getattr(import_module(module), name)
        return found

    def options(self) -> dict[str, bool]:
        """Return its options, such as `--length`, and whether a value follows each."""
        known = {"--help": False}
        for name, (parameter, _) in self.leaves().items():
            option = f"--{name.replace('_', '-')}"
            known[option] = parameter.annotation is not bool
            if parameter.annotation is bool:
                known[f"--no-{option[2:]}"] = False
        return known

    def parse(self, prog: str, words: Sequence[str]) -> Callable[[], int | None]:
        """Return the call that the words ask for.

        Raises:
            SystemExit: help was printed (code 0), or tyro refused a word (2).
            EharError: a word or a number makes no sense, as the data classes that the function takes say.
        """

        def collect(**given: Any) -> dict[str, Any]:
            return given

        flags = [self._flag(leaf) for leaf in sorted(self.leaves().values(), key=self._rank)]
        collect.__signature__ = inspect.Signature(flags)  # type: ignore[attr-defined]  # which tyro reads
        collect.__annotations__ = {flag.name: flag.annotation for flag in flags}
        config = (tyro.conf.DisallowNone,)
        given = tyro.cli(collect, prog=prog, description=self.help, args=words, config=config)
        arguments = {name: self._value(parameter, given) for name, parameter in _parameters_of(self.function).items()}
        to_show = {name: given[name] for name in self._shown()}
        return lambda: self.show(self.function(**arguments), **to_show)

    def _shown(self) -> dict[str, inspect.Parameter]:
        """Return the parameters of `show` behind the first, which is what the function returned."""
        return dict(list(_parameters_of(self.show).items())[1:])

    def _fields(self, kind: Any) -> dict[str, inspect.Parameter]:
        """Return the fields of a data class as parameters; of conditions, those that are flags."""
        hints = Conditions.named_types() if kind is Conditions else get_type_hints(kind)
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

    def leaves(self) -> dict[str, Leaf]:
        """Return the parameters that are flags, also those within data classes, by name."""
        found: dict[str, Leaf] = {}

        def add(parameters: Mapping[str, inspect.Parameter], texts: Mapping[str, str]) -> None:
            for name, parameter in parameters.items():
                kind = _without_none(parameter.annotation)
                if is_dataclass(kind):
                    add(self._fields(kind), _texts(kind))
                else:
                    found[name] = Leaf(parameter, texts.get(name, ""))

        add(_parameters_of(self.function), _texts(self.function))
        add(self._shown(), _texts(self.show))
        return found

    def _value(self, parameter: inspect.Parameter, given: Mapping[str, Any]) -> Any:
        """Return a parameter's value: what was given or, of a data class, one made of it."""
        kind: Any = _without_none(parameter.annotation)
        if not is_dataclass(kind):
            return given[parameter.name]
        make: Callable[..., Any] = kind  # type: ignore[assignment]
        return make(**{name: self._value(part, given) for name, part in self._fields(kind).items()})

    def text_of(self, leaf: Leaf) -> str:
        """Return what help says of a flag."""
        return self._rules(leaf.parameter.name).text or leaf.text

    def _rules(self, name: str) -> Flag:
        return self.flags.get(name) or SHARED.get(name, Flag())

    def _rank(self, leaf: Leaf) -> int:
        """Return how far down a flag stands in help; those of one rank stay in order."""
        name = leaf.parameter.name
        if self._rules(name).positional:
            return -1
        return _FIRST.index(name) if name in _FIRST else len(_FIRST)

    def _flag(self, leaf: Leaf) -> inspect.Parameter:
        """Return a parameter as the command line has it."""
        parameter, name = leaf.parameter, leaf.parameter.name
        flag = self._rules(name)
        default = parameter.default if flag.default is None else flag.default
        if name == "workers":
            default = cores()
        hint = None
        if flag.hint is not None and (default is None or default == ()):
            hint = f"(default: {flag.hint})"
        elif flag.hint is not None and default is REQUIRED:
            hint = f"({flag.hint})"
        told = tyro.conf.arg(metavar=flag.metavar, help=self.text_of(leaf), help_behavior_hint=hint)
        kind: Any = flag.kind or _plain(parameter.annotation)
        annotation: Any = Annotated[kind, told]
        if flag.positional:
            annotation = Annotated[annotation, tyro.conf.Positional]
        if default is False:
            annotation = Annotated[annotation, tyro.conf.FlagCreatePairsOff]
        return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def _texts(documented: Any) -> dict[str, str]:
    """Return what a docstring says of each argument, on one line."""
    section = (inspect.getdoc(documented) or "").partition("Args:\n")[2].partition("\n\n")[0]
    found = re.findall(r"^ {4}(\w+): (.*(?:\n {5,}.*)*)", section, flags=re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in found}


def _parameters_of(function: Callable[..., Any]) -> Mapping[str, inspect.Parameter]:
    """Return a function's parameters but those for Python alone; annotations that are text stay so."""
    found = inspect.signature(function).parameters
    return {name: parameter for name, parameter in found.items() if name not in _LEFT_OUT}


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
