"""UTD-MHAD: joints in the order of a Kinect, people with odd numbers for training."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from ehar.data.preparing.layouts import KINECT20
from ehar.data.readers.utd_mhad import prepare_utd_mhad
from ehar.errors import DataError
from eval.conformance.data import check_data
from tests.helpers.places import SHARED

SAMPLE = SHARED / "formats_sample" / "utd_mhad"
GOOD = np.random.default_rng(0).normal(size=(20, 3, 5))


def write(folder: Path, joints: object = GOOD, name: str = "a1_s1_t1_skeleton.mat", key: str = "d_skel") -> Path:
    savemat(folder / name, {key: joints})
    return folder / name


def test_the_real_sample() -> None:
    if not SAMPLE.is_dir():
        pytest.skip(f"{SAMPLE} is absent")
    data = prepare_utd_mhad(SAMPLE)
    assert data.sequence_names == ("a10_s1_t1", "a1_s1_t1", "a1_s2_t1", "a27_s8_t3")
    assert data.class_names == ("swipe_left", "draw_circle_counter_clockwise", "squat")
    assert data.subjects[:, 0].tolist() == [1, 1, 2, 8] and data.is_test is None
    found = check_data(data)
    assert found.passed and all(check.passed and not check.doubtful for check in found.checks), str(found)
    file = loadmat(SAMPLE / "a27_s8_t3_skeleton.mat")["d_skel"]
    squat = data.sequence(3)[:, 0]
    x, y, z = file[0].T.T  # the head, frame by frame
    np.testing.assert_allclose(squat[:, KINECT20.joint_names.index("head")], np.stack([x, -z, y], axis=1), atol=1e-6)
    pelvis = squat[:, KINECT20.joint_names.index("hip_center"), 2]
    assert pelvis.max() - pelvis.min() > 0.2  # people go down


def test_odd_people_train_and_even_people_test(tmp_path: Path) -> None:
    for person in (1, 2, 3, 4):
        write(tmp_path, name=f"a5_s{person}_t1_skeleton.mat")
    data = prepare_utd_mhad(tmp_path, unit="mm")
    assert data.is_test is not None and data.is_test.tolist() == [False, True, False, True]
    assert np.abs(data.positions).max() < 0.01


@pytest.mark.parametrize(
    ("joints", "key", "problem"),
    [
        (GOOD, "skeleton", "d_skel: missing"),
        (GOOD[:19], "d_skel", r"got float64 of shape \(19, 3, 5\)"),
        (np.moveaxis(GOOD, 2, 0), "d_skel", r"got float64 of shape \(5, 20, 3\)"),
        (GOOD[:, :, :0], "d_skel", r"of shape \(20, 3, 0\)"),
        (GOOD.astype(int), "d_skel", "got int64"),
        ("text", "d_skel", "expected floats"),
        (np.where(np.arange(5) == 3, np.nan, GOOD), "d_skel", "NaN or infinite in frame 3"),
    ],
)
def test_broken_files(joints: object, key: str, problem: str, tmp_path: Path) -> None:
    file = write(tmp_path, joints, key=key)
    with pytest.raises(DataError, match=problem) as caught:
        prepare_utd_mhad(tmp_path)
    assert str(caught.value).startswith(f"{file}: ")


@pytest.mark.parametrize("size", [0, 50, 200, -20])
def test_truncated_files(size: int, tmp_path: Path) -> None:
    file = write(tmp_path)
    file.write_bytes(file.read_bytes()[:size])
    with pytest.raises(DataError, match=r"not a readable \.mat") as caught:
        prepare_utd_mhad(tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["walk.mat", "a28_s1_t1_skeleton.mat", "a1_s1_t1_depth.mat"])
def test_names_of_other_sets(name: str, tmp_path: Path) -> None:
    write(tmp_path, name=name)
    with pytest.raises(DataError, match=f"{name}: got a name"):
        prepare_utd_mhad(tmp_path)
