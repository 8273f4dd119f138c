"""A recogniser, a sensor or a motion that somebody brought: as an object, or named by its file or module."""

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

HANDED = ("class_names", "skeleton", "persons", "fps")  # of the data, to a constructor that has such arguments


@dataclass(frozen=True)
class Contract:
    """What an object has to have.

    Args:
        word: what it is called: "sensor".
        protocol: the contract's class, whose own bodies do nothing.
        methods: that it has to have.
        attributes: that it has to have beside them.
    """

    word: str
    protocol: type[Any]
    methods: tuple[str, ...]
    attributes: tuple[str, ...]

    def lacking(self, cls: type[Any]) -> list[str]:
        """Return the methods that a class lacks, or only inherits from the contract."""
        return [
            name
            for name in self.methods
            if not callable(getattr(cls, name, None)) or getattr(cls, name) is getattr(self.protocol, name)
        ]

    def broken(self, lacking: list[str]) -> str:
        """Return what is wrong with an object that lacks something."""
        protocol = f"{self.protocol.__module__}.{self.protocol.__name__}"
        return f"expected what {protocol} has, missing: {', '.join(lacking)}"

    def check(self, made: Any, what: str) -> None:
        """Raise a UsageError unless an object has everything; no property of it is computed for that."""
        if isinstance(made, type):
            raise UsageError(f"{what}: expected a {self.word}, got a class; make one: {made.__name__}(...)")
        absent = [name for name in self.lacking(type(made)) if name not in getattr(made, "__dict__", {})]
        lacking = [name for name in self.attributes if not _has(made, name)] + absent
        if lacking:
            raise UsageError(f"{what}: {self.broken(lacking)}")


@dataclass(frozen=True, eq=False)
class Own:
    """What somebody brought.

    Args:
        made: the object.
        what: errors call it.
        title: the class's name and what its constructor was given, for tables.
        spec: how it was named; of an object, its class.
        sha256: of the file of its class, its arguments, the files that they name and, where it has one, its own
            `sha256`, which should be that of its weights.
        make: returns another that is as new; of an object, a copy.
    """

    made: Any
    what: str
    title: str
    spec: str
    sha256: str
    make: Callable[[], Any]


def bring(brought: Any, contract: Contract, offered: Mapping[str, Any]) -> Own:
    """Return what somebody brought, checked against its contract.

    Nothing is unpickled here: what a constructor reads, it reads itself.

    Args:
        brought: an object, which is meant as it is, or `path/to/file.py:Class` or `package.module:Class`, with or
            without `(argument=value, ...)`.
        contract: that it has to keep.
        offered: to a constructor that has arguments of these names.

    Raises:
        UsageError: it cannot be loaded or made, or lacks something.
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
    """Return whether an object has something: a property counts that would raise before the object has begun."""
    try:
        getattr_static(made, name)
    except AttributeError:
        return hasattr(made, name)
    return True


def _copy(brought: Any, what: str) -> Any:
    try:
        return deepcopy(brought)
    except Exception as error:
        raise UsageError(
            f"{what}: expected an object that can be copied: {failure(error, type(brought))}; {FORMS} is made anew"
        ) from error


def _construct(cls: type[Any], arguments: Mapping[str, Any], what: str) -> Any:
    try:
        return cls(**arguments)
    except Exception as error:
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
