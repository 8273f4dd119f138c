"""Flags of your own class: flags that follow it on the command line become arguments of its constructor."""

from collections.abc import Mapping, Sequence

from ehar.errors import UsageError

NAMES_A_CLASS = ("--recogniser", "--sensor", "--track")  # options whose value may be a class of your own


def fold_flags(arguments: Sequence[str], options: Mapping[str, bool]) -> list[str]:
    """Return the words of a command, with flags after your own class turned into its arguments.

    `spiral.py:Spiral --radius 5 no-act` becomes `spiral.py:Spiral(radius='5') no-act`. Each flag takes one value. The
    options of the command are never turned into arguments; an argument with the name of an option goes in the brackets.

    Args:
        arguments: the words after the command's name.
        options: options of the command, such as `--length`, and whether each takes a value.

    Raises:
        UsageError: a flag has no value.
    """
    folded: list[str] = []
    words = list(arguments)
    own: int | None = None  # index in `folded` of the class that flags belong to
    while words:
        word = words.pop(0)
        option, equals, value = word.partition("=")
        if option in NAMES_A_CLASS and (equals or words):
            folded += [option, value if equals else words.pop(0)]
            own = _own_at(folded)
        elif not word.startswith("--"):
            folded.append(word)
            own = _own_at(folded)
        elif option in options:
            folded += [word, *([words.pop(0)] if options[option] and not equals and words else [])]
        elif own is None:
            folded.append(word)  # tyro refuses it
        elif not equals and (not words or words[0].startswith("--")):
            raise UsageError(f"{folded[own]}: expected a value after {word}, got {words[0] if words else 'none'}")
        else:
            folded[own] = _with_argument(folded[own], option, value if equals else words.pop(0))
    return folded


def _own_at(folded: Sequence[str]) -> int | None:
    """Return the index of the last word if it names your own class, or None."""
    from planners.own_planner import own_spec  # imported here: too slow for `ehar --help`

    return len(folded) - 1 if own_spec(folded[-1]) is not None else None


def _with_argument(spec: str, option: str, value: str) -> str:
    """Return a spec with one more argument; a value in brackets is a literal, every other value is text."""
    name = option[2:].replace("-", "_")
    argument = f"{name}={value if value[:1] in ('(', '[') else repr(value)}"
    if not spec.endswith(")"):
        return f"{spec}({argument})"
    return f"{spec[:-1]}{'' if spec.endswith('()') else ', '}{argument})"
