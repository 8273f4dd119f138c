"""Whether bodies stand upright, and left and right are where names say: told from what points up and ahead."""

from collections.abc import Iterator, Mapping
from typing import get_args

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.motion_data import MotionData
from ehar.data.preparing.axes import Up, up_rotation
from ehar.data.preparing.body_parts import body_parts
from ehar.data.recordings import Recordings
from eval.conformance.advice import ReadWith
from eval.conformance.checks import ContractCheck

SEEN, MIRRORED = 0.6, 0.3  # share of the ways of toes, noses or knees that point ahead
_RIGHT_SIDE_UP = "head above feet: z is up"
_SIDES = "left is left: toes, nose and knees point the way that people face"


def check_upright(data: Recordings, given: ReadWith) -> ContractCheck:
    """Check that heads are above feet: a file whose z does not point up turns people on their side."""
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


def check_sides(data: Recordings, given: ReadWith) -> ContractCheck:
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
