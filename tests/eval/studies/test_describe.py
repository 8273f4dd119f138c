"""Descriptions: the numbers of the table, and a picture that is there whole."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ehar.arrays import IntArray
from ehar.data.any_source import load_recordings
from ehar.data.motion_data import MotionData
from ehar.data.scenario import PARTS, Parts, split_parts
from ehar.data.skeleton import Skeleton
from ehar.data.streams.data import StreamData
from ehar.errors import DataError, UsageError
from eval.running.episodes import cut_scenarios
from eval.studies.describe import describe
from eval.studies.describe_figure import _facing, _project, describe_figure
from tests.helpers.places import SHARED
from tests.helpers.streams import raising_streams

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


def parts_of(parts: Parts) -> list[IntArray]:
    return [getattr(parts, part) for part in PARTS]


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


def test_streams_are_described_by_their_activities() -> None:
    data = replace(raising_streams(), missing=np.isin(np.arange(960), [50, 51, 119, 120]))
    data.missing[-1] = True
    table = describe(data, length=40)
    assert table.header[:6] == ("class", "activities", "recogniser", "policy", "validation", "test")
    assert table.header[-1] == "scored in test L=40"
    rows = {row[0]: row[1:] for row in table.rows}
    parts = split_parts(data)
    label = data.class_names.index("nod")
    shown = [int((data.segments[np.isin(data.stream_of, part), 2] == label).sum()) for part in parts_of(parts)]
    assert rows["nod"][:5] == tuple(map(str, (sum(shown), *shown)))
    assert rows["all"][0] == "48" and rows["all"][5:8] == ("1.0", "1.0", "1.0")
    # In 12 s an activity begins every 2 s from 0 on: of the two in an episode of 4 s, the first may be cut.
    assert rows["all"][-1] == "6" and rows["no activity"] == ("48", *rows["no activity"][1:5], "1.0", "1.0", "1.0", "-")
    assert sum(int(row[-1]) for row in table.rows[:3]) == 6
    text = "\n".join(table.footnotes)
    for words in (
        "0 of 8 streams shorter than 40 frames",
        "; test 2 streams of 2 people, 0.4 minutes",
        "no activity in 50 % of the frames",
        "an episode has 40 frames, 4 s; windows have 40 for the recogniser, 40 for planners: 4 and 4 s",
        "nobody is seen in 0.5 % of the frames: 4 gaps, the longest of 0.2 s",  # none reaches into another stream
    ):
        assert words in text
    assert "advised" not in text and "share" not in text


def test_short_streams_and_shared_people_are_told() -> None:
    person = np.repeat(np.arange(8), 2)
    data = replace(raising_streams(people=16), subjects=person[:, None], is_test=person > 5)
    text = "\n".join(describe(data).footnotes)  # 30 s, of which no stream has as many
    assert "16 of 16 streams shorter than 300 frames\n--length 120 is advised: few streams are shorter" in text
    assert "recogniser and policy share 4 people, in other streams" in text
    assert "an episode has 300 frames, 30 s; windows have 40 for the recogniser, 80 for planners" in text
    unknown = replace(raising_streams(), subjects=np.full((8, 1), -1), is_test=None)
    assert "people" not in "\n".join(describe(unknown).footnotes)


def test_built_in_streams_are_described() -> None:
    table = describe("duo-stream", fps=10)
    assert "duo (synthetic): 2 persons" in table.title.replace("duo-stream", "duo")
    assert any("groups of people" in note for note in table.footnotes)


def test_a_couple_counts_once_whoever_comes_first() -> None:
    streams = load_recordings("duo-stream", fps=10)
    assert isinstance(streams, StreamData)
    subjects, test = streams.subjects.copy(), split_parts(streams).test
    subjects[test] = subjects[test[0]]
    subjects[test[::2]] = subjects[test[0], ::-1]
    assert "; test 20 streams of 1 group of people" in "\n".join(
        describe(replace(streams, subjects=subjects)).footnotes
    )


def test_a_real_recording_is_described() -> None:
    if not (DATA / "utkinect.npz").is_file():
        pytest.skip("utkinect.npz of shared/data is not here")
    table = describe(DATA / "utkinect.npz")
    rows = {row[0]: row for row in table.rows}
    assert rows["all"] == ("all", "199", "40", "60", "20", "79", "0.8", "3.7", "22.3", "59")
    assert any("25 gaps, the longest of 9.6 s" in note for note in table.footnotes)


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


def test_a_picture_of_streams(tmp_path: Path) -> None:
    describe_figure(raising_streams(), tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 5000


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


def test_what_a_reader_of_streams_changed_is_said_here_and_in_a_benchmark() -> None:
    streams = replace(raising_streams(), notes=("2 of 9 segments overlap",))
    assert "warning: 2 of 9 segments overlap" in describe(streams).footnotes
    lines: list[str] = []
    cut_scenarios(streams, np.arange(2), 50, lines.append)
    assert lines[0] == "warning: raising: 2 of 9 segments overlap"
