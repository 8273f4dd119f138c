"""Parts of the body by joint names, and skeletons mapped by them."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.data.motion_data import MotionData
from ehar.data.preparing.body_parts import body_parts
from ehar.data.preparing.layouts import COCO17, KINECT20, LAYOUTS
from ehar.data.preparing.mapping import mapped
from ehar.data.skeleton import Skeleton
from ehar.errors import DataError
from tests.helpers.fakes import tiny_data

HDM05 = ("root", "lhipjoint", "lfemur", "ltibia", "lfoot", "ltoes", "lclavicle", "lhumerus", "lradius", "lhand", "head")
BANDAI = ("Hips", "UpperLeg_L", "LowerLeg_L", "Foot_L", "Shoulder_L", "UpperArm_L", "LowerArm_L", "Hand_L", "Head")
MIXAMO = ("mixamorig:Hips", "mixamorig:LeftUpLeg", "mixamorig:LeftLeg", "mixamorig:LeftFoot", "mixamorig:LeftArm")


def both_sides(names: tuple[str, ...]) -> tuple[str, ...]:
    swaps = [("left", "right"), ("Left", "Right"), ("_L", "_R"), ("L_", "R_")]
    other = [name.replace(*swap) for name in names for swap in swaps if swap[0] in name]
    other += [f"r{name[1:]}" for name in names if names is HDM05 and name.startswith("l")]
    return (*names, *other)


def with_joints(*names: str) -> MotionData:
    data = tiny_data()
    joints = np.random.default_rng(0).normal(size=(len(data.positions), 1, len(names), 3)).astype(np.float32)
    return replace(data, positions=joints, skeleton=Skeleton(names, ((0, 1),)))


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (HDM05, {"hip": "lhipjoint", "knee": "lfemur", "ankle": "ltibia", "shoulder": "lclavicle", "wrist": "lradius"}),
        (BANDAI, {"hip": "UpperLeg_L", "knee": "LowerLeg_L", "ankle": "Foot_L", "shoulder": "UpperArm_L"}),
        (MIXAMO, {"hip": MIXAMO[1], "knee": MIXAMO[2], "ankle": MIXAMO[3], "shoulder": MIXAMO[4]}),
        (("L_Hip", "L_Knee", "L_Ankle"), {"hip": "L_Hip", "knee": "L_Knee", "ankle": "L_Ankle"}),
        (("left_hip", "left_knee", "left_foot", "left_hand"), {"ankle": "left_foot", "wrist": "left_hand"}),
    ],
)
def test_each_way_to_name_limbs(names: tuple[str, ...], expected: dict[str, str]) -> None:
    joints = both_sides(names)
    parts = body_parts(joints)
    assert {part: joints[parts[f"left_{part}"]] for part in expected} == expected
    for part in expected:
        assert parts[f"left_{part}"] != parts[f"right_{part}"]


def test_every_layout_tells_its_limbs() -> None:
    limbs = {f"{side}_{limb}" for side in ("left", "right") for limb in ("shoulder", "elbow", "hip", "knee", "ankle")}
    for name, layout in LAYOUTS.items():
        assert limbs <= set(body_parts(layout.joint_names)), name


def test_a_layout_maps_to_itself() -> None:
    for target in ("coco17", "kinect20", "body12"):
        data = with_joints(*LAYOUTS[target].joint_names)
        same = mapped(data, target)
        np.testing.assert_array_equal(same.positions, data.positions)
        assert same.skeleton is LAYOUTS[target] and not same.notes


def test_motion_capture_and_an_estimator_meet_in_body12() -> None:
    coco = with_joints(*COCO17.joint_names)
    np.testing.assert_array_equal(mapped(coco, "body12").positions, coco.positions[:, :, 5:])
    with pytest.raises(DataError, match=r"got no joint for nose, left_eye.* of coco17; body12 needs no face"):
        mapped(with_joints(*KINECT20.joint_names), "coco17")


def test_middles_are_computed_and_told() -> None:
    data = with_joints(*(name for name in KINECT20.joint_names if name not in ("hip_center", "spine")))
    own = data.skeleton.joint_names
    found = mapped(data, "kinect20")
    hips = data.positions[:, :, [own.index("hip_left"), own.index("hip_right")]].mean(axis=2)
    np.testing.assert_allclose(found.positions[:, :, 0], hips, atol=1e-6)
    assert found.notes[0].startswith("kinect20: hip_center from hip_left and hip_right, spine from hip_left and")
