"""A command of the command line, made from a function: the parameters of the function are the flags."""

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
_FIRST = ("planners", "data", "models", "out", "report", "sensor", "track")  # first in help, in this order
_ONLY_IF_READ = ("unit", "up")  # parameters of `show` that are flags only if the function has them
_LEFT_OUT = ("reporter", "load", "effort")  # parameters that are no flags


@dataclass(frozen=True)
class Flag:
    """How a parameter looks on the command line, if it looks other than in the function.

    Args:
        text: its text in help; None takes the text of the function's docstring.
        kind: its type; None takes the type of the parameter.
        default: its default; None takes the default of the parameter, `REQUIRED` means no default.
        positional: whether it is given without its name.
        metavar: the word for its value in help.
        hint: the text in help in place of its default, or in place of `required`.
    """

    text: str | None = None
    kind: Any = None
    default: Any = None
    positional: bool = False
    metavar: str | None = None
    hint: str | None = None


OF_SENSOR = "perfect; our streams estimator"
SHARED = {  # for every command with such a parameter
    "models": Flag(metavar="PATH", hint="those that ship"),
    "sensor": Flag(hint=OF_SENSOR),
    "length": Flag("frames of an episode.", hint="60"),
    "fps": Flag(hint="the data's"),
    "recogniser": Flag("your own: file.py:Class, then --argument value.", hint="ours"),
    "out": Flag(hint="none"),
}


class Leaf(NamedTuple):
    """A parameter that becomes a flag, and its text in the docstring."""

    parameter: inspect.Parameter
    text: str


@dataclass(frozen=True)
class Command:
    """A command.

    Args:
        place: place of the function, `module:function`; it is imported when the command is named.
        show: prints the result of the function, and may return an exit code. Its other parameters are flags too.
        text: its help: a first line, which lists of commands show, and examples. Empty takes the function's docstring.
        conditions: the fields of `Conditions` that are flags, if the function takes conditions.
        flags: parameters that look other than in the function.
    """

    place: str
    show: Callable[..., int | None]
    text: str = ""
    conditions: tuple[str, ...] = ()
    flags: Mapping[str, Flag] = field(default_factory=dict)

    @property
    def help(self) -> str:
        """The text above the flags in its help."""
        if self.text:
            return inspect.cleandoc(self.text)
        doc = inspect.getdoc(self.function) or ""
        return re.split(r"^(?:Args|Returns|Raises):$", doc, flags=re.MULTILINE)[0].rstrip()

    @property
    def function(self) -> Callable[..., Any]:
        """The function that it runs."""
        module, _, name = self.place.partition(":")
        found: Callable[..., Any] = getattr(import_module(module), name)
        return found

    def options(self) -> dict[str, bool]:
        """Return its options, such as `--length`, and whether each takes a value."""
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
            EharError: a data class that the function takes refuses a word or a number.
        """

        def collect(**given: Any) -> dict[str, Any]:
            return given

        flags = [self._flag(leaf) for leaf in sorted(self.leaves().values(), key=self._rank)]
        collect.__signature__ = inspect.Signature(flags)  # type: ignore[attr-defined]  # tyro reads it
        collect.__annotations__ = {flag.name: flag.annotation for flag in flags}
        config = (tyro.conf.DisallowNone,)
        given = tyro.cli(collect, prog=prog, description=self.help, args=words, config=config)
        arguments = {name: self._value(parameter, given) for name, parameter in _parameters_of(self.function).items()}
        to_show = {name: given[name] for name in self._shown()}
        return lambda: self.show(self.function(**arguments), **to_show)

    def _shown(self) -> dict[str, inspect.Parameter]:
        """Return the parameters of `show` after the first, which takes the result of the function."""
        own = _parameters_of(self.function)
        shown = list(_parameters_of(self.show).items())[1:]
        return {name: parameter for name, parameter in shown if name not in _ONLY_IF_READ or name in own}

    def _fields(self, kind: Any) -> dict[str, inspect.Parameter]:
        """Return the fields of a data class as parameters; for `Conditions`, only the fields that are flags."""
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
        """Return the parameters that are flags by name, with the fields of data classes."""
        found: dict[str, Leaf] = {}

        def add(parameters: Mapping[str, inspect.Parameter], texts: Mapping[str, str]) -> None:
            for name, parameter in parameters.items():
                kind = _without_none(parameter.annotation)
                if is_dataclass(kind):
                    add(self._fields(kind), _texts(kind))
                else:
                    found.setdefault(name, Leaf(parameter, texts.get(name, "")))  # the function's, if `show` has it too

        add(_parameters_of(self.function), _texts(self.function))
        add(self._shown(), _texts(self.show))
        return found

    def _value(self, parameter: inspect.Parameter, given: Mapping[str, Any]) -> Any:
        """Return a parameter's value: the given one, or a data class made from the given ones."""
        kind: Any = _without_none(parameter.annotation)
        if not is_dataclass(kind):
            return given[parameter.name]
        make: Callable[..., Any] = kind  # type: ignore[assignment]
        return make(**{name: self._value(part, given) for name, part in self._fields(kind).items()})

    def text_of(self, leaf: Leaf) -> str:
        """Return the text of a flag in help."""
        return self._rules(leaf.parameter.name).text or leaf.text

    def _rules(self, name: str) -> Flag:
        return self.flags.get(name) or SHARED.get(name, Flag())

    def _rank(self, leaf: Leaf) -> int:
        """Return the rank of a flag in help; flags of the same rank keep their order."""
        name = leaf.parameter.name
        if self._rules(name).positional:
            return -1
        return _FIRST.index(name) if name in _FIRST else len(_FIRST)

    def _flag(self, leaf: Leaf) -> inspect.Parameter:
        """Return a parameter with the type, default and help of the command line."""
        parameter, name = leaf.parameter, leaf.parameter.name
        flag = self._rules(name)
        default = parameter.default if flag.default is None else flag.default
        if name == "workers":
            default = cores()
        hint = None
        if flag.hint is not None:
            hint = f"({flag.hint})" if default is REQUIRED else f"(default: {flag.hint})"
        told = tyro.conf.arg(metavar=flag.metavar, help=self.text_of(leaf), help_behavior_hint=hint)
        kind: Any = flag.kind or _plain(parameter.annotation)
        annotation: Any = Annotated[kind, told]
        if flag.positional:
            annotation = Annotated[annotation, tyro.conf.Positional]
        if default is False:
            annotation = Annotated[annotation, tyro.conf.FlagCreatePairsOff]
        return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def _texts(documented: Any) -> dict[str, str]:
    """Return the text of each argument in a docstring, on one line."""
    section = (inspect.getdoc(documented) or "").partition("Args:\n")[2].partition("\n\n")[0]
    found = re.findall(r"^ {4}(\w+): (.*(?:\n {5,}.*)*)", section, flags=re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in found}


def _parameters_of(function: Callable[..., Any]) -> Mapping[str, inspect.Parameter]:
    """Return a function's parameters without those that are no flags; annotations may be strings."""
    found = inspect.signature(function).parameters
    return {name: parameter for name, parameter in found.items() if name not in _LEFT_OUT}


def _without_none(kind: Any) -> Any:
    """Return X for a type `X | None`, and every other type as it is."""
    others = [choice for choice in get_args(kind) if choice is not type(None)]
    return others[0] if len(others) == 1 and type(None) in get_args(kind) else kind


def _plain(kind: Any) -> Any:
    """Return the type on the command line; if the function takes several, a path, or else text."""
    choices = get_args(kind)
    if str not in choices:
        return kind
    plain = Path if Path in choices else str
    return plain | None if type(None) in choices else plain
