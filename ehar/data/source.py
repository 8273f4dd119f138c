"""The sources of motion data: a built-in name, or the path of a prepared .npz."""

from collections.abc import Callable, Collection
from pathlib import Path

from ehar.data.motion_data import MotionData
from ehar.data.motion_file import load_motion
from ehar.data.streams.file import holds_streams
from ehar.data.synthetic.sets import duo, solo
from ehar.errors import DataError, UsageError

BUILT_IN: dict[str, Callable[[], MotionData]] = {"duo": duo, "solo": solo}


def load_data(source: str | Path, *, fps: float | None = None) -> MotionData:
    """Return a built-in data set by its name, or the motion data of an .npz file.

    Args:
        source: `duo`, `solo`, or a path.
        fps: the frame rate to resample to [1/s]; None keeps the data's own.

    Raises:
        UsageError: `source` is the name of no built-in set of clips, or `fps` is not above 0 or too high.
        DataError: the file is missing, or does not hold what the schema asks for.
    """
    data = _load(source)
    return data if fps is None else data.resampled(fps)


def _load(source: str | Path) -> MotionData:
    built_in = BUILT_IN.get(str(source))
    if built_in is not None:
        return built_in()
    if str(source).removesuffix("-stream") in BUILT_IN:
        raise UsageError(f"{source}: expected trimmed sequences, got streams")
    path = Path(source)
    if holds_streams(path):
        raise DataError(f"{path}: expected trimmed sequences, got streams: `segments` in place of `labels`")
    check_source(path, BUILT_IN)
    return load_motion(path)


def check_source(source: str | Path, known: Collection[str]) -> None:
    """Refuse what is neither the name of a built-in set nor a file.

    Args:
        source: what was asked for.
        known: names of the built-in sets that would do.

    Raises:
        UsageError: it is no such name, and no path of an .npz file.
        DataError: it is such a path, but there is no file.
    """
    names, path = ", ".join(known), Path(source)
    if str(source) in known or path.is_file():
        return
    if path.suffix == ".npz":
        raise DataError(f"{path}: no such file; expected an .npz of motion data, or one of {names}")
    raise UsageError(f"unknown data {str(source)!r}; expected {names}, or the path of an .npz file")
