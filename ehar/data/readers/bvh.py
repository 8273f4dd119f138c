"""BVH: motion capture as a hierarchy of joints and their channels, turned into joint positions.

All files of a folder, and of the folders in it, share one skeleton and one frame time. End sites have no name and no
motion of their own: they are left out. A root whose only child is not at a constant distance is a frame of reference
and not part of the body: it is left out too.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from ehar.arrays import FloatArray
from ehar.data.motion_data import MotionData
from ehar.data.preparing.axes import Up, metres, up_rotation, upright
from ehar.data.readers.names import compiled, label_of, visible_files
from ehar.data.recordings import MOST_RATE, UNKNOWN_SUBJECT
from ehar.data.skeleton import Skeleton
from ehar.errors import DataError, UsageError

CHANNELS = {f"{axis}{kind}" for axis in "XYZ" for kind in ("position", "rotation")}
RIGID = 1e-3  # [m]; the length of a bone changes by at most this


def prepare_bvh(
    source: str | Path,
    *,
    pattern: str = "{label}_{style}_{number}.bvh",
    label_from: Literal["name", "folder"] = "name",
    unit: str | float = "cm",
    up: Up = "y",
) -> MotionData:
    """Read a folder of BVH files.

    For example:
        ehar data prepare bvh recordings mine.npz --pattern '{label}_{number}.bvh'
        ehar data prepare bvh recordings mine.npz --label-from folder --unit m

    Args:
        source: folder of the files.
        pattern: pattern of the file names: {label} is the class, other words in braces match anything.
        label_from: source of the class: the name of the file, or of its folder.
        unit: unit of length in the files: m, cm, mm, or a number of metres.
        up: axis that points up in the files.

    Raises:
        UsageError: an option has a wrong value.
        DataError: a file is malformed, differs in skeleton or frame time, or its name does not fit the pattern.
    """
    source = Path(source)
    regex = compiled(pattern)
    if label_from not in ("name", "folder"):
        raise UsageError(f"label_from: got {label_from!r}, expected name or folder")
    metres(unit), up_rotation(up)  # a wrong option is told before anything is read
    files = visible_files(source, ".bvh")
    if not files:
        raise DataError(f"{source}: got no .bvh files, expected a folder that holds some")
    words = [file.parent.name if label_from == "folder" else label_of(file, regex, pattern) for file in files]
    clips = [read_bvh(file) for file in files]
    for file, clip in zip(files, clips, strict=True):
        _check_alike(files[0], clips[0], file, clip)
    positions = upright(np.concatenate([clip.positions for clip in clips]), unit=unit, up=up)
    first = _first_of_body(clips[0].parents, positions)
    class_names = sorted(set(words))
    return MotionData(
        name=source.name,
        positions=positions[:, None, first:],
        offsets=np.cumsum([0, *(len(clip.positions) for clip in clips)]),
        labels=np.array([class_names.index(word) for word in words]),
        class_names=tuple(class_names),
        sequence_names=tuple(file.relative_to(source).with_suffix("").as_posix() for file in files),
        fps=clips[0].fps,
        skeleton=Skeleton(
            joint_names=clips[0].joint_names[first:],
            bones=tuple((parent - first, joint) for joint, parent in enumerate(clips[0].parents[first:]) if joint),
        ),
        is_test=None,
        subjects=np.full((len(files), 1), UNKNOWN_SUBJECT),
        license="unknown: that of the BVH files",
    )


@dataclass(frozen=True, eq=False)
class BvhFile:
    """One BVH file.

    Args:
        joint_names: J names, parents before their children.
        parents: J indices, -1 for the root.
        positions: (T, J, 3) in the file's units and axes.
        fps: frames per second.
    """

    joint_names: tuple[str, ...]
    parents: tuple[int, ...]
    positions: FloatArray
    fps: float


@dataclass
class _Joint:
    name: str
    parent: int
    offset: tuple[float, ...] = (0.0, 0.0, 0.0)
    channels: tuple[str, ...] = ()


def read_bvh(file: Path) -> BvhFile:
    """Return the joint positions of one file by forward kinematics.

    Raises:
        DataError: the file is not a BVH file, or does not hold the frames that it announces.
    """
    lines = file.read_text(encoding="utf-8-sig", errors="replace").rstrip().splitlines()
    motion_line = next((i for i, line in enumerate(lines) if line.strip().upper() == "MOTION"), None)
    if not lines or lines[0].strip().upper() != "HIERARCHY" or motion_line is None:
        raise DataError(f"{file}: not a BVH file; expected a HIERARCHY and a MOTION section")
    joints = _parse_hierarchy(file, lines[1:motion_line])
    frames = _parse_number(file, lines, motion_line + 1, "Frames:")
    frame_time = _parse_number(file, lines, motion_line + 2, "Frame Time:")
    values = _parse_frames(file, lines, motion_line + 3, sum(len(joint.channels) for joint in joints))
    if len(values) != frames:
        raise DataError(f"{file}: got {len(values)} frames, expected the {frames:g} that it announces")
    if not frame_time >= 1 / MOST_RATE:
        expected = f"expected seconds, at least {1 / MOST_RATE:g}"
        raise DataError(f"{file}: line {motion_line + 3}: got frame time {frame_time:g}, {expected}")
    return BvhFile(
        joint_names=tuple(joint.name for joint in joints),
        parents=tuple(joint.parent for joint in joints),
        positions=_forward_kinematics(joints, values),
        fps=_rate(frame_time),
    )


def _rate(frame_time: float) -> float:
    """Return frames per second; frame times are written with few digits, so 0.0333333 is meant as 1/30."""
    rate = 1.0 / frame_time
    whole = round(rate)
    return float(whole) if abs(rate - whole) < 5e-4 * rate else rate


def _forward_kinematics(joints: list[_Joint], values: FloatArray) -> FloatArray:
    """Return positions (T, J, 3) from channel values (T, C).

    A joint's rotations apply in the order of its channels, each about the axis as turned by the ones before it, so
    `Zrotation Xrotation Yrotation` is R_z R_x R_y on column vectors. A position channel replaces its component of the
    joint's offset.
    """
    rotations: list[Rotation] = []
    positions = np.empty((len(values), len(joints), 3))
    column = 0
    for index, joint in enumerate(joints):
        own = values[:, column : column + len(joint.channels)]
        column += len(joint.channels)
        local = np.tile(joint.offset, (len(values), 1))
        turns = [i for i, channel in enumerate(joint.channels) if channel.endswith("rotation")]
        for i, channel in enumerate(joint.channels):
            if channel.endswith("position"):
                local[:, "XYZ".index(channel[0])] = own[:, i]
        rotation = Rotation.identity(len(values))
        if turns:
            rotation = Rotation.from_euler("".join(joint.channels[i][0] for i in turns), own[:, turns], degrees=True)
        if joint.parent < 0:
            positions[:, index] = local
            rotations.append(rotation)
        else:
            positions[:, index] = positions[:, joint.parent] + rotations[joint.parent].apply(local)
            rotations.append(rotations[joint.parent] * rotation)
    return positions


def _parse_hierarchy(file: Path, lines: list[str]) -> list[_Joint]:
    """Return the joints, parents first, from the lines that follow HIERARCHY; end sites are skipped."""
    tokens = ((number, word) for number, line in enumerate(lines, start=2) for word in line.split())
    joints: list[_Joint] = []
    open_blocks: list[int | None] = []  # the joint of each open brace, None for an end site
    coming: int | None = None
    for number, word in tokens:
        inside = open_blocks[-1] if open_blocks else None
        if word in ("ROOT", "JOINT"):
            if (word == "ROOT") != (not joints) or (word == "JOINT" and inside is None):
                raise DataError(f"{file}: line {number}: got {word} here, expected one ROOT and JOINTs inside it")
            joints.append(_Joint(_next(file, tokens, "a name"), parent=-1 if inside is None else inside))
            coming = len(joints) - 1
        elif word == "End":
            _next(file, tokens, "Site")
            coming = None
        elif word == "{":
            open_blocks.append(coming)
        elif word == "}" and open_blocks:
            open_blocks.pop()
        elif word == "OFFSET" and open_blocks:
            offset = tuple(_float(file, number, _next(file, tokens, "3 numbers")) for _ in range(3))
            if inside is not None:
                joints[inside].offset = offset
        elif word == "CHANNELS" and inside is not None:
            count = int(_float(file, number, _next(file, tokens, "a number of channels")))
            joints[inside].channels = tuple(_next(file, tokens, f"{count} channels") for _ in range(count))
            _check_channels(file, number, joints[inside])
        else:
            raise DataError(
                f"{file}: line {number}: got {word!r}, expected a joint, OFFSET, CHANNELS, End Site or brace"
            )
    if open_blocks or not joints:
        raise DataError(f"{file}: HIERARCHY: got {len(open_blocks)} open braces and {len(joints)} joints at its end")
    names = [joint.name for joint in joints]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise DataError(f"{file}: HIERARCHY: joint {twice[0]!r} appears twice, every name must differ")
    return joints


def _check_channels(file: Path, number: int, joint: _Joint) -> None:
    if not set(joint.channels) <= CHANNELS or len(set(joint.channels)) < len(joint.channels):
        got = f"got channels {' '.join(joint.channels)} of {joint.name!r}"
        raise DataError(f"{file}: line {number}: {got}, expected each of {', '.join(sorted(CHANNELS))} at most once")


def _next(file: Path, tokens: Iterator[tuple[int, str]], expected: str) -> str:
    _, word = next(tokens, (0, None))
    if word is None:
        raise DataError(f"{file}: HIERARCHY: ends where {expected} was expected")
    return word


def _float(file: Path, number: int, word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise DataError(f"{file}: line {number}: got {word!r}, expected a finite number")
    return value


def _parse_number(file: Path, lines: list[str], index: int, key: str) -> float:
    line = " ".join(lines[index].split()) if index < len(lines) else ""
    if not line.startswith(key):
        raise DataError(f"{file}: line {index + 1}: got {line[:40]!r}, expected {key!r} and a number")
    return _float(file, index + 1, line.removeprefix(key).strip())


def _parse_frames(file: Path, lines: list[str], first: int, channels: int) -> FloatArray:
    rows = []
    for number, line in enumerate(lines[first:], start=first + 1):
        words = line.split()
        if len(words) != channels:
            raise DataError(f"{file}: line {number}: got {len(words)} numbers, expected {channels}, one a channel")
        rows.append([_float(file, number, word) for word in words])
    return np.array(rows).reshape(len(rows), channels)


def _check_alike(first_file: Path, first: BvhFile, file: Path, clip: BvhFile) -> None:
    if not len(clip.positions):
        raise DataError(f"{file}: got no frames, expected at least 1")
    if clip.joint_names != first.joint_names or clip.parents != first.parents:
        raise DataError(f"{file}: got another skeleton than {first_file}, expected one for all files")
    if not math.isclose(clip.fps, first.fps, rel_tol=1e-3):
        raise DataError(f"{file}: got {clip.fps:g} frames a second, expected {first.fps:g} as in {first_file}")


def _first_of_body(parents: tuple[int, ...], positions: FloatArray) -> int:
    """Return the first joint that is part of the body; the ones before it are frames of reference."""
    first = 0
    while parents.count(first) == 1:
        length = np.linalg.norm(positions[:, first] - positions[:, first + 1], axis=-1)
        if np.ptp(length) <= RIGID:
            break
        first += 1
    return first
