"""Pickles of data sets, read without executing them: they may hold numpy arrays and plain containers."""

import codecs
import pickle
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ehar.errors import DataError


def load_arrays(file: Path) -> Any:
    """Return what a pickle holds.

    Raises:
        DataError: the file is no whole pickle, or asks for anything but numpy arrays and plain containers.
    """
    try:
        with file.open("rb") as stream:
            return _ArrayUnpickler(stream, file).load()
    except DataError:
        raise
    except Exception as error:  # broken bytes can raise almost any error
        problem = " ".join(str(error).split()) or type(error).__name__
        raise DataError(f"{file}: not a readable pickle: {problem}") from error


def _latin1_bytes(text: str, encoding: str) -> bytes:
    """Stand for `codecs.encode`, with which protocol 2 writes the bytes of an array; it encodes and does no more."""
    if encoding != "latin1":
        raise ValueError(f"bytes in the encoding {encoding!r}, expected latin1")
    return codecs.latin_1_encode(text)[0]


_ADMITTED = {
    ("numpy", "ndarray"): np.ndarray,
    ("numpy", "dtype"): np.dtype,
    # numpy's constructors of arrays and of single numbers, under their names before and since 2.0
    **{(f"numpy.{core}.multiarray", "_reconstruct"): np.empty(0).__reduce__()[0] for core in ("core", "_core")},
    **{(f"numpy.{core}.multiarray", "scalar"): np.int64(0).__reduce__()[0] for core in ("core", "_core")},
    # protocol 5's constructor of arrays from bytes, which refuses objects
    **{(f"numpy.{core}.numeric", "_frombuffer"): np.empty(0).__reduce_ex__(5)[0] for core in ("core", "_core")},
    ("_codecs", "encode"): _latin1_bytes,
}


class _ArrayUnpickler(pickle.Unpickler):
    """Admits numpy arrays and plain containers; any other name raises an error before it is looked up."""

    def __init__(self, stream: BinaryIO, file: Path) -> None:
        super().__init__(stream)
        self._file = file

    def find_class(self, module: str, name: str) -> Any:
        admitted = _ADMITTED.get((module, name))
        if admitted is None:
            raise DataError(
                f"{self._file}: asks for {module}.{name}, which is not executed; expected numpy arrays only"
            )
        return admitted
