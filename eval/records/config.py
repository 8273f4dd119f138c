"""A run's config.json, read back: which schema it has, and the configuration, checked field by field."""

from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from ehar.errors import DataError, UsageError
from eval.records.json_object import read_object
from eval.records.run_files import CONFIG, SCHEMA, RunConfig


def read_config(directory: Path) -> RunConfig:
    """Read the configuration of a run of `ehar benchmark`.

    A run from before schemas were numbered is taken as one of schema 1 where it has all of its fields: those that were
    added with the number have defaults, and mean what was meant without them.

    Raises:
        UsageError: the folder holds no such run, or one of another schema.
        DataError: config.json is not the JSON of an object, or a field is not of its type or too small.
    """
    path = directory / CONFIG
    held = read_object(path, "a run of ehar benchmark")
    missing, found = _missing(RunConfig, held), held.get("schema")
    if missing or found not in (None, SCHEMA):
        lacking = f" and no {', '.join(missing)}" if missing else ""
        raise UsageError(
            f"{path}: got {'no schema number' if found is None else f'schema {found!r}'}{lacking}, expected a run of "
            f"ehar benchmark of schema {SCHEMA}; run the benchmark again with this version"
        )
    config: RunConfig = _parsed(RunConfig, {**held, "schema": SCHEMA}, str(path))
    for name, least in (("starts", 1), ("seed", 0), ("length", 1)):
        if getattr(config, name) < least:
            raise DataError(f"{path}: {name}: expected at least {least}, got {getattr(config, name)}")
    return config


def _missing(kind: type, held: Mapping[str, Any]) -> list[str]:
    """Return the fields of a dataclass that have no default and are not there."""
    return [
        field.name
        for field in fields(kind)
        if field.name not in held and field.default is MISSING and field.default_factory is MISSING
    ]


def _parsed(kind: Any, value: Any, where: str) -> Any:
    """Return parsed JSON as the type that a field of a configuration has, or raise a DataError that says where."""
    if is_dataclass(kind) and isinstance(kind, type):
        if not isinstance(value, dict) or _missing(kind, value):
            raise DataError(f"{where}: expected an object with {', '.join(_names(kind))}, got {value!r}")
        hints = get_type_hints(kind)
        known = {name: _parsed(hints[name], value[name], f"{where}: {name}") for name in _names(kind) if name in value}
        return kind(**known)
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is UnionType:
        of = next(argument for argument in arguments if argument is not type(None))
        return None if value is None else _parsed(of, value, where)
    if origin is tuple and isinstance(value, list):
        return tuple(_parsed(arguments[0], item, f"{where}[{index}]") for index, item in enumerate(value))
    if origin is dict and isinstance(value, dict):
        return {key: _parsed(arguments[1], item, f"{where}: {key}") for key, item in value.items()}
    # JSON may write a whole number for a float; a bool is no number.
    accepted = {float: (int, float), Any: (object,)}.get(kind, (origin or kind,))
    if not isinstance(value, accepted) or (isinstance(value, bool) and kind not in (bool, Any)):
        raise DataError(f"{where}: expected {getattr(kind, '__name__', kind)}, got {value!r}")
    return value


def _names(kind: Any) -> list[str]:
    return [field.name for field in fields(kind)]
