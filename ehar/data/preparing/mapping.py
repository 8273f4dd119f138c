"""Maps motion from one skeleton to another by what joints are, so that it fits what a pose estimator sees."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, get_args

import numpy as np

from ehar.data.motion_data import MotionData
from ehar.data.preparing.body_parts import body_parts
from ehar.data.preparing.layouts import LAYOUTS
from ehar.errors import DataError, UsageError

Target = Literal["coco17", "kinect20", "body12"]
_BETWEEN = {  # parts that lie between others, for skeletons that lack a joint there
    "pelvis": ("left_hip", "right_hip"),
    "neck": ("left_shoulder", "right_shoulder"),
    "spine": ("left_hip", "right_hip", "left_shoulder", "right_shoulder"),
}


def mapped(data: MotionData, target: Target) -> MotionData:
    """Return motion with the joints of another skeleton, in its order.

    A joint is the one that the data names as the same part of the body. The middle of hips and of shoulders, and the
    spine between them, are computed where no joint has their name. No other joint is invented.

    Raises:
        UsageError: the target is unknown.
        DataError: the data names no joint for one of the target's.
    """
    if target not in get_args(Target):
        raise UsageError(f"skeleton: got {target!r}, expected one of {', '.join(get_args(Target))}")
    layout = LAYOUTS[target]
    sources = joint_sources(data.skeleton.joint_names, layout.joint_names)
    lacking = [name for name, source in zip(layout.joint_names, sources, strict=True) if not source]
    if lacking:
        hint = "; body12 needs no face, hands or feet" if target != "body12" else ""
        raise DataError(f"{data.name}: got no joint for {', '.join(lacking)} of {target}{hint}")
    joints = [data.positions[:, :, source].mean(axis=2) for source in sources]
    told = ", ".join(
        f"{name} from {' and '.join(data.skeleton.joint_names[joint] for joint in source)}"
        for name, source in zip(layout.joint_names, sources, strict=True)
        if [name] != [data.skeleton.joint_names[joint] for joint in source]
    )
    return replace(
        data,
        positions=np.stack(joints, axis=2).astype(np.float32),
        skeleton=layout,
        notes=(*data.notes, *([f"{target}: {told}"] if told else [])),
    )


def joint_sources(held: Sequence[str], wanted: Sequence[str]) -> list[list[int]]:
    """Return the joints that each wanted joint is the middle of, by what joints are; none where there are none.

    Args:
        held: names of the joints that there are.
        wanted: names of the joints that are needed.
    """
    own, parts = body_parts(held), body_parts(wanted)
    part_of = {joint: part for part, joint in reversed(parts.items())}
    part_of |= {joint: name for joint, name in enumerate(wanted) if name in parts}
    found = []
    for joint in range(len(wanted)):
        part = part_of.get(joint, "")
        found.append([own[part]] if part in own else [own[near] for near in _BETWEEN.get(part, ()) if near in own])
    return found
