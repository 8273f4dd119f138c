"""Recognisers of one's own: from a file or a module, made for the data that they will see."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ehar.data.motion_data import MotionData
from ehar.errors import ModelError, UsageError
from ehar.plugins.class_spec import FORMS, arguments_text, json_arguments, parse_spec
from ehar.plugins.constructor import construct, parameters_of
from ehar.plugins.loading import load_class, source_sha256
from ehar.recogniser import Recogniser

HANDED = ("class_names", "skeleton", "persons", "fps")  # of the data, to a constructor that has such arguments
PARTS = ("class_names", "embedding_size", "start", "step")


@dataclass(frozen=True, eq=False)
class OwnRecogniser:
    """A recogniser that somebody brought.

    Args:
        recogniser: as the contract `ehar.recogniser.Recogniser` has it.
        title: the class's name and what its constructor was given, for tables.
        spec: how it was named; of an object, its class.
        sha256: of the file of its class, its arguments, the files that they name and, where it has one, its own
            `sha256`, which should be that of its weights.
    """

    recogniser: Recogniser
    title: str
    spec: str
    sha256: str


def resolve_recogniser(brought: str | Recogniser, data: MotionData) -> OwnRecogniser:
    """Return a recogniser of one's own that fits the data.

    A constructor that has arguments called `class_names`, `skeleton`, `persons` or `fps` is handed those of the data.
    Nothing is unpickled here: what a constructor reads, it reads itself.

    Args:
        brought: an object, which is meant as it is, or `path/to/file.py:Class` or `package.module:Class`, with or
            without `(argument=value, ...)`.
        data: what it will be used on.

    Raises:
        UsageError: it cannot be loaded or made, or is no recogniser.
        ModelError: it recognises other classes.
    """
    given: dict[str, Any] = {}
    if isinstance(brought, str):
        spec = parse_spec(brought)
        if spec is None or not spec.place:
            raise UsageError(f"unknown recogniser {brought!r}; expected {FORMS}")
        what, named = f"recogniser {spec.title}", brought
        cls = load_class(spec, "recogniser")
        missing = [part for part in ("start", "step") if not callable(getattr(cls, part, None))]
        if missing:
            raise UsageError(_no_recogniser(what, missing))
        of_data = {name: getattr(data, name) for name in HANDED}
        handed = {name: of_data[name] for name in parameters_of(cls, what) if name in of_data}
        recogniser, given = construct(cls, spec, what, handed)
    else:
        recogniser, cls = brought, type(brought)
        named = f"{cls.__module__}.{cls.__qualname__}"
        what = f"recogniser {named}"
    _check_contract(recogniser, data, what)
    title = f"{cls.__name__}({arguments_text(given)})" if given else cls.__name__
    return OwnRecogniser(recogniser, title, named, _sha256(recogniser, given))


def _check_contract(recogniser: Any, data: MotionData, what: str) -> None:
    """Raise unless an object has what the contract has, and knows the data's classes."""
    if isinstance(recogniser, type):
        raise UsageError(f"{what}: expected a recogniser, got a class; make one: {recogniser.__name__}(...)")
    missing = [part for part in PARTS if not hasattr(recogniser, part)]
    if missing:
        raise UsageError(_no_recogniser(what, missing))
    if tuple(recogniser.class_names) != data.class_names:
        raise ModelError(
            f"{what}: class_names: expected those of {data.name}, {data.class_names}, got {recogniser.class_names}"
        )
    size = recogniser.embedding_size
    if not isinstance(size, int) or size < 1:
        raise UsageError(f"{what}: embedding_size: expected a number of at least 1, got {size!r}")


def _no_recogniser(what: str, missing: list[str]) -> str:
    return f"{what}: expected what ehar.recogniser.Recogniser has, missing: {', '.join(missing)}"


def _sha256(recogniser: Recogniser, given: dict[str, Any]) -> str:
    files = [value for value in given.values() if isinstance(value, Path) and value.is_file()]
    parts = {
        "source": source_sha256(type(recogniser)),
        "arguments": json_arguments(given),
        "files": [hashlib.sha256(file.read_bytes()).hexdigest() for file in files],
        "weights": getattr(recogniser, "sha256", None),
    }
    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()
