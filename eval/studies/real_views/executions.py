"""The executions that several cameras recorded at once, and how these cameras stand."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from ehar.data.copies import is_copy
from ehar.data.motion_data import MotionData
from ehar.errors import DataError
from eval.studies.real_views.alignment import Pose, consensus, find_pose

Poses = dict[tuple[str, int, int], Pose]  # the way from a camera to another one, by (execution, camera, other camera)

_VIEW = re.compile(r"_v\d+$")  # names of one execution differ in this alone


@dataclass(frozen=True, eq=False)
class Execution:
    """One performance of an activity, as several cameras recorded it.

    Args:
        name: its name, without the camera.
        label: its class.
        person: who performs.
        sequences: the sequence of each camera.
    """

    name: str
    label: int
    person: int
    sequences: dict[int, int]


def find_executions(data: MotionData) -> list[Execution]:
    """Return the executions that at least two cameras recorded; copies of another camera's recording are left out.

    Raises:
        DataError: the data are not of one person, in the frames of cameras; or there is no such execution.
    """
    if data.views is None or data.persons != 1:
        raise DataError(f"{data.name}: expected recordings of one person with `views`, the camera of each sequence")
    found: dict[str, dict[int, int]] = {}
    for sequence, name in enumerate(data.sequence_names):
        cameras = found.setdefault(_VIEW.sub("", name), {})
        if not any(is_copy(data.sequence(sequence), data.sequence(other)) for other in cameras.values()):
            cameras[int(data.views[sequence])] = sequence
    executions = []
    for name, cameras in found.items():
        if len(cameras) > 1:
            first = next(iter(cameras.values()))
            executions.append(Execution(name, int(data.labels[first]), int(data.subjects[first, 0]), cameras))
    if not executions:
        raise DataError(f"{data.name}: expected sequences with names that differ in `_v1`, `_v2` alone, found none")
    return executions


def find_poses(data: MotionData, executions: Sequence[Execution]) -> Poses:
    """Return how cameras stand, as each execution tells it by itself."""
    return {
        (execution.name, one, other): find_pose(data.sequence(first)[:, 0], data.sequence(second)[:, 0])
        for execution in executions
        for one, first in execution.sequences.items()
        for other, second in execution.sequences.items()
        if one != other
    }


def agreed(poses: Poses, executions: Sequence[Execution]) -> Poses:
    """Return how cameras stand, if all executions of a person decide together.

    Cameras do not move while one person performs.
    """
    people = {execution.name: execution.person for execution in executions}
    of_pair: dict[tuple[int, int, int], list[Pose]] = {}
    for (name, one, other), pose in poses.items():
        of_pair.setdefault((people[name], one, other), []).append(pose)
    decided = {pair: consensus(found) for pair, found in of_pair.items()}
    return {(name, one, other): decided[people[name], one, other] for name, one, other in poses}
