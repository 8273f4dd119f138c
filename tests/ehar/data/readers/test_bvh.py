"""BVH: joint positions against ones worked out by hand, labels from names, and files that are not as expected."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.data.motion_file import load_motion, save_motion
from ehar.data.readers.bvh import prepare_bvh, read_bvh
from ehar.errors import DataError, UsageError
from tests.helpers.places import SHARED

SAMPLE = SHARED / "bvh_sample"

ARM = """HIERARCHY
ROOT base
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT elbow
  {
    OFFSET 0 1 0
    CHANNELS 3 Xrotation Yrotation Zrotation
    JOINT hand
    {
      OFFSET 0 1 0
      CHANNELS 1 Yposition
      End Site
      {
        OFFSET 0 5 0
      }
    }
  }
}
MOTION
Frames: 4
Frame Time: 0.0333333
1 2 3 0 0 0   0 0 0  1
1 2 3 90 90 0   90 0 0  1
0 0 0 0 0 90   0 0 90  2
0 0 0 30 0 0   0 0 60  1
"""


def write(file: Path, text: str = ARM) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)
    return file


def test_positions_by_hand(tmp_path: Path) -> None:
    clip = read_bvh(write(tmp_path / "a.bvh"))
    assert clip.joint_names == ("base", "elbow", "hand")  # the end site is left out
    assert clip.parents == (-1, 0, 1)
    assert clip.fps == 30.0
    np.testing.assert_allclose(clip.positions[0], [[1, 2, 3], [1, 3, 3], [1, 4, 3]], atol=1e-12)
    # R_z(90) R_x(90) takes y to z; one more R_x(90) inside it makes y -> -y under R_x(180), then x under R_z(90).
    np.testing.assert_allclose(clip.positions[1], [[1, 2, 3], [1, 2, 4], [2, 2, 4]], atol=1e-12)
    # R_y(90) leaves y; then y -> -x under R_z(90), and -x -> z under R_y(90): 2 long, as the position channel says.
    np.testing.assert_allclose(clip.positions[2], [[0, 0, 0], [0, 1, 0], [0, 1, 2]], atol=1e-12)
    s, c = np.sin(np.radians(30)), np.cos(np.radians(30))
    np.testing.assert_allclose(clip.positions[3], [[0, 0, 0], [-s, c, 0], [-s - 1, c, 0]], atol=1e-12)


def test_the_order_of_channels_is_the_order_of_rotations(tmp_path: Path) -> None:
    other = ARM.replace("Zrotation Xrotation Yrotation", "Xrotation Zrotation Yrotation")
    clip = read_bvh(write(tmp_path / "a.bvh", other))
    # R_x(90) R_z(90): y -> -x, which R_x leaves.
    np.testing.assert_allclose(clip.positions[1, 1], [0, 2, 3], atol=1e-12)


def test_units_axes_and_names(tmp_path: Path) -> None:
    write(tmp_path / "lift_slow_01.bvh")
    write(tmp_path / "deep" / "drop_it_slow_02.bvh")
    data = prepare_bvh(tmp_path)
    assert data.class_names == ("drop_it", "lift")  # the label takes as much of the name as it can
    assert data.sequence_names == ("deep/drop_it_slow_02", "lift_slow_01")
    assert data.labels.tolist() == [0, 1]
    assert data.positions.shape == (8, 1, 3, 3)
    assert data.is_test is None
    assert data.skeleton.bones == ((0, 1), (1, 2))
    np.testing.assert_allclose(data.sequence(1)[1, 0], [[0.01, -0.03, 0.02], [0.01, -0.04, 0.02], [0.02, -0.04, 0.02]])
    metres = prepare_bvh(tmp_path, unit=1.0, up="z", label_from="folder")
    assert metres.class_names == tuple(sorted(("deep", tmp_path.name)))
    np.testing.assert_allclose(metres.sequence(1)[1, 0], [[1, 2, 3], [1, 2, 4], [2, 2, 4]], atol=1e-6)
    number = prepare_bvh(tmp_path, pattern="{style}_{label}.bvh")
    assert number.class_names == ("it_slow_02", "slow_01")


def test_a_root_that_the_body_moves_against_is_left_out(tmp_path: Path) -> None:
    free = ARM.replace("CHANNELS 3 Xrotation", "CHANNELS 4 Xposition Xrotation")
    rows = "".join(f"0 0 0 0 0 0   {x} 0 0 0  1\n" for x in range(4))
    write(tmp_path / "lift_slow_01.bvh", free[: free.index("1 2 3 0")] + rows)
    data = prepare_bvh(tmp_path, unit=1.0, up="z")
    assert data.skeleton.joint_names == ("elbow", "hand")
    assert data.skeleton.bones == ((0, 1),)
    np.testing.assert_allclose(data.positions[:, 0, 0], [[x, 1, 0] for x in range(4)])


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("HIERARCHY", "HELLO", "not a BVH file"),
        ("MOTION", "MOTIONS", "not a BVH file"),
        ("ROOT base", "JOINT base", "line 2: got JOINT here"),
        ("JOINT elbow", "ROOT elbow", "line 6: got ROOT here"),
        ("JOINT hand", "JOINT elbow", "HIERARCHY: joint 'elbow' appears twice"),
        ("OFFSET 0 1 0", "OFFSET 0 1", "line 8: got 'CHANNELS', expected a finite number"),
        ("OFFSET 0 1 0", "OFFSET 0 1 up", "line 8: got 'up', expected a finite number"),
        ("Yposition\n      End", "Wposition\n      End", "line 13: got channels Wposition of 'hand'"),
        ("Xrotation Yrotation Zrotation", "Xrotation Xrotation Zrotation", "line 9: got channels"),
        ("CHANNELS 1 Yposition", "CHANNEL 1 Yposition", "line 13: got 'CHANNEL'"),
        ("}\nMOTION", "MOTION", "HIERARCHY: got 1 open braces"),
        ("Frames: 4", "Frames: 5", "got 4 frames, expected the 5"),
        ("Frames: 4", "Frame: 4", "line 22: got 'Frame: 4', expected 'Frames:' and a number"),
        ("Frame Time: 0.0333333", "Frame Time: 0", "line 23: got frame time 0"),
        ("Frame Time: 0.0333333", "Frame Time: 1e-9", "line 23: got frame time 1e-09, expected seconds, at least"),
        ("0 0 0 30 0 0   0 0 60  1", "0 0 0 30 0 0   0 0 60", "line 27: got 9 numbers, expected 10"),
        ("0 0 0 30 0 0   0 0 60  1", "0 0 0 nan 0 0   0 0 60 1", "line 27: got 'nan', expected a finite number"),
    ],
)
def test_malformed_files_are_named(tmp_path: Path, old: str, new: str, problem: str) -> None:
    assert old in ARM
    file = write(tmp_path / "a.bvh", ARM.replace(old, new, 1))
    with pytest.raises(DataError) as caught:
        read_bvh(file)
    assert str(caught.value).startswith(f"{file}: {problem}") and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("JOINT hand", "JOINT paw", "got another skeleton than"),
        ("0.0333333", "0.0166667", "got 60 frames a second, expected 30"),
        (ARM[ARM.index("Frames") :], "Frames: 0\nFrame Time: 0.0333333\n", "got no frames"),
    ],
)
def test_files_that_differ_are_named(tmp_path: Path, old: str, new: str, problem: str) -> None:
    write(tmp_path / "lift_slow_01.bvh")
    other = write(tmp_path / "lift_slow_02.bvh", ARM.replace(old, new))
    with pytest.raises(DataError) as caught:
        prepare_bvh(tmp_path)
    assert str(caught.value).startswith(f"{other}: {problem}")


@pytest.mark.parametrize(
    "options", [{"pattern": "{style}.bvh"}, {"unit": 0.0}, {"unit": float("nan")}, {"up": "x"}, {"label_from": "date"}]
)
def test_impossible_options(tmp_path: Path, options: dict[str, Any]) -> None:
    write(tmp_path / "lift_slow_01.bvh")
    with pytest.raises(UsageError, match=f"{next(iter(options))}: got"):
        prepare_bvh(tmp_path, **options)


def test_folders_and_names_that_do_not_fit(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"got no \.bvh files"):
        prepare_bvh(tmp_path)
    write(tmp_path / "lift.bvh")
    with pytest.raises(DataError, match=r"lift\.bvh: got a name that does not fit the pattern"):
        prepare_bvh(tmp_path)


@pytest.mark.parametrize(("frame_time", "fps"), [("0.008333", 120.0), ("0.0416667", 24.0), ("0.0333667", 29.97)])
def test_frame_times_of_few_digits(tmp_path: Path, frame_time: str, fps: float) -> None:
    clip = read_bvh(write(tmp_path / "a.bvh", ARM.replace("0.0333333", frame_time)))
    assert clip.fps == pytest.approx(fps, rel=1e-5)


def test_an_ending_in_capitals_and_a_mark_of_the_byte_order(tmp_path: Path) -> None:
    (tmp_path / "WALK_A_1.BVH").write_text(ARM, encoding="utf-8-sig")
    data = prepare_bvh(tmp_path)
    assert data.class_names == ("WALK",) and data.lengths.tolist() == [4]


def test_real_sample(tmp_path: Path) -> None:
    if not SAMPLE.is_dir():
        pytest.skip(f"{SAMPLE} is absent")
    data = prepare_bvh(SAMPLE)
    assert data.class_names == ("bow", "run", "walk")
    assert data.lengths.tolist() == [128, 172, 72, 102, 146, 285]
    assert (data.fps, data.persons, len(data.skeleton.joint_names)) == (30.0, 1, 21)
    joint = data.skeleton.joint_names.index
    body = data.positions[:, 0]
    start, end = data.skeleton.bone_indices.T
    lengths = np.linalg.norm(body[:, end] - body[:, start], axis=-1)
    assert np.ptp(lengths, axis=0).max() < 1e-5
    assert 0.0 < body[..., 2].min() < 0.1  # the lowest toes
    standing = data.sequence(data.sequence_names.index("bow_active_001"))[0, 0]
    assert 1.3 < standing[joint("Head"), 2] < 1.6  # the joint below the skull of a person of 1.5 to 1.8 m
    to_left = body[:, joint("UpperLeg_L")] - body[:, joint("UpperLeg_R")]
    walk = slice(*data.offsets[[4, 6]])
    toes = (body[:, joint("Toes_L")] - body[:, joint("Foot_L")])[walk]
    assert (
        (np.cross(to_left[walk], [0.0, 0.0, 1.0]) * toes).sum(axis=-1) > 0
    ).mean() > 0.9  # not mirrored, but in a few swings
    save_motion(tmp_path / "bvh.npz", data)
    assert load_motion(tmp_path / "bvh.npz").sha256 == data.sha256
