"""The conformance kit of motion data: units, axes, sides, rate and gaps, told from the bodies themselves.

A file that breaks one of these is a valid file, and only the accuracy suffers. Limits are wide: they hold for motion
capture, for trackers of depth cameras with their noise, and for children.
"""

from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from shlex import quote

import numpy as np

from ehar.arrays import BoolArray
from ehar.data.any_source import load_recordings
from ehar.data.motion_data import MotionData
from ehar.data.motion_file import SCHEMA, load_motion
from ehar.data.recordings import Recordings
from ehar.data.skeleton import Skeleton
from ehar.data.streams.data import StreamData
from ehar.data.streams.file import load_streams
from ehar.errors import DataError, UsageError
from eval.conformance.advice import ReadWith
from eval.conformance.body_axes import check_sides, check_upright
from eval.conformance.body_pace import check_jumps, check_rate
from eval.conformance.body_shape import check_size, check_steadiness, measured
from eval.conformance.checks import FEW, Conformance, ContractCheck

_FORMAT = "fits the format"
_ARRAYS = "optional arrays have their names"


def check_data(data: str | Path | MotionData | StreamData) -> Conformance:
    """Check that motion is in metres with z up, that left is left, and that people are there.

    Args:
        data: a built-in set, a prepared .npz of sequences or of streams, or motion itself.

    Raises:
        UsageError: there is no such file.
    """
    if not isinstance(data, str | Path):
        return check_bodies(data, ReadWith())
    if Path(data).suffix == ".npz" and not Path(data).is_file():
        raise UsageError(f"{data}: no such file; expected a built-in set, or a prepared .npz")
    command = f"ehar data prepare npz {quote(str(data))} mended.npz"
    try:
        held = _loaded(data)
        if isinstance(held, StreamData):
            command = f"write {data} again, as ehar data prepare reads sequences with"
        found = check_bodies(held, ReadWith(command=command))
        return replace(found, checks=(_arrays(Path(data)), *found.checks))
    except DataError as error:
        failed = ContractCheck(
            _FORMAT, False, str(error), "arrays as docs/data.md lists them", _mend_file(error, command)
        )
        return Conformance(f"data {data}", (failed, ContractCheck("all else", None, "as it cannot be read")))


def check_bodies(data: Recordings, given: ReadWith) -> Conformance:
    """Check motion that fits the format.

    Args:
        data: the motion.
        given: how it was read.
    """
    bodies = measured(data)
    checks = (
        ContractCheck(_FORMAT, True),
        _classes(data),
        _names(data.skeleton, given),
        _presence(data, given),
        _gaps(data),
        check_size(data, bodies, given),
        check_steadiness(data, bodies),
        check_upright(data, given),
        check_sides(data, given),
        check_rate(data, given),
        check_jumps(data),
    )
    return Conformance(f"data {data.title}", checks)


def _arrays(path: Path) -> ContractCheck:
    """Return whether a file has no array whose name is nearly that of one that it lacks: it would be ignored."""
    if not path.is_file():
        return ContractCheck(_ARRAYS, True)  # a built-in set
    with np.load(path, allow_pickle=False) as archive:
        names = set(archive.files)
    known = SCHEMA | {"segments"}
    meant = {name: get_close_matches(name, known - names, n=1) for name in sorted(names - known)}
    misspelt = {name: found[0] for name, found in meant.items() if found}
    if not misspelt:
        return ContractCheck(_ARRAYS, True)
    mend = "rename what was misspelt: under such a name it is not read"
    return ContractCheck(_ARRAYS, False, ", ".join(misspelt), ", ".join(misspelt.values()), mend)


def _mend_file(error: DataError, command: str) -> str:
    """Return how to mend a file that cannot be read; only NaN can be mended by a command."""
    return f"{command} fills them" if "got NaN" in str(error) else "write the file again"


def _loaded(source: str | Path) -> Recordings:
    path = Path(source)
    if not path.is_file():
        return load_recordings(source)  # a built-in set; this raises the error where there is no file
    try:
        with np.load(path, allow_pickle=False) as archive:
            streams = "segments" in archive.files
    except Exception:  # load_motion tells what is wrong
        streams = False
    return load_streams(path) if streams else load_motion(path)


def _classes(data: Recordings) -> ContractCheck:
    """Check that there is something to tell apart; in streams a single activity is told from none."""
    count = len(data.class_names)
    if count > 1 or isinstance(data, StreamData):
        return ContractCheck(f"there is something to tell apart: {count} class{'es' * (count != 1)}", True)
    return ContractCheck(
        f"all show {data.class_names[0]}: no recogniser can learn from them alone", True, doubtful=True
    )


def _names(skeleton: Skeleton, given: ReadWith) -> ContractCheck:
    name = "joints have names that tell left from right"
    pairs = int((skeleton.mirror != np.arange(len(skeleton.mirror))).sum()) // 2
    if pairs:
        return ContractCheck(f"{name}: {pairs} pairs", True)
    shown = ", ".join(skeleton.joint_names[:3])
    return ContractCheck(
        name,
        False,
        f"{shown}{', ...' * (len(skeleton.joint_names) > 3)}",
        "names as left_hip and right_hip, lhip and rhip, or Hip_L and Hip_R",
        given.mend("--joints LAYOUT, if they have the order of coco17, kinect20, ntu25 or smpl22"),
    )


def _presence(data: Recordings, given: ReadWith) -> ContractCheck:
    """Check that every person has a body in every frame, and that no two are the same."""
    name = "everybody is there in every frame"
    absent = np.ptp(data.positions, axis=2).max(axis=-1) == 0  # (frames, P)
    twins = np.zeros_like(absent)
    for person in range(1, data.persons):
        twins[:, person] = (data.positions[:, person] == data.positions[:, 0]).all(axis=(1, 2))
    for odd, what in ((absent, "all joints at one point"), (twins & ~absent, "the same joints as person 1")):
        if odd.any():
            frame, person = (int(index) for index in np.argwhere(odd)[0])
            where = f"in sequence {_sequence_at(data, frame)!r}"
            return ContractCheck(
                name,
                False,
                f"person {person + 1} with {what} in {int(odd[:, person].sum())} of {len(odd)} frames, first {where}",
                "a body; or NaN, and `missing` true, in frames in which the tracker lost it",
                given.mend("--persons 1 for one person; keep sequences of fewer people in a file of their own"),
            )
    return ContractCheck(name, True)


def _gaps(data: Recordings) -> ContractCheck:
    missing: BoolArray | None = data.missing if isinstance(data, MotionData | StreamData) else None
    if missing is None or not missing.any():
        return ContractCheck("no frame is interpolated", True)
    share = float(missing.mean())
    name = f"{100 * share:.1f} % of frames are interpolated, where the tracker lost something"
    return ContractCheck(name, True, doubtful=share > FEW)


def _sequence_at(data: Recordings, frame: int) -> str:
    return data.sequence_names[int(np.searchsorted(data.offsets, frame, side="right")) - 1]
