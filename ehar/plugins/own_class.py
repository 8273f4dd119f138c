"""A user's own recogniser, sensor or motion: an object, or a class named by its file or module."""

import hashlib
import json
from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import dataclass
from functools import partial
from inspect import getattr_static
from pathlib import Path
from typing import Any

from ehar.errors import UsageError
from ehar.plugins.class_spec import FORMS, arguments_text, json_arguments, parse_spec
from ehar.plugins.constructor import construct, parameters_of
from ehar.plugins.loading import failure, load_class, source_sha256

HANDED = (
    "class_names",
    "skeleton",
    "persons",
    "fps",
)  # values of the data; a constructor with such arguments is handed them


@dataclass(frozen=True)
class Contract:
    """The parts that an object has to have.

    Args:
        word: the word for such an object: "sensor".
        protocol: the protocol class of the contract; its methods do nothing.
        methods: names of the methods.
        attributes: names of the attributes.
    """

    word: str
    protocol: type[Any]
    methods: tuple[str, ...]
    attributes: tuple[str, ...]

    def lacking(self, cls: type[Any]) -> list[str]:
        """Return the methods that a class lacks, or only inherits from the protocol."""
        return [
            name
            for name in self.methods
            if not callable(getattr(cls, name, None)) or getattr(cls, name) is getattr(self.protocol, name)
        ]

    def broken(self, lacking: list[str]) -> str:
        """Return the error text for an object that lacks some parts."""
        protocol = f"{self.protocol.__module__}.{self.protocol.__name__}"
        return f"expected what {protocol} has, missing: {', '.join(lacking)}"

    def check(self, made: Any, what: str) -> None:
        """Raise a UsageError unless an object has all parts; its properties are not computed."""
        if isinstance(made, type):
            raise UsageError(f"{what}: expected a {self.word}, got a class; make one: {made.__name__}(...)")
        absent = [name for name in self.lacking(type(made)) if name not in getattr(made, "__dict__", {})]
        lacking = [name for name in self.attributes if not _has(made, name)] + absent
        if lacking:
            raise UsageError(f"{what}: {self.broken(lacking)}")


@dataclass(frozen=True, eq=False)
class Own:
    """A user's own object.

    Args:
        made: the object.
        what: its name in errors.
        title: its name in tables: the class and the given arguments.
        spec: the text that named it; for an object, its class.
        sha256: hash of the file of its class, of its arguments, of the files that they name, and of its attribute
            `sha256` if it has one; this should be the hash of its weights.
        make: returns a new object like it; for an object, a copy.
    """

    made: Any
    what: str
    title: str
    spec: str
    sha256: str
    make: Callable[[], Any]


def bring(brought: Any, contract: Contract, offered: Mapping[str, Any]) -> Own:
    """Return a user's own object, checked against its contract.

    Nothing is unpickled here: a constructor reads its files itself.

    Args:
        brought: an object, or `path/to/file.py:Class` or `package.module:Class`, with or without
            `(argument=value, ...)`.
        contract: the contract that the object has to keep.
        offered: values by name; a constructor with arguments of these names is handed them.

    Raises:
        UsageError: the object cannot be loaded or made, or lacks a part.
    """
    if not isinstance(brought, str):
        named = f"{type(brought).__module__}.{type(brought).__qualname__}"
        what = f"{contract.word} {named}"
        contract.check(brought, what)
        return Own(brought, what, type(brought).__name__, named, _sha256(brought, {}), partial(_copy, brought, what))
    spec = parse_spec(brought)
    if spec is None or not spec.place:
        raise UsageError(f"unknown {contract.word} {brought!r}; expected {FORMS}")
    what = f"{contract.word} {spec.title}"
    cls = load_class(spec, contract.word)
    lacking = contract.lacking(cls)
    if lacking:
        raise UsageError(f"{what}: {contract.broken(lacking)}")
    handed = {name: offered[name] for name in parameters_of(cls, what) if name in offered}
    made, given = construct(cls, spec, what, handed)
    contract.check(made, what)
    title = f"{cls.__name__}({arguments_text(given)})" if given else cls.__name__
    make = partial(_construct, cls, {**handed, **given}, what)
    return Own(made, what, title, brought, _sha256(made, given), make)


def _has(made: Any, name: str) -> bool:
    """Return whether an object has an attribute; a property counts even if it would raise before the first `reset`."""
    try:
        getattr_static(made, name)
    except AttributeError:
        return hasattr(made, name)
    return True


def _copy(brought: Any, what: str) -> Any:
    try:
        return deepcopy(brought)
    except (Exception, SystemExit) as error:
        raise UsageError(
            f"{what}: expected an object that can be copied: {failure(error, type(brought))}; {FORMS} is made anew"
        ) from error


def _construct(cls: type[Any], arguments: Mapping[str, Any], what: str) -> Any:
    try:
        return cls(**arguments)
    except (Exception, SystemExit) as error:
        raise UsageError(f"{what}: its constructor raised {failure(error, cls)}") from error


def _sha256(made: Any, given: Mapping[str, Any]) -> str:
    files = [value for value in given.values() if isinstance(value, Path) and value.is_file()]
    parts = {
        "source": source_sha256(type(made)),
        "arguments": json_arguments(given),
        "files": [hashlib.sha256(file.read_bytes()).hexdigest() for file in files],
        "weights": getattr(made, "sha256", None),
    }
    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()
