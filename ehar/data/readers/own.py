"""A user's own reader: a class in a file, which turns original files into motion data."""

from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np

from ehar.data.motion_data import MotionData
from ehar.data.preparing.axes import Up, upright
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
        DataError: it raised an error, or returned something else.
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
    shape = np.shape(data.positions)
    if len(shape) != 4 or shape[3] != 3:
        raise DataError(f"{own.what}: read returned positions {shape}, expected (frames, persons, joints, 3)")
    of_camera = data.views is not None
    return replace(data, positions=upright(data.positions, unit=unit, up=up, of_camera=of_camera))
