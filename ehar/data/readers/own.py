"""A user's own reader: a class in a file, which turns original files into motion data."""

from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ehar.data.file_fields import BOOL, INTEGER, NUMBER, Fields
from ehar.data.motion_data import MotionData
from ehar.data.preparing.axes import Up, upright
from ehar.data.skeleton import Skeleton
from ehar.errors import DataError, EharError
from ehar.plugins.loading import failure
from ehar.plugins.own_class import Contract, bring


class Reader(Protocol):
    """What a reader of your own has."""

    def read(self, source: Path) -> MotionData:
        """Return the motion of a file or a folder.

        Positions are in metres with z up, unless `--unit` and `--up` say otherwise.
        """
        ...


_ARRAYS: dict[str, tuple[str, tuple[str | int, ...]]] = {  # kinds of numbers, and shapes
    "positions": (NUMBER, ("frames", "persons", "joints", 3)),
    "offsets": (INTEGER, ("sequences + 1",)),
    "labels": (INTEGER, ("sequences",)),
    "subjects": (INTEGER, ("sequences", "persons")),
    "is_test": (BOOL, ("sequences",)),
    "views": (INTEGER, ("sequences",)),
    "recorded_ms": (INTEGER, ("sequences",)),
    "missing": (BOOL, ("frames",)),
}
_OPTIONAL = ("is_test", "views", "recorded_ms", "missing")
_TEXTS = ("class_names", "sequence_names", "notes")
CONTRACT = Contract("reader", Reader, ("read",), ())


def prepare_own(reader: str, source: str | Path, *, unit: str = "m", up: Up = "z") -> MotionData:
    """Read files with your own class.

    For example:
        ehar data prepare own ./mine.py:Rows recordings mine.npz

    Args:
        reader: your own: file.py:Class or module:Class, then --argument value.
        source: file or folder that it reads.
        unit: unit of length that it returns: m, cm, mm, or a number of metres.
        up: axis that points up in what it returns.

    Raises:
        UsageError: the class cannot be loaded or made, or has no `read`.
        DataError: it raised an error, or returned something else, or a field of it holds something else.
    """
    own = bring(reader, CONTRACT, {})
    try:
        data = own.made.read(Path(source))
    except EharError:
        raise
    except (Exception, SystemExit) as error:
        raise DataError(f"{own.what}: read raised {failure(error, type(own.made))}") from error
    if not isinstance(data, MotionData):
        raise DataError(f"{own.what}: read returned {type(data).__name__}, expected an ehar.MotionData")
    held = _checked(data, f"{own.what}: read returned")
    of_camera = held.views is not None
    return replace(held, positions=upright(held.positions, unit=unit, up=up, of_camera=of_camera))


def _checked(data: MotionData, where: str) -> MotionData:
    """Return the data with arrays of the kinds that a file has, from whatever the reader put numbers in.

    Raises:
        DataError: a field holds something else; `where` begins the error.
    """
    arrays = {}
    for name in _ARRAYS:
        value = getattr(data, name)
        if value is None and name in _OPTIONAL:
            continue
        try:
            arrays[name] = np.asarray(value)
        except (TypeError, ValueError, RuntimeError) as error:  # lists of unequal lengths, or a tensor with gradients
            raise DataError(f"{where}: {name}: expected an array: {failure(error, type(value))}") from error
    fields = Fields(where, arrays)
    for name in arrays:
        kinds, shape = _ARRAYS[name]
        fields.get(name, kinds, *shape)
    others = {
        "a Skeleton": {"skeleton": isinstance(data.skeleton, Skeleton)},
        "a number": {"fps": isinstance(data.fps, int | float | np.number)},
        "text": {name: isinstance(getattr(data, name), str) for name in ("name", "license")},
        "texts": {name: _are_texts(getattr(data, name)) for name in _TEXTS},
    }
    for expected, held in others.items():
        for name in (name for name, fits in held.items() if not fits):
            raise fields.error(name, f"got {getattr(data, name)!r:.80}, expected {expected}")
    checked: dict[str, Any] = {**arrays, **{name: tuple(getattr(data, name)) for name in _TEXTS}}
    return replace(data, **checked)


def _are_texts(value: object) -> bool:
    return isinstance(value, tuple | list) and all(isinstance(text, str) for text in value)
