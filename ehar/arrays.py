"""Array types. Axis letters: B batch, T frames, P persons, J joints, K classes, D embedding, F forks."""

from dataclasses import fields
from typing import Any, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.floating[Any]]
IntArray = npt.NDArray[np.integer[Any]]
BoolArray = npt.NDArray[np.bool_]
Scalar = TypeVar("Scalar", bound=np.generic)


class Trigonometry(Protocol):
    """The functions that a formula takes from numpy, CasADi or `math`; the argument is the module."""

    @property
    def sin(self) -> Any:
        """The sine of an angle [rad]."""

    @property
    def cos(self) -> Any:
        """The cosine of an angle [rad]."""

    @property
    def sqrt(self) -> Any:
        """The square root."""


def read_only(array: npt.NDArray[Scalar]) -> npt.NDArray[Scalar]:
    """Return a copy that nobody can write into.

    Its memory is that of a `bytes` object. So writing cannot be turned back on, and `.base` leads to nothing else.
    """
    return np.ndarray(array.shape, array.dtype, np.ascontiguousarray(array).tobytes())


def kind_of(value: Any) -> str:
    """Return what a value is, for errors: the type of an array's numbers, or the class of what is no array."""
    return f"an array of {value.dtype}" if isinstance(value, np.ndarray) else type(value).__name__


def in_brief(held: Any) -> str:
    """Return the `repr` of a data class that holds arrays: their types and shapes, and the lengths of long tuples."""
    shown = (f"{part.name}={_brief(getattr(held, part.name))}" for part in fields(held) if part.repr)
    return f"{type(held).__name__}({', '.join(shown)})"


def _brief(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"{value.dtype}{list(value.shape)}"
    text = repr(value)
    return f"<{len(value)}>" if isinstance(value, tuple | list | dict) and len(text) > 60 else text
