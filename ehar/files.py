"""Atomic writes of files, and JSON files read into data classes."""

import json
import os
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Any, TypeVar, Union, get_args, get_origin, get_type_hints

from ehar.errors import DataError, EharError, UsageError

if TYPE_CHECKING:
    from pydantic import TypeAdapter
    from pydantic_core import ErrorDetails

Kind = TypeVar("Kind")
Place = tuple[str | int, ...]  # the place of a value in a file: the keys and indices that lead to it

LONGEST = 80  # characters of a value that an error shows


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path with the same suffix; the file written there replaces `path` at the end.

    A missing folder is created.

    Raises:
        UsageError: the file cannot be written.
    """
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        with suppress(OSError):  # the file or its folder does not exist
            temporary.unlink()


def check_folder(folder: Path) -> None:
    """Raise a UsageError unless files can be written to a folder; a missing one can be made."""
    parent = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not parent.is_dir() or not os.access(parent, os.W_OK):
        raise UsageError(f"{folder}: expected a folder that can be written to, {parent} is not one")


def write_text(path: Path, pieces: Iterable[str]) -> None:
    """Write a text file, whole or not at all."""
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(pieces)


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def json_text(value: Any) -> str:
    """Return JSON for people and programs to read, with a newline at its end."""
    return json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def shortened(sha256: str) -> str:
    """Return the first digits of a hash: enough to tell one from another."""
    return sha256[:12]


def as_json(value: Any) -> Any:
    """Return a value as a JSON file would give it back: tuples become lists, and keys become text."""
    return json.loads(json.dumps(value))


def read_json(
    path: Path,
    kind: type[Kind],
    expected: str,
    *,
    unknown: bool = False,
    defaults: bool = False,
    optional: Collection[str] = (),
    wrong: type[EharError] = DataError,
) -> Kind:
    """Read a JSON file into a data class.

    Types are strict: text and bools are not numbers, and numbers are finite. A whole number may stand for a float.
    Limits of `annotated_types` are checked: `Annotated[int, Ge(1)]`.

    Args:
        path: the file.
        kind: the data class; its fields are the keys of the file, and nested data classes are objects.
        expected: name of such a file in errors: "a vehicle file".
        unknown: whether to ignore keys that are not fields.
        defaults: whether any key may be missing if its field has a default.
        optional: names of fields with defaults whose keys may be missing; older files lack them.
        wrong: class of the error for wrong content.

    Raises:
        UsageError: the file cannot be opened.
        EharError: the file is not JSON, or does not fit `kind`; an error of class `wrong` that names the file and the
            field.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")  # some editors write a mark of the byte order
    except OSError as error:
        raise UsageError(f"{path}: expected {expected}, got: {error.strerror}") from error
    except ValueError as error:
        raise wrong(f"{path}: expected the JSON of {expected}, got {error}") from error
    return parse_json(
        text, kind, str(path), expected, unknown=unknown, defaults=defaults, optional=optional, wrong=wrong
    )


def parse_json(
    text: str,
    kind: type[Kind],
    where: str,
    expected: str,
    *,
    unknown: bool = False,
    defaults: bool = False,
    optional: Collection[str] = (),
    wrong: type[EharError] = DataError,
) -> Kind:
    """Read JSON text into a data class, as `read_json` reads a file.

    Args:
        text: the JSON.
        kind: the data class.
        where: the source of the text in errors: the file, and the place in it.
        expected: name of such a text in errors.
        unknown: whether to ignore keys that are not fields.
        defaults: whether any key may be missing if its field has a default.
        optional: names of fields with defaults whose keys may be missing; older files lack them.
        wrong: class of the error for wrong content.

    Raises:
        EharError: the text is not JSON, or does not fit `kind`; an error of class `wrong`.
    """
    from pydantic import ValidationError  # imported here: it takes a tenth of a second

    try:
        value: Kind = _adapter(kind, unknown).validate_json(text)  # type: ignore[arg-type]  # mypy: unhashable
    except ValidationError as error:
        complaint = _complaint(kind, error.errors(include_url=False), expected)
        raise wrong(f"{where}: {complaint}") from error
    except EharError as error:  # from a data class that checks itself
        raise wrong(f"{where}: {error}") from error
    if not defaults:
        absent = [place for place in _absent(value, json.loads(text), ()) if place[-1] not in optional]
        if absent:
            raise wrong(f"{where}: {_wrong_keys(kind, min(absent, key=len)[:-1], absent, [])}")
    return value


@cache
def _adapter(kind: Any, unknown: bool) -> "TypeAdapter[Any]":
    """Return the pydantic adapter of a data class."""
    from pydantic import ConfigDict, TypeAdapter  # imported here: it takes a tenth of a second
    from typing_extensions import TypeAliasType

    # Pydantic reads the configuration of a data class from the class itself; for an alias it takes ours.
    config = ConfigDict(strict=True, extra="ignore" if unknown else "forbid", allow_inf_nan=False)
    renamed: Any = TypeAliasType("File", kind)
    return TypeAdapter(renamed, config=config)


def _absent(value: Any, held: Any, place: Place) -> Iterator[Place]:
    """Yield the places of the fields that are missing in a file and have their defaults."""
    if is_dataclass(value) and isinstance(held, dict):
        for name in (field.name for field in fields(value) if field.init):
            if name in held:
                yield from _absent(getattr(value, name), held[name], (*place, name))
            else:
                yield (*place, name)
    elif isinstance(value, tuple | list):
        for index, (item, held_item) in enumerate(zip(value, held, strict=True)):
            yield from _absent(item, held_item, (*place, index))
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from _absent(item, held[key], (*place, key))


def _complaint(kind: Any, errors: "list[ErrorDetails]", expected: str) -> str:
    """Return what is wrong with a file: its wrong keys, or else its first wrong value."""
    missing = [error["loc"] for error in errors if error["type"] == "missing" and isinstance(error["loc"][-1], str)]
    unknown = [error["loc"] for error in errors if error["type"] == "unexpected_keyword_argument"]
    if missing or unknown:
        return _wrong_keys(kind, (missing or unknown)[0][:-1], missing, unknown)
    first = errors[0]
    if first["type"] == "json_invalid":
        return f"expected the JSON of {expected}, got {first['ctx']['error']}"
    place, wanted = _at(kind, first["loc"])
    start = f"{_named(place)}: " if place else ""
    if first["type"] == "value_error":  # from a data class that checks itself
        return start + str(first["ctx"]["error"]).splitlines()[0]
    if first["type"] == "missing":  # a tuple is too short: the place is the index after its last item
        place, wanted = _at(kind, first["loc"][:-1])
        return f"{_named(place)}: expected {len(get_args(wanted))} items, got {_shown(first['input'])}"
    if not place:
        return f"expected the JSON object of {expected}, got {_shown(first['input'])}"
    # A value that may be of several types has an error for each.
    choices = dict.fromkeys(_wanted(error) for error in errors if _at(kind, error["loc"])[0] == place)
    return f"{start}expected {' or '.join(choices)}, got {_shown(first['input'])}"


def _wrong_keys(kind: Any, place: Place, missing: Iterable[Place], unknown: Iterable[Place]) -> str:
    """Return which keys of one object are missing or unknown, and which are expected there."""
    problems = []
    for problem, places in (("missing", missing), ("unknown", unknown)):
        keys = [_printable(str(key)) for *parent, key in places if tuple(parent) == place]
        if keys:
            problems.append(f"{problem} {_cut(', '.join(keys if problem == 'missing' else sorted(keys)))}")
    _, wanted = _at(kind, place)
    known = f"; expected {', '.join(field.name for field in fields(wanted))}" if is_dataclass(wanted) else ""
    return (f"{_named(place)}: " if place else "") + ", ".join(problems) + known


def _at(kind: Any, loc: Place) -> tuple[Place, Any]:
    """Return the place in a file that pydantic means, and the type that is expected there.

    The place ends at a value that may have several types: after that, pydantic only names one of the types.
    """
    place: Place = ()
    kind = _without_null(kind)
    for step in loc:
        if is_dataclass(kind):
            kind = get_type_hints(kind).get(str(step))
        elif get_origin(kind) is tuple and isinstance(step, int) and get_args(kind)[-1] is not Ellipsis:
            kind = get_args(kind)[min(step, len(get_args(kind)) - 1)]
        elif get_origin(kind) is tuple:
            kind = get_args(kind)[0]
        elif get_origin(kind) in (Union, UnionType):
            break
        else:  # a list or a mapping
            kind = get_args(kind)[-1] if get_args(kind) else None
        kind = _without_null(kind)
        place = (*place, step)
    return place, kind


def _without_null(kind: Any) -> Any:
    """Return X for the type `X | None`, and any other type unchanged."""
    if get_origin(kind) not in (Union, UnionType):
        return kind
    others = [argument for argument in get_args(kind) if argument is not type(None)]
    return others[0] if len(others) == 1 else kind


def _wanted(error: "ErrorDetails") -> str:
    """Return what pydantic expected, in our words."""
    limits = error.get("ctx", {})
    match error["type"]:
        case "int_type" | "int_from_float":
            return "a whole number"
        case "float_type":
            return "a number"
        case "finite_number":
            return "a finite number"
        case "string_type":
            return "text"
        case "bool_type":
            return "true or false"
        case "tuple_type" | "list_type":
            return "a list"
        case "dict_type" | "mapping_type" | "dataclass_type":
            return "an object"
        case "literal_error":
            return str(limits["expected"])
        case "too_long" | "too_short":
            least, most = limits.get("min_length"), limits.get("max_length")
            return f"at most {most} items" if least is None else f"at least {least} items"
        case "greater_than":
            return f"a number above {limits['gt']:g}"
        case "greater_than_equal":
            return f"at least {limits['ge']:g}"
        case "less_than_equal":
            return f"at most {limits['le']:g}"
    return error["msg"].removeprefix("Input should be ").splitlines()[0]


def _named(place: Place) -> str:
    """Return a place as errors write it: `spec.skeleton.bones[3]`."""
    steps = (f"[{step}]" if isinstance(step, int) else f".{_printable(step)}" for step in place)
    return "".join(steps).removeprefix(".")


def _printable(key: str) -> str:
    return _cut(key) if key.isprintable() else _cut(repr(key))


def _shown(value: Any) -> str:
    """Return a value on one line."""
    return json.dumps(value) if value is None or isinstance(value, bool) else _cut(repr(value))


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."
