"""The conformance kit of motion data: units, axes, sides, rate and gaps, told from the bodies themselves.

A file that breaks one of these is a valid file, and only the accuracy suffers. Limits are wide: they hold for motion
capture, for trackers of depth cameras with their noise, and for children.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from shlex import quote
from typing import get_args

import numpy as np
from scipy.sparse.csgraph import shortest_path

from ehar.arrays import BoolArray, FloatArray
from ehar.data.any_source import load_recordings
from ehar.data.motion_data import MotionData
from ehar.data.motion_file import SCHEMA, load_motion
from ehar.data.preparing.axes import UNITS, Up, metres, up_rotation
from ehar.data.preparing.body_parts import body_parts
from ehar.data.recordings import Recordings
from ehar.data.skeleton import Skeleton
from ehar.data.streams.data import StreamData
from ehar.data.streams.file import load_streams
from ehar.errors import DataError, UsageError
from eval.conformance.checks import Conformance, ContractCheck

SHORTEST, LONGEST = 0.5, 4.0  # [m] the longest way along bones; a child of 5 has 1.4, a tall adult 2.7
PERSON = (0.9, 3.0)  # [m] the same, for naming the unit that files have
FEW = 0.05  # share of sequences, or of frames, that may be odd without a failure
NOISY, BROKEN = 0.3, 0.8  # how far bones spread, relative to their lengths; depth cameras have up to 0.4
SEEN, MIRRORED = 0.6, 0.3  # share of the ways of toes, noses or knees that point ahead
SLOWEST, FASTEST = 0.1, 15.0  # [m/s] of the fastest joint in the fastest tenth of frames; sets have 1.7 to 3.7
RATES = (4.0, 250.0)  # [1/s]
JUMP = 1.0  # [m] from a joint to the middle of where it is a frame before and a frame after; in sets up to 0.8
HARDEST = 100.0  # [m/s^2], which allows more than that below 8 frames a second
_FORMAT = "fits the format"
_ARRAYS = "optional arrays have their names"
_RIGHT_SIDE_UP = "head above feet: z is up"
_SIDES = "left is left: toes, nose and knees point the way that people face"


@dataclass(frozen=True)
class ReadWith:
    """How original files were read, for advice.

    Args:
        unit: unit of length: m, cm, mm, or a number of metres.
        up: axis that points up.
        mirror: whether x changed its sign.
        command: the command whose options mend the data.
    """

    unit: str | float = "m"
    up: Up = "z"
    mirror: bool = False
    command: str = "prepare it again with"

    def mend(self, options: str) -> str:
        """Return the command with more options."""
        return f"{self.command} {options}"


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


def check_bodies(data: Recordings, given: ReadWith) -> Conformance:
    """Check motion that fits the format.

    Args:
        data: the motion.
        given: how it was read.
    """
    bodies = _measured(data)
    checks = (
        ContractCheck(_FORMAT, True),
        _classes(data),
        _names(data.skeleton, given),
        _presence(data, given),
        _gaps(data),
        _size(data, bodies, given),
        _steadiness(data, bodies),
        _upright(data, given),
        _sides(data, given),
        _rate(data, given),
        _jumps(data),
    )
    return Conformance(f"data {data.title}", checks)


@dataclass(frozen=True, eq=False)
class _Bodies:
    """The measures of each body: each person of each sequence.

    Args:
        size: (sequences, P) the longest way along bones, of median lengths [m].
        spread: (sequences, P, bones) from the 5th to the 95th percentile of a bone's length [m].
        length: (sequences, P, bones) median lengths [m].
    """

    size: FloatArray
    spread: FloatArray
    length: FloatArray


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


def _measured(data: Recordings) -> _Bodies:
    """Measure bodies sequence by sequence, which also keeps memory low."""
    start, end = data.skeleton.bone_indices.T
    joints = len(data.skeleton.joint_names)
    sizes, spreads, lengths = [], [], []
    for index in range(len(data.lengths)):
        motion = data.sequence(index)
        bones = np.linalg.norm(motion[:, :, start] - motion[:, :, end], axis=-1)
        low, median, high = np.percentile(bones, [5, 50, 95], axis=0)
        graph = np.zeros((data.persons, joints, joints))
        graph[:, start, end] = np.maximum(median, 1e-9)  # 0 would be no bone
        ways = np.array([shortest_path(person, directed=False) for person in graph])
        sizes.append(np.where(np.isfinite(ways), ways, 0).max(axis=(1, 2)))
        spreads.append(high - low)
        lengths.append(median)
    return _Bodies(np.array(sizes), np.array(spreads), np.array(lengths))


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


def _size(data: Recordings, bodies: _Bodies, given: ReadWith) -> ContractCheck:
    name = "bones of human size"
    there = bodies.size > 1e-6
    if not there.any():
        return ContractCheck(name, None, "as nobody is there")
    typical = float(np.median(bodies.size[there]))
    outside = np.asarray((there & ((bodies.size < SHORTEST) | (bodies.size > LONGEST))).any(axis=1))
    others = int(outside.sum()) - 1
    told = f"{typical:.3g} m along the bones from end to end"
    if outside.mean() > 1 - FEW:
        raw = typical / metres(given.unit)
        fitting = [unit for unit, length in UNITS.items() if PERSON[0] <= raw * length <= PERSON[1]]
        mend = given.mend(f"--unit {fitting[0]}") if fitting else given.mend("--unit METRES, the unit in metres")
        named = f": lengths look like {_UNIT_NAMES[fitting[0]]}" if fitting else ""
        return ContractCheck(name, False, f"{told}{named}", f"{SHORTEST:g} to {LONGEST:g} m", mend)
    if outside.any():
        sequence = int(outside.argmax())
        got = f"{bodies.size[sequence].max():.3g} m in sequence {data.sequence_names[sequence]!r}"
        got += f", and {others} more sequences" if others else ""
        if outside.mean() > FEW:
            expected = f"{SHORTEST:g} to {LONGEST:g} m, as in {len(outside) - others - 1} sequences"
            return ContractCheck(name, False, got, expected, "prepare files of different units one by one")
        return ContractCheck(f"{name}: {told}", True, got, doubtful=True)
    return ContractCheck(f"{name}: {told}", True)


_UNIT_NAMES: Mapping[str, str] = {"m": "metres", "cm": "centimetres", "mm": "millimetres"}


def _steadiness(data: Recordings, bodies: _Bodies) -> ContractCheck:
    total = bodies.length.sum(axis=-1)
    spread = np.median((bodies.spread.sum(axis=-1) / np.maximum(total, 1e-9))[total > 1e-6]) if total.any() else 0.0
    relative = np.median(bodies.spread / np.maximum(bodies.length, 1e-9), axis=(0, 1))
    bone = data.skeleton.bones[int(relative.argmax())]
    worst = " to ".join(data.skeleton.joint_names[joint] for joint in bone)
    name = f"bones keep their lengths: they vary by {100 * spread:.0f} % within a sequence"
    got = f"most from {worst}, by {100 * relative.max():.0f} %"
    if spread > BROKEN:
        mend = "look at the order of axes and joints, and at `bones`: `ehar data describe --figure` draws them"
        return ContractCheck(
            "bones keep their lengths",
            False,
            f"they vary by {100 * spread:.0f} % within a sequence, {got}",
            f"at most {100 * BROKEN:.0f} %",
            mend,
        )
    return ContractCheck(name, True, f"noisy tracking, {got}" if spread > NOISY else "", doubtful=bool(spread > NOISY))


def _upright(data: Recordings, given: ReadWith) -> ContractCheck:
    parts = body_parts(data.skeleton.joint_names)
    high = _middle(data.positions, parts, (("head",), ("neck",), _both("shoulder")))
    low = _middle(data.positions, parts, (*(_both(part) for part in ("foot", "ankle", "knee", "hip")), ("pelvis",)))
    if high is None or low is None:
        return ContractCheck(_RIGHT_SIDE_UP, None, "no names of a head and of feet")
    mean = _unit_vectors(high - low).mean(axis=(0, 1))
    if mean[2] == np.abs(mean).max() and mean[2] > 0:
        return ContractCheck(_RIGHT_SIDE_UP, True)
    axis = int(np.abs(mean).argmax())
    of_camera = isinstance(data, MotionData) and data.views is not None
    in_file = up_rotation(given.up, of_camera=of_camera).T @ (np.eye(3)[axis] * np.sign(mean[axis]))
    found = ("-" if in_file.sum() < 0 else "") + "xyz"[int(np.abs(in_file).argmax())]
    option = f"--up {found}" if not found.startswith("-") else f"--up={found}"
    mend = given.mend(option) if found in get_args(Up) else "turn positions so that z points up"
    side = "below" if axis == 2 else "beside"
    return ContractCheck(_RIGHT_SIDE_UP, False, f"heads {side} feet: {found} of the file points up", "z", mend)


def _sides(data: Recordings, given: ReadWith) -> ContractCheck:
    """Check which way people face, as left and right tell it, against toes, or else noses, or else knees."""
    parts = body_parts(data.skeleton.joint_names)
    ahead = _ahead(data.positions, parts)
    if ahead is None:
        return ContractCheck(_SIDES, None, "no names of hips and shoulders")
    told = ((what, (ways * ahead[:, :, None]).sum(axis=-1)) for what, ways in _pointing(data.positions, parts))
    shown = next(((what, along) for what, along in told if np.abs(along).sum() > 1e-6), None)
    if shown is None:  # feet may be where ankles are
        return ContractCheck(_SIDES, None, "no feet, nose or knees that point somewhere")
    what, along = shown
    share = float(np.maximum(along, 0).sum() / np.abs(along).sum())
    if share >= SEEN:
        return ContractCheck(f"{_SIDES}: {what} do, {100 * share:.0f} %", True)
    if share > MIRRORED:
        return ContractCheck(_SIDES, True, f"cannot be told: {what} point ahead by {100 * share:.0f} %", doubtful=True)
    mend = "leave out --mirror" if given.mirror else given.mend("--mirror")
    got = f"{what} point backwards by {100 * (1 - share):.0f} %: bodies are mirrored, or left and right are exchanged"
    return ContractCheck(_SIDES, False, got, f"at least {100 * SEEN:.0f} % ahead", mend)


def _rate(data: Recordings, given: ReadWith) -> ContractCheck:
    name = "people move as fast as people do"
    speeds = []
    for index in range(len(data.lengths)):
        motion = data.sequence(index)
        if len(motion) > 1:
            steps = np.linalg.norm(np.diff(motion, axis=0), axis=-1).max(axis=(1, 2))
            speeds.append(float(np.percentile(steps, 90)) * data.fps)
    if not speeds:
        return ContractCheck(name, None, "no sequence has two frames")
    speed = float(np.median(speeds))
    told = f"the fastest joint moves at {speed:.2g} m/s at {data.fps:g} frames/s"
    if SLOWEST <= speed <= FASTEST and RATES[0] <= data.fps <= RATES[1]:
        return ContractCheck(f"{name}: {told}", True)
    expected = f"{SLOWEST:g} to {FASTEST:g} m/s, and {RATES[0]:g} to {RATES[1]:g} frames/s"
    return ContractCheck(name, False, told, expected, given.mend("--fps RATE, once the unit is right"))


def _jumps(data: Recordings) -> ContractCheck:
    """Check that no joint is elsewhere for a single frame, as where a tracker took something else for it."""
    limit = max(JUMP, HARDEST / data.fps**2 / 2)
    frames, farthest, told = 0, limit, ""
    for index in range(len(data.lengths)):
        motion = data.sequence(index)
        if len(motion) < 3:
            continue
        off = np.linalg.norm(motion[1:-1] - (motion[:-2] + motion[2:]) / 2, axis=-1)  # (T - 2, P, J)
        frames += int((off > limit).any(axis=(1, 2)).sum())
        if off.max() > farthest:
            farthest = float(off.max())
            frame, _, joint = np.unravel_index(int(off.argmax()), off.shape)
            sequence, name = data.sequence_names[index], data.skeleton.joint_names[int(joint)]
            told = f"{name} by {farthest:.2g} m in frame {int(frame) + 1} of sequence {sequence!r}"
    if not frames:
        return ContractCheck("no joint is elsewhere for a single frame", True)
    share = frames / len(data.positions)
    return ContractCheck(f"joints jump in {100 * share:.2g} % of frames", True, f"farthest {told}", doubtful=True)


def _ahead(positions: FloatArray, parts: Mapping[str, int]) -> FloatArray | None:
    """Return the unit vector ahead of each body (T, P, 3), left x up of the trunk; None without names for it."""
    pairs = [_both(part) for part in ("hip", "shoulder")]
    if not all(name in parts for pair in pairs for name in pair):
        return None
    to_left = sum(positions[:, :, parts[left]] - positions[:, :, parts[right]] for left, right in pairs)
    hips, shoulders = (_middle(positions, parts, (pair,)) for pair in pairs)
    assert hips is not None and shoulders is not None
    return _unit_vectors(np.cross(to_left, shoulders - hips))


def _pointing(positions: FloatArray, parts: Mapping[str, int]) -> Iterator[tuple[str, FloatArray]]:
    """Yield what points ahead of people, and its vectors (T, P, n, 3) [m]: all that names tell, the surest first."""

    def joint(part: str) -> FloatArray:
        place: FloatArray = positions[:, :, parts[part]].astype(np.float64)
        return place

    def named(*names: str) -> bool:
        return all(part in parts for name in names for part in _both(name))

    if named("foot", "ankle") and parts["left_foot"] != parts["left_ankle"]:
        toes = [joint(f"{side}_foot") - joint(f"{side}_ankle") for side in ("left", "right")]
        yield "toes", np.stack(toes, axis=2)
    if "nose" in parts and named("ear"):
        yield "noses", (joint("nose") - (joint("left_ear") + joint("right_ear")) / 2)[:, :, None]
    end = "ankle" if named("ankle") else "foot"
    if not named("knee", "hip", end):
        return
    knees = []
    for side in ("left", "right"):
        hip, knee, ankle = (joint(f"{side}_{part}") for part in ("hip", "knee", end))
        leg = ankle - hip
        along = ((knee - hip) * leg).sum(axis=-1, keepdims=True) / np.maximum(
            (leg**2).sum(axis=-1, keepdims=True), 1e-9
        )
        knees.append(knee - hip - along * leg)
    yield "knees", np.stack(knees, axis=2)


def _both(part: str) -> tuple[str, str]:
    return f"left_{part}", f"right_{part}"


def _middle(positions: FloatArray, parts: Mapping[str, int], choices: tuple[tuple[str, ...], ...]) -> FloatArray | None:
    """Return the mean of the first group of parts that all have names, (T, P, 3)."""
    for names in choices:
        if all(name in parts for name in names):
            middle: FloatArray = positions[:, :, [parts[name] for name in names]].astype(np.float64).mean(axis=2)
            return middle
    return None


def _unit_vectors(vectors: FloatArray) -> FloatArray:
    units: FloatArray = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)
    return units


def _sequence_at(data: Recordings, frame: int) -> str:
    return data.sequence_names[int(np.searchsorted(data.offsets, frame, side="right")) - 1]
