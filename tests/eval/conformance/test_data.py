"""The kit of motion data: good sets pass, each way to break one fails its own check, and its advice mends it."""

import shlex
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from ehar.data.motion_data import MotionData
from ehar.data.motion_file import save_motion
from ehar.data.skeleton import Skeleton
from ehar.data.source import load_data
from ehar.data.streams.file import save_streams
from ehar.errors import EharError, UsageError
from eval.cli.main import main
from eval.conformance.checks import Conformance, ContractCheck
from eval.conformance.data import check_data
from tests.helpers.places import SHARED
from tests.helpers.streams import tiny_streams


@cache
def few(name: str = "solo", sequences: int = 24) -> MotionData:
    """Return a few sequences of a built-in set, with all its classes."""
    data = load_data(name)
    kept = np.linspace(0, len(data.labels) - 1, sequences).astype(int)
    return replace(
        data,
        positions=np.concatenate([data.sequence(i) for i in kept]),
        offsets=np.cumsum([0, *data.lengths[kept]]),
        labels=data.labels[kept],
        sequence_names=tuple(data.sequence_names[i] for i in kept),
        subjects=data.subjects[kept],
        is_test=None,
    )


def changed(data: MotionData, change: Callable[[np.ndarray], np.ndarray]) -> MotionData:
    return replace(data, positions=change(data.positions.copy()).astype(np.float32))


def only_failure(found: Conformance) -> ContractCheck:
    """Return the one check that failed; the speed of people of another size does not count."""
    failed = [check for check in found.failed if "as fast" not in check.name] or found.failed
    assert len(failed) == 1, str(found)
    return failed[0]


@pytest.mark.parametrize("name", ["duo", "solo", "solo-stream"])
def test_built_in_sets_pass_without_a_warning(name: str) -> None:
    found = check_data(name)
    assert found.passed, str(found)
    assert all(check.passed and not check.doubtful for check in found.checks)


@pytest.mark.parametrize("name", ["hdm05", "bandai2", "sbu", "nwucla", "kindergator", "utkinect"])
def test_real_sets_pass(name: str) -> None:
    path = SHARED / f"{name}.npz"
    if not path.is_file():
        pytest.skip(f"{path} is absent")
    found = check_data(path)
    assert found.passed and not any(check.passed is None for check in found.checks), str(found)
    noisy = [check.name for check in found.checks if check.doubtful]
    assert len(noisy) == {"nwucla": 2, "utkinect": 1}.get(name, 0), noisy  # bones change; nwucla's limbs jump


TO_Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])  # ours to those of a file with y up
BROKEN: dict[str, tuple[Callable[[np.ndarray], np.ndarray], str, str]] = {
    "millimetres": (lambda p: p * 1000, "bones of human size", "--unit mm"),
    "centimetres": (lambda p: p * 100, "bones of human size", "--unit cm"),
    "y up": (lambda p: p @ TO_Y_UP.T, "head above feet", "--up y"),
    "y down": (lambda p: -p[..., [0, 2, 1]] * [-1, 1, -1], "head above feet", "--up -y"),
    "upside down": (lambda p: p * [1, -1, -1], "head above feet", "--up -z"),
    "mirrored": (lambda p: p * [-1, 1, 1], "left is left", "--mirror"),
}


@pytest.mark.parametrize("name", BROKEN)
@pytest.mark.parametrize("built_in", ["duo", "solo"])
def test_what_breaks_a_file_is_named_and_its_advice_mends_it(
    name: str, built_in: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change, check, option = BROKEN[name]
    path = tmp_path / "broken one.npz"
    whole = few(built_in)
    save_motion(path, changed(whole, change))
    with pytest.raises(SystemExit) as ended:
        main(["data", "check", str(path)])
    assert ended.value.code == 1
    failed = only_failure(check_data(path))
    assert failed.name.startswith(check) and failed.mend.replace("=", " ").endswith(option), failed
    capsys.readouterr()
    command = shlex.split(failed.mend.replace("mended.npz", str(tmp_path / "mended.npz")))
    main(command[1:])  # the advice is a command line
    out = capsys.readouterr().out
    assert "FAILED" not in out
    mended = load_data(tmp_path / "mended.npz")
    np.testing.assert_allclose(mended.positions, whole.positions, atol=1e-5)
    assert check_data(tmp_path / "mended.npz").passed


def test_advice_is_right_for_joints_in_the_frame_of_a_camera(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ours = replace(few(), views=np.ones(24, dtype=int))  # x to the camera's right, y away from it
    left_up_ahead = changed(ours, lambda p: p[..., [0, 2, 1]] * [-1, 1, 1])
    path = tmp_path / "kinect.npz"
    save_motion(path, left_up_ahead)
    failed = only_failure(check_data(path))
    assert failed.mend.endswith("--up y")
    main(["data", "prepare", "npz", str(path), str(tmp_path / "mended.npz"), "--up", "y"])
    np.testing.assert_allclose(load_data(tmp_path / "mended.npz").positions, ours.positions, atol=1e-5)
    with pytest.raises(SystemExit):
        main(["data", "prepare", "npz", str(tmp_path / "mended.npz"), str(tmp_path / "wrong.npz"), "--up", "y"])
    assert "z of the file points up" in capsys.readouterr().out  # told in the axes of the file, not of the result


def test_feet_that_are_where_ankles_are_leave_the_word_to_knees() -> None:
    data = few()
    names = data.skeleton.joint_names
    ankles = tuple(names.index(f"{side}_ankle") for side in ("left", "right"))
    feet = Skeleton(
        (*names, "left_foot", "right_foot"),
        (*data.skeleton.bones, (ankles[0], len(names)), (ankles[1], len(names) + 1)),
    )
    footed = replace(data, positions=data.positions[:, :, [*range(len(names)), *ankles]], skeleton=feet)
    found = check_data(footed)
    assert found.passed and any("knees do" in check.name for check in found.checks), str(found)
    assert only_failure(check_data(changed(footed, lambda p: p * [-1, 1, 1]))).got.startswith("knees point backwards")


@pytest.mark.parametrize("factor", [0.1, 10, 0.01])
def test_people_of_another_size_than_any_unit_tells(factor: float) -> None:
    failed = only_failure(check_data(changed(few(), lambda p: p * factor)))
    assert failed.name.startswith("bones of human size") and "--unit METRES" in failed.mend
    assert "look like" not in failed.got


def test_a_set_of_two_units() -> None:
    data = few()
    half = slice(data.offsets[12])
    mixed = data.positions.copy()
    mixed[half] *= 1000
    failed = only_failure(check_data(replace(data, positions=mixed)))
    assert "and 11 more sequences" in failed.got and "one by one" in failed.mend


def test_an_empty_second_person() -> None:
    data = few("duo")
    empty = data.positions.copy()
    begin, end = data.offsets[3:5]
    empty[begin:end, 1] = 0
    failed = only_failure(check_data(replace(data, positions=empty)))
    assert failed.name == "everybody is there in every frame"
    assert f"person 2 with all joints at one point in {end - begin} of" in failed.got
    assert repr(data.sequence_names[3]) in failed.got and "--persons 1" in failed.mend


def test_a_second_person_who_is_a_copy_of_the_first() -> None:
    data = few("duo")
    failed = only_failure(check_data(changed(data, lambda p: p[:, [0, 0]])))
    assert "the same joints as person 1" in failed.got


def test_joints_without_names_that_say_what_they_are() -> None:
    data = few()
    numbered = tuple(f"joint_{i}" for i in range(len(data.skeleton.joint_names)))
    found = check_data(replace(data, skeleton=Skeleton(numbered, data.skeleton.bones)))
    failed = only_failure(found)
    assert "joint_0, joint_1, joint_2, ..." in failed.got and "left_hip" in failed.expected
    assert "--joints" in failed.mend
    unknown = [check.name for check in found.checks if check.passed is None]
    assert len(unknown) == 2  # up and left cannot be told


def test_bones_that_change_their_lengths() -> None:
    data = few()
    sizes = np.random.default_rng(0).uniform(0.2, 1.8, (len(data.positions), 1, 1, 1))
    failed = only_failure(check_data(changed(data, lambda p: p * sizes)))
    assert failed.name == "bones keep their lengths" and "most from " in failed.got


@pytest.mark.parametrize("fps", [0.5, 1000.0])
def test_a_rate_that_people_do_not_move_at(fps: float) -> None:
    failed = only_failure(check_data(replace(few(), fps=fps)))
    assert failed.name.startswith("people move") and "--fps" in failed.mend


def test_a_joint_that_is_elsewhere_for_one_frame_is_a_warning_that_says_where() -> None:
    data = few()
    begin, joint = int(data.offsets[3]), data.skeleton.joint_names[5]

    def thrown(positions: np.ndarray) -> np.ndarray:
        positions[begin + 7, 0, 5] += (0, 2.5, 0)
        positions[begin + 20, 0, 2] += (1.4, 0, 0)
        return positions

    found = check_data(changed(data, thrown))
    told = [check for check in found.checks if check.doubtful]
    assert found.passed and len(told) == 1, str(found)
    assert told[0].name == f"joints jump in {100 * 2 / len(data.positions):.2g} % of frames"
    assert told[0].got == f"farthest {joint} by 2.5 m in frame 7 of sequence {data.sequence_names[3]!r}"


def test_a_body_that_moves_on_does_not_jump() -> None:
    def walked(positions: np.ndarray) -> np.ndarray:
        return positions + np.arange(len(positions))[:, None, None, None] * np.array((0.2, 0, 0))

    assert "joints jump" not in str(check_data(changed(few(), walked)))


def test_nan_is_a_failed_check_and_its_advice_mends_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = few()
    path = tmp_path / "nan.npz"
    save_motion(path, data)
    with np.load(path) as archive:
        arrays = dict(archive)
    arrays["positions"] = arrays["positions"].copy()
    arrays["positions"][5:7, 0, 3] = np.nan
    np.savez(path, **arrays)
    found = check_data(path)
    assert not found.passed and "got NaN in sequence" in found.failed[0].got
    main(shlex.split(found.failed[0].mend.removesuffix(" fills them").replace("mended", str(tmp_path / "m")))[1:])
    mended = load_data(tmp_path / "m.npz")
    assert mended.missing is not None and mended.missing.nonzero()[0].tolist() == [5, 6]
    np.testing.assert_allclose(mended.positions[5, 0, 3], (2 * data.positions[4, 0, 3] + data.positions[7, 0, 3]) / 3)
    capsys.readouterr()


def test_many_interpolated_frames_are_a_warning() -> None:
    data = few()
    missing = np.arange(len(data.positions)) % 10 == 0
    found = check_data(replace(data, missing=missing))
    assert found.passed and [check.name for check in found.checks if check.doubtful] == [
        f"{100 * missing.mean():.1f} % of frames are interpolated, where the tracker lost something"
    ]


def test_streams_are_checked_as_sequences_are(tmp_path: Path) -> None:
    path = tmp_path / "streams.npz"
    save_streams(path, tiny_streams())
    found = check_data(path)
    assert found.passed and "2.5 % of frames are interpolated" in str(found)
    below = tiny_streams()
    save_streams(path, replace(below, positions=below.positions * np.float32([1, -1, -1])))
    failed = only_failure(check_data(path))
    assert failed.mend == f"write {path} again, as ehar data prepare reads sequences with --up=-z"


def test_one_class_leaves_nothing_to_tell_apart_but_in_streams() -> None:
    data = few()
    found = check_data(replace(data, labels=np.zeros_like(data.labels), class_names=("mambo",)))
    assert [check.name for check in found.checks if check.doubtful] == [
        "all show mambo: no recogniser can learn from them alone"
    ]
    streams = tiny_streams()
    alone = np.array([[begin, end, 0] for begin, end, _ in streams.segments])
    found = check_data(replace(streams, segments=alone, class_names=("mambo",)))
    assert "there is something to tell apart: 1 class" in [check.name for check in found.checks]


def test_a_file_that_is_not_there() -> None:
    with pytest.raises(EharError, match="nowhere"):
        check_data("nowhere")


def test_a_file_that_is_no_archive(tmp_path: Path) -> None:
    path = tmp_path / "text.npz"
    path.write_text("text")
    found = check_data(path)
    assert not found.passed and "not an .npz file" in found.failed[0].got


def test_a_file_that_is_not_there_is_no_check_that_failed(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"none\.npz: no such file; expected a built-in set, or a prepared \.npz"):
        check_data(tmp_path / "none.npz")


def test_an_array_whose_name_is_misspelt_is_named(tmp_path: Path) -> None:
    save_motion(tmp_path / "good.npz", few())
    with np.load(tmp_path / "good.npz") as archive:
        arrays = dict(archive)
    arrays["subject"], arrays["styles"] = arrays.pop("subjects"), np.zeros(24)  # styles are nobody's
    np.savez(tmp_path / "bad.npz", allow_pickle=False, **arrays)
    assert check_data(tmp_path / "good.npz").passed
    failed = only_failure(check_data(tmp_path / "bad.npz"))
    assert (failed.got, failed.expected) == ("subject", "subjects")
