"""AIST++: pickles read without executing them, axes and units, and a selection split by dancer."""

import os
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.data.motion_file import load_motion, save_motion
from ehar.data.readers import aistpp
from ehar.data.readers.aistpp import prepare_aistpp, read_keypoints
from ehar.errors import DataError
from tests.helpers.places import SHARED

SAMPLE = SHARED / "aistpp_sample"


def keypoints(frames: int = 3) -> np.ndarray:
    return np.random.default_rng(0).normal(size=(frames, 17, 3)) * 50


def dump(file: Path, content: Any, protocol: int = 4) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(pickle.dumps(content, protocol=protocol))
    return file


def make_root(root: Path, names: list[str], ignored: tuple[str, ...] = ()) -> Path:
    for name in names:
        dump(root / "keypoints3d" / f"{name}.pkl", {"keypoints3d_optim": keypoints()})
    (root / "keypoints3d").mkdir(parents=True, exist_ok=True)
    (root / "ignore_list.txt").write_text("\n".join(ignored) + "\n")
    return root


def names(genre: str, dancers: tuple[int, ...], count: int) -> list[str]:
    return [f"{genre}_sBM_cAll_d{dancer:02}_m{genre[1:]}0_ch{i:02}" for dancer in dancers for i in range(count)]


def test_centimetres_with_y_up_become_metres_with_z_up(tmp_path: Path) -> None:
    points = keypoints()
    points[1, 16] = [100.0, 200.0, 300.0]
    content = {"keypoints3d": np.full((3, 17, 3), np.nan), "keypoints3d_optim": points}
    joints = read_keypoints(dump(tmp_path / "a.pkl", content))
    assert joints.shape == (3, 17, 3) and joints.dtype == np.float32
    np.testing.assert_allclose(joints[1, 16], [1.0, -3.0, 2.0])


@pytest.mark.parametrize("protocol", range(2, pickle.HIGHEST_PROTOCOL + 1))
def test_arrays_of_every_protocol_are_read(tmp_path: Path, protocol: int) -> None:
    points = keypoints()
    file = dump(tmp_path / "a.pkl", {"keypoints3d_optim": points}, protocol)
    np.testing.assert_allclose(read_keypoints(file), points[..., [0, 2, 1]] * [0.01, -0.01, 0.01], rtol=1e-6)


def test_the_change_of_axes_mirrors_nothing(tmp_path: Path) -> None:
    points = np.zeros((1, 17, 3))
    points[0, :3] = 100.0 * np.eye(3)
    joints = read_keypoints(dump(tmp_path / "a.pkl", {"keypoints3d_optim": points}))
    assert np.linalg.det(joints[0, :3]) == pytest.approx(1.0)


class Intruder:
    def __init__(self, function: Any, *arguments: Any) -> None:
        self.call = (function, arguments)

    def __reduce__(self) -> Any:
        return self.call


@pytest.mark.parametrize(
    ("intruder", "name"),
    [
        (lambda trace: Intruder(os.mkdir, str(trace)), "posix.mkdir"),
        (lambda trace: Intruder(eval, f"__import__('os').mkdir({str(trace)!r})"), "builtins.eval"),
        (lambda trace: Intruder(getattr, "text", "upper"), "builtins.getattr"),
        (lambda trace: Intruder(np.load, str(trace)), "numpy.load"),
    ],
)
@pytest.mark.parametrize("wrap", [lambda x: x, lambda x: {"keypoints3d_optim": x}, lambda x: np.array([x, None])])
def test_malicious_pickles_are_named_and_not_executed(tmp_path: Path, intruder: Any, name: str, wrap: Any) -> None:
    trace = tmp_path / "trace"
    file = dump(tmp_path / "a.pkl", wrap(intruder(trace)))
    with pytest.raises(DataError) as caught:
        read_keypoints(file)
    assert str(caught.value).startswith(f"{file}: asks for {name}, which is not executed")
    assert not trace.exists()


def test_dotted_names_do_not_reach_into_what_is_admitted(tmp_path: Path) -> None:
    file = tmp_path / "a.pkl"
    file.write_bytes(b"\x80\x04\x8c\x05numpy\x8c\x0fndarray.tofile\x93.".replace(b"\x0f", b"\x0e"))
    with pytest.raises(DataError, match=r"asks for numpy\.ndarray\.tofile"):
        read_keypoints(file)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ([1, 2], "keypoints3d_optim: missing"),
        ({"keypoints3d": keypoints()}, "keypoints3d_optim: missing"),
        ({"keypoints3d_optim": [[1.0]]}, "keypoints3d_optim: missing"),
        ({"keypoints3d_optim": keypoints()[:, :16]}, "got float64 of shape (3, 16, 3)"),
        ({"keypoints3d_optim": keypoints(0)}, "got float64 of shape (0, 17, 3)"),
        ({"keypoints3d_optim": keypoints().astype(object)}, "got object"),
        (
            {"keypoints3d_optim": np.where(np.arange(3)[:, None, None] == 2, np.nan, keypoints())},
            "NaN or infinite in frame 2",
        ),
    ],
)
def test_unexpected_contents_are_named(tmp_path: Path, content: Any, problem: str) -> None:
    file = dump(tmp_path / "a.pkl", content)
    with pytest.raises(DataError) as caught:
        read_keypoints(file)
    assert str(caught.value).startswith(f"{file}: ") and problem in str(caught.value)


def test_truncated_pickles_are_named(tmp_path: Path) -> None:
    file = dump(tmp_path / "a.pkl", {"keypoints3d_optim": keypoints()})
    content = file.read_bytes()
    for size in (0, 1, 10, 100, len(content) - 1):
        file.write_bytes(content[:size])
        with pytest.raises(DataError, match=r"a\.pkl: not a readable pickle"):
            read_keypoints(file)


def test_selection_has_the_papers_size_and_no_dancer_on_both_sides(tmp_path: Path) -> None:
    root = make_root(tmp_path, names("gBR", (4, 5, 6), 15) + names("gJB", (7, 8, 9), 15))
    data = prepare_aistpp(root)
    assert data.class_names == ("break", "ballet-jazz")
    assert data.is_test is not None
    for label in range(2):
        members = data.labels == label
        assert int((members & data.is_test).sum()) == 7
        assert int((members & ~data.is_test).sum()) == 14
        train, test = set(data.subjects[members & ~data.is_test, 0]), set(data.subjects[members & data.is_test, 0])
        assert len(train) == 2 and len(test) == 1 and not train & test
    assert len(set(data.sequence_names)) == 42
    again = prepare_aistpp(root)
    assert again.sha256 == data.sha256


def test_a_dancer_of_two_genres_is_on_one_side_in_both(tmp_path: Path) -> None:
    genres = names("gBR", (1, 2, 3, 4, 5, 6), 2) + names("gLO", (4, 5, 6, 7, 8, 9), 2) + names("gPO", (9, 1, 2), 2)
    data = prepare_aistpp(make_root(tmp_path, genres))
    assert data.is_test is not None
    assert not set(data.subjects[data.is_test, 0]) & set(data.subjects[~data.is_test, 0])


def test_ignored_sequences_are_left_out(tmp_path: Path) -> None:
    everything = names("gBR", (4, 5), 3)
    data = prepare_aistpp(make_root(tmp_path, everything, ignored=(everything[1], "gWA_unknown")))
    assert set(data.sequence_names) == {*everything} - {everything[1]}
    (tmp_path / "splits").mkdir()
    (tmp_path / "ignore_list.txt").rename(tmp_path / "splits" / "ignore_list.txt")
    assert set(prepare_aistpp(tmp_path).sequence_names) == {*everything} - {everything[1]}
    (tmp_path / "splits" / "ignore_list.txt").unlink()
    with pytest.raises(DataError, match=r"ignore_list\.txt: no such file"):
        prepare_aistpp(tmp_path)


def test_folders_that_are_not_aistpp(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"got no \*\.pkl"):
        prepare_aistpp(tmp_path)
    with pytest.raises(DataError, match=r"dance\.pkl: got a name"):
        prepare_aistpp(make_root(tmp_path / "a", ["dance"]))
    with pytest.raises(DataError, match="got a name"):
        prepare_aistpp(make_root(tmp_path / "b", names("gXX", (1,), 1)))
    one = names("gBR", (1,), 1)
    with pytest.raises(DataError, match="leaves none of its 1 files"):
        prepare_aistpp(make_root(tmp_path / "c", one, ignored=tuple(one)))


def test_a_genre_with_one_dancer_leaves_the_data_without_a_split(tmp_path: Path) -> None:
    data = prepare_aistpp(make_root(tmp_path, names("gBR", (4, 5, 6), 2) + names("gJS", (3,), 2)))
    assert data.is_test is None
    assert len(data.labels) == 8


def test_skeleton_names_are_mirrored() -> None:
    joints = aistpp.SKELETON.joint_names
    for name, other in zip(joints, aistpp.SKELETON.mirror, strict=True):
        assert joints[other] == name.replace("left", "x").replace("right", "left").replace("x", "right")
    assert {j for bone in aistpp.SKELETON.bones for j in bone} == set(range(17))


def test_real_sample(tmp_path: Path) -> None:
    if not SAMPLE.is_dir():
        pytest.skip(f"{SAMPLE} is absent")
    data = prepare_aistpp(SAMPLE)
    assert (data.class_names, len(data.labels), data.fps) == (("break", "street-jazz"), 4, 60.0)
    joint = data.skeleton.joint_names.index
    dance = data.sequence(data.sequence_names.index("gJS_sBM_cAll_d03_mJS2_ch07"))[:, 0]
    nose, ankle = dance[:, joint("nose")], dance[:, joint("left_ankle")]
    assert 1.2 < np.median(nose[:, 2] - ankle[:, 2]) < 1.7  # upright, and of a person's height
    to_left = dance[:, joint("left_hip")] - dance[:, joint("right_hip")]
    ahead = nose - (dance[:, joint("left_ear")] + dance[:, joint("right_ear")]) / 2
    assert ((np.cross(to_left, [0.0, 0.0, 1.0]) * ahead).sum(axis=-1) > 0).mean() > 0.95  # not mirrored
    save_motion(tmp_path / "aistpp.npz", data)
    assert load_motion(tmp_path / "aistpp.npz").sha256 == data.sha256
