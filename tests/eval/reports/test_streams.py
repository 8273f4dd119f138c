"""The report of a run of streams: its timelines, delays and replays are those of the records."""

from base64 import b64decode
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.data.streams.data import NO_ACTIVITY
from eval.records.episodes import EpisodeRecords
from eval.replays.choice import ChosenEpisode
from eval.replays.data import MOST_BYTES as REPLAY_BYTES
from eval.replays.data import replay_data
from eval.reports.data import report_data
from eval.reports.delays import class_delays
from eval.reports.timelines import MOST_BYTES as TIMELINE_BYTES
from eval.reports.timelines import UNKNOWN, facing_of, timelines
from eval.running.run import Run, read_run
from eval.scores.streams.alarms import delays
from eval.verification.inputs import check_inputs
from tests.helpers.fakes import CLASS_NAMES, POSE, SKELETON
from tests.helpers.reports import embedded, report_of
from tests.helpers.stream_runs import FRAMES, forgetful, stream_run
from tests.helpers.streams import raising_streams

NONE = len(CLASS_NAMES)  # as the page names it


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, str]:
    """Return a run of streams and its report, made once."""
    with pytest.MonkeyPatch.context() as patch:
        forgetful(patch)
        folder = stream_run(tmp_path_factory.mktemp("watched"), ("no-act", "h-rotate", "oracle"))
        return read_run(folder), report_of(folder)


def values(text: str, kind: str) -> Any:
    return np.frombuffer(b64decode(text), dtype=np.dtype(kind).newbyteorder("<"))


def each_frame(rows: list[int]) -> list[int]:
    """Return the class of each frame, from pairs of a frame and the class from there on."""
    begins, classes = rows[::2], rows[1::2]
    return np.repeat(classes, np.diff([*begins, FRAMES])).tolist()


def named(classes: Any) -> list[int]:
    return np.where(classes == NO_ACTIVITY, NONE, classes).tolist()


def test_where_the_tracker_lost_people_the_report_shows_nobody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    forgetful(monkeypatch)
    data = raising_streams()
    missing = data.missing.copy()
    missing[data.offsets[6] + 12 : data.offsets[6] + 20] = True  # in the first test stream
    folder = stream_run(tmp_path, ("no-act",), streams=replace(data, missing=missing))
    first = next(one for one in embedded(report_of(folder), "replays")["episodes"] if one["episode"] == 0)
    people = values(first["people"], "int16").reshape(FRAMES, -1)
    gone = (people == np.iinfo(np.int16).min).all(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(gone), np.arange(12, 20))
    assert (people[~gone] > np.iinfo(np.int16).min).all()
    positions = np.where(np.arange(2)[:, None, None, None] == 0, np.nan, POSE)
    assert np.isnan(facing_of(positions, SKELETON)).tolist() == [True, False]


def test_timelines_are_those_of_the_records(watched: tuple[Run, str]) -> None:
    run, page = watched
    lines = embedded(page, "lines")
    assert lines["classes"] == [*CLASS_NAMES, "no activity"]
    assert [line["episode"] for line in lines["episodes"]] == [0, 1, 2, 3]
    assert (lines["fps"], lines["every"]) == (10, 1)
    for index, line in enumerate(lines["episodes"]):
        assert each_frame(line["shown"]) == named(run.records["oracle"].label[index])
        for name, held in run.records.items():
            drawn = line["planners"][name]
            assert each_frame(drawn["believed"]) == named(held.predicted[index])
            np.testing.assert_allclose(values(drawn["sure"], "u1"), 100 * held.true_probability[index], atol=0.51)
            path = values(drawn["path"], "u2").reshape(-1, 3)
            np.testing.assert_allclose(path[:, 0] / 100, held.viewpoint[index, :, 0], atol=6e-3)
        # They are told by the data: the people of this set stand and look along x.
        facing = values(line["facing"], "u2").astype(int)
        assert UNKNOWN not in facing
        assert np.abs((facing + 18000) % 36000 - 18000).max() < 900  # 9 degrees, of joints that shake by a centimetre


def test_timelines_of_a_large_run_are_those_of_its_first_episodes_and_of_those_wanted(
    watched: tuple[Run, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    run, _ = watched
    monkeypatch.setattr("eval.reports.timelines.MOST_BYTES", 2 * 3 * 10 * FRAMES)
    lines = timelines(report_data(run, CLASS_NAMES), [3], None)
    assert [line["episode"] for line in lines["episodes"]] == [0, 1, 3]
    assert lines["episodes"][0]["facing"] is None  # nobody knows without the data


def test_the_largest_report_of_streams_is_below_15_mb(watched: tuple[Run, str]) -> None:
    _, page = watched  # of a small run: next to all of it is the library that draws
    assert len(page.encode()) + TIMELINE_BYTES + REPLAY_BYTES < 15_000_000


def turned(angle: float) -> Any:
    spin = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    return POSE @ spin.T


def test_people_face_forward_and_a_couple_face_to_face_no_way() -> None:
    for angle in (0.0, 1.0, -2.5):
        assert facing_of(turned(angle)[None], SKELETON) == pytest.approx(angle)
        assert facing_of(np.stack([turned(angle - 0.3), turned(angle + 0.3)]), SKELETON) == pytest.approx(angle)
    assert np.isnan(facing_of(np.stack([turned(1.0), turned(1.0 + np.pi)]), SKELETON))


def test_delays_by_class_are_all_delays(watched: tuple[Run, str]) -> None:
    run, _ = watched
    held = run.records["h-rotate"]
    found = class_delays(held, len(CLASS_NAMES))
    took, recognised = delays(held.label, held.predicted)
    count = np.bincount(found.label, minlength=len(CLASS_NAMES))
    assert count.sum() == len(took) == 6
    assert np.nansum(found.means * count) == pytest.approx(took.sum())
    assert np.nansum(found.shares * count) == pytest.approx(recognised.sum())
    assert np.isnan(found.means[count == 0]).all()


def test_the_page_has_the_tables_and_the_figures_of_streams(watched: tuple[Run, str]) -> None:
    run, page = watched
    report = embedded(page, "report")
    assert "In streams: 4 episodes of 5 s" in page and "6 that are not cut" in page
    (table,) = run.tables()[len(run.summary.tables()) :]
    for row in table.rows:
        assert "".join(f'<td data-value="{cell}">{cell}</td>' for cell in row) in page
    drawn = report["grouped"]["focus"]["h-rotate"]
    assert {"accuracy", "delays", "calibration", "confusion", "classes", "gains"} <= drawn.keys()
    assert drawn["accuracy"]["layout"]["xaxis"]["title"]["text"] == "observed share of the activity [%]"
    assert len(drawn["accuracy"]["data"][-2]["x"]) == 20
    shown = np.array(drawn["confusion"]["data"][0]["z"], dtype=float)
    held: EpisodeRecords = run.records["h-rotate"]
    still = held.label == NO_ACTIVITY
    assert shown.shape == (NONE + 1, NONE + 1)
    assert shown[NONE, NONE] == pytest.approx(100 * held.correct[still].mean(), abs=0.05)


def test_replays_know_what_is_shown_and_where_the_centre_is(watched: tuple[Run, str]) -> None:
    run, page = watched
    replays = embedded(page, "replays")
    assert (replays["streams"], replays["frames"], replays["fps"]) == (True, FRAMES, 10)
    assert replays["classes"][-1] == "no activity"
    for episode in replays["episodes"]:
        label = run.records["oracle"].label[episode["episode"]]
        assert values(episode["labels"], "u2").tolist() == named(label)
        centre = values(episode["centre"], "i2").reshape(-1, 3)
        assert not centre[0].any() and 0 < np.abs(centre).max() < 30  # [cm]: people stand, but are located with errors


def test_a_stream_that_is_too_large_is_thinned(watched: tuple[Run, str], monkeypatch: pytest.MonkeyPatch) -> None:
    run, page = watched
    forgetful(monkeypatch)
    whole = embedded(page, "replays")["episodes"][0]

    def made(most: int) -> dict[str, Any]:
        monkeypatch.setattr("eval.replays.data.MOST_BYTES", most)
        chosen = [ChosenEpisode(index, "") for index in (whole["episode"], 0)]
        names = {"oracle": "oracle"}
        return replay_data(run, chosen, names, data=None, models=None, advance=lambda _: None)

    alone = len(str(whole["people"])) + len(str(whole["planners"]["oracle"]))
    assert made(10 * alone)["frames"] == FRAMES
    thin = made(alone // 3)
    assert len(thin["episodes"]) == 1 and thin["frames"] == 13 and thin["fps"] == 2.5
    labels = values(thin["episodes"][0]["labels"], "u2")
    np.testing.assert_array_equal(labels, values(whole["labels"], "u2")[::4])


def test_without_the_data_there_is_a_report_without_replays(watched: tuple[Run, str], tmp_path: Path) -> None:
    run, _ = watched
    assert check_inputs(run.config, None, None).data is not None
    lost = tmp_path / "run"
    lost.mkdir()
    for path in run.folder.iterdir():
        text = path.read_bytes()
        (lost / path.name).write_bytes(text.replace(b"raising.npz", b"gone.npz") if path.suffix == ".json" else text)
    page = report_of(lost)
    assert embedded(page, "replays")["episodes"] == []
    assert embedded(page, "lines")["episodes"][0]["facing"] is None
    assert "There are no replays" in page
