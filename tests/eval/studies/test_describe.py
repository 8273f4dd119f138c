"""Descriptions: the numbers of the table, and a picture that is there whole."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ehar.data.motion_data import MotionData
from ehar.data.skeleton import Skeleton
from ehar.errors import DataError, UsageError
from eval.studies.describe import _facing, _project, describe, describe_figure
from tests.helpers.places import SHARED

DATA = SHARED


@pytest.fixture
def data() -> MotionData:
    lengths = [130, 59, 60, 121, 30, 300]
    return MotionData(
        name="some",
        positions=np.random.default_rng(0).normal(size=(sum(lengths), 2, 3, 3)).astype(np.float32),
        offsets=np.cumsum([0, *lengths]),
        labels=np.array([0, 0, 0, 1, 1, 1]),
        class_names=("wave", "walk"),
        sequence_names=("a", "b", "c", "d", "e", "f"),
        fps=25.0,
        skeleton=Skeleton(("hip", "lhand", "rhand"), ((0, 1), (0, 2))),
        is_test=np.array([True, True, False, True, False, False]),
        subjects=np.zeros((6, 2), dtype=np.int64),
        license="CC0",
        synthetic=True,
    )


def row(data: MotionData, name: str) -> tuple[object, ...]:
    return next(row for row in describe(data).rows if row[0] == name)


def text_of(data: MotionData) -> str:
    table = describe(data)
    return "\n".join((table.title, *table.footnotes))


def test_counts(data: MotionData) -> None:
    # sequences, train, test, min, median, max, windows of 60 frames that the test sequences hold
    assert row(data, "wave") == ("wave", "3", "1", "2", "59", "60", "130", "2")
    assert row(data, "walk") == ("walk", "3", "2", "1", "30", "121", "300", "2")
    assert row(data, "all") == ("all", "6", "3", "3", "30", "90", "300", "4")


def test_what_the_data_is(data: MotionData) -> None:
    text = text_of(data)
    for words in ("some (synthetic): 2 persons, 3 joints, 25 fps", "synthetic motion", "as in the data", "CC0"):
        assert words in text
    assert "2 of 6 sequences shorter than 60 frames\n--length 30 is advised" in text
    shorter = describe(data, length=30)
    assert shorter.header[-1] == "test windows L=30" and [line[-1] for line in shorter.rows] == ["5", "4", "9"]
    assert not any("advised" in note for note in shorter.footnotes)
    recorded = text_of(replace(data, synthetic=False, is_test=None, license=""))
    for words in ("some: 2 persons", "recorded motion", "none in the data", "licence: not stated"):
        assert words in recorded


def test_facing_and_projection() -> None:
    skeleton = Skeleton(("hip", "lhand", "rhand"), ((0, 1), (0, 2)))
    joints = np.array([[[0, 0, 1], [0, 0.3, 1], [0, -0.3, 1]]])  # the left hand is at +y: facing +x
    assert _facing(joints, skeleton) == pytest.approx(0.0)
    turned = joints[..., [1, 0, 2]] * [-1, 1, 1]  # by 90 degrees, counter-clockwise from above
    assert _facing(turned, skeleton) == pytest.approx(np.pi / 2)
    assert _facing(joints, Skeleton(("a", "b", "c"), ((0, 1),))) == 0.0
    seen = _project(joints, 0.0)  # from ahead: the left hand is at the right of the picture
    assert seen[0, 1, 0] == pytest.approx(0.3)
    assert _project(np.array([0.0, 0.0, 1.0]), 0.7)[1] > 0.9


@pytest.mark.parametrize("ending", ["png", "svg"])
def test_figure(tmp_path: Path, data: MotionData, ending: str) -> None:
    path = tmp_path / "deep" / f"picture.{ending}"
    describe_figure(data, path)
    assert path.stat().st_size > 5000
    assert os.listdir(path.parent) == [path.name]


def test_figures_that_cannot_be(tmp_path: Path, data: MotionData) -> None:
    with pytest.raises(UsageError, match=r"got the ending '\.doc', expected one of .*png"):
        describe_figure(data, tmp_path / "picture.doc")
    with pytest.raises(DataError, match="class 'run' has no sequence"):
        describe_figure(replace(data, class_names=("wave", "walk", "run")), tmp_path / "picture.png")
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match="cannot be written"):
        describe_figure(data, tmp_path / "file" / "picture.png")
    assert os.listdir(tmp_path) == ["file"]
