"""The sources of recorded motion of either kind: trimmed sequences, or streams."""

from collections.abc import Callable
from pathlib import Path

from ehar.data.motion_data import MotionData
from ehar.data.source import BUILT_IN, check_source, load_data
from ehar.data.stitching.streams import stitch
from ehar.data.streams.data import StreamData
from ehar.data.streams.file import holds_streams, load_streams
from ehar.data.synthetic.sets import duo, solo

BUILT_IN_STREAMS: dict[str, Callable[[], StreamData]] = {
    "duo-stream": lambda: stitch(duo()),
    "solo-stream": lambda: stitch(solo()),
}


def is_stream_source(source: str | Path) -> bool:
    """Return whether a source is a built-in set of streams, or a stream file; what is not there is neither."""
    return str(source) in BUILT_IN_STREAMS or holds_streams(Path(source))


def load_recordings(source: str | Path, *, fps: float | None = None) -> MotionData | StreamData:
    """Return trimmed sequences or streams: a built-in set by its name, or the content of an .npz file.

    Args:
        source: `duo`, `solo`, `duo-stream`, `solo-stream`, or a path.
        fps: the frame rate to resample to [1/s]; None keeps the data's own.

    Raises:
        UsageError: `source` is the name of no built-in set, or `fps` is not above 0 or too high.
        DataError: the file is missing, or does not hold what the schema asks for.
    """
    if not is_stream_source(source):
        check_source(source, [*BUILT_IN, *BUILT_IN_STREAMS])
        return load_data(source, fps=fps)
    built_in = BUILT_IN_STREAMS.get(str(source))
    streams = load_streams(source) if built_in is None else built_in()
    return streams if fps is None else streams.resampled(fps)
