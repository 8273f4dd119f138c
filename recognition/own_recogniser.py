"""A user's own recognisers: loaded from a file or a module, and made for the data that they will see."""

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

HANDED = ("class_names", "skeleton", "persons", "fps")  # taken from the data, for a constructor with such arguments
PARTS = ("class_names", "embedding_size", "start", "step")


@dataclass(frozen=True, eq=False)
class OwnRecogniser:
    """A user's own recogniser.

    Args:
        recogniser: the object; it follows the contract `ehar.recogniser.Recogniser`.
        title: name of the class and arguments of its constructor, for tables.
        spec: the text that named it; for an object, its class.
        sha256: hash of the file of its class, of its arguments and of the files that they name. If the object has its
            own `sha256`, which should be the hash of its weights, this is included.
    """

    recogniser: Recogniser
    title: str
    spec: str
    sha256: str


def resolve_recogniser(brought: str | Recogniser, data: MotionData) -> OwnRecogniser:
    """Return a user's own recogniser that fits the data.

    A constructor with arguments called `class_names`, `skeleton`, `persons` or `fps` gets those of the data. Nothing is
    unpickled here: a constructor reads its own files.

    Args:
        brought: a recogniser, which is taken as it is; or `path/to/file.py:Class` or `package.module:Class`, with or
            without `(argument=value, ...)`.
        data: the data that it will be used on.

    Raises:
        UsageError: the recogniser cannot be loaded or made, or the object is not a recogniser.
        ModelError: the recogniser has other classes than the data.
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
        known = {name: getattr(data, name) for name in HANDED}
        handed = {name: known[name] for name in parameters_of(cls, what) if name in known}
        recogniser, given = construct(cls, spec, what, handed)
    else:
        recogniser, cls = brought, type(brought)
        named = f"{cls.__module__}.{cls.__qualname__}"
        what = f"recogniser {named}"
    _check_contract(recogniser, data, what)
    title = f"{cls.__name__}({arguments_text(given)})" if given else cls.__name__
    return OwnRecogniser(recogniser, title, named, _sha256(recogniser, given))


def _check_contract(recogniser: Any, data: MotionData, what: str) -> None:
    """Raise an error unless an object has all parts of the contract, and the data's classes."""
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
