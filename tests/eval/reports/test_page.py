import json
import re
import weakref
from base64 import b64decode
from collections.abc import Iterator
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects
import pytest
from plotly.offline import get_plotlyjs

from ehar.conditions import Conditions
from ehar.data.motion_file import save_motion
from ehar.viewpoint import Workspace
from ehar.world import CROWD
from eval.cli.main import main
from eval.records.contacts import ContactRecords
from eval.records.episodes import EpisodeRecords
from eval.records.one_by_one import OneByOne
from eval.records.run_files import SUMMARY
from eval.reports.page import for_script
from eval.running.run import read_run, write_records
from eval.scores.summary_table import CONTACTS_NOTE
from planners.heuristic import HRotate
from planners.value.model import gain_model_path, save_gain_model
from tests.helpers.commands import fails_with
from tests.helpers.fakes import tiny_data
from tests.helpers.gain_models import model_of, peak_weights
from tests.helpers.made_records import (
    config_of_run,
    flown,
    make_records,
    make_stream_records,
    summary_of,
    three_planners,
)
from tests.helpers.own_recogniser import OWN as RECOGNISER
from tests.helpers.reports import embedded, report_of, tiny_run, written_run
from tests.helpers.tiny_benchmarks import HashedRecogniser, Log
from tests.helpers.tiny_benchmarks import run as run_tiny

HOSTILE = '</script><!--<b>"bad" & {0}'


pytestmark = pytest.mark.usefixtures("fake_weights")


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Return a run and its report, made once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("recognition.storage.load_recogniser", lambda *_, **__: HashedRecogniser())
        run = tiny_run(tmp_path_factory.mktemp("tiny"))
        return run, report_of(run)


def figures_of(report: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield every figure of a report."""
    yield from report["figures"].items()
    for group in report["grouped"].values():
        for name, figures in group.items():
            yield from ((f"{name}: {kind}", figure) for kind, figure in figures.items())


def coloured(value: Any) -> Any:
    """Return a figure with a colour for each token, as the page's script does it."""
    return json.loads(re.sub(r'"@(\d|neutral|text|grid|paper)(/[\d.]+)?"', '"#123456"', json.dumps(value)))


def values(text: str, kind: type) -> Any:
    return np.frombuffer(b64decode(text), dtype=np.dtype(kind).newbyteorder("<"))


def test_one_file_that_needs_no_other(tiny: tuple[Path, str]) -> None:
    _, page = tiny
    assert len(page) < 6_000_000
    own = page.replace(plotly_script(), "")
    assert not re.findall(r"""(?:src|href)=["'](?!#|data:,)""", own)
    assert "http" not in own
    assert "synthetic" in own


def plotly_script() -> str:
    script: str = get_plotlyjs()
    return script


def test_every_figure_is_one_that_plotly_takes(tiny: tuple[Path, str]) -> None:
    report = embedded(tiny[1], "report")
    names = {name for name, _ in figures_of(report)}
    assert names >= {"motion", "time", "predictability", "v-rotate: gains", "oracle: moves", "no-act: sphere"}
    assert "no-act: gains" not in names
    for name, figure in figures_of(report):
        assert "@" not in json.dumps(coloured(figure)).replace("acc@", ""), name
        plotly.graph_objects.Figure(coloured(figure))  # raises where an attribute is unknown
        assert {"title", "gridcolor"} <= figure["layout"]["xaxis"].keys(), name


def test_the_table_is_that_of_the_summary(tiny: tuple[Path, str]) -> None:
    run, page = tiny
    summary = json.loads((run / SUMMARY).read_text())
    rows = re.findall(r"<tr[^>]*><td data-value=.*?</tr>", page)[: len(summary["planners"])]
    for row, planner in zip(rows, summary["planners"], strict=True):
        assert f">{planner['name']}" in row
        assert ('class="slanted"' in row) is planner["privileged"]
        assert f'data-value="{planner["acc_mean"]:.9g}"' in row
    assert "privileged, is handed the label" in page


def test_what_is_replayed_is_what_happened(tiny: tuple[Path, str]) -> None:
    run, page = tiny
    replays = embedded(page, "replays")
    records, workspace = read_run(run).records, Workspace()
    reference = records["oracle"]
    titles = [f"{name} from frame {first}" for name, first in zip(reference.sequence, reference.first, strict=True)]
    assert [note for note in replays["notes"] if "random" in note]  # its draws are those of a whole chunk
    for episode in replays["episodes"]:
        index = episode["episode"]
        assert titles[index] == episode["title"] and f"{episode['title']} (episode {index})</option>" in page
        for name, planner in episode["planners"].items():
            path = values(planner["path"], np.uint16).reshape(-1, 3) / 100
            recorded = records[name].viewpoint[index]
            expected = np.column_stack([recorded[:, 0], np.degrees(recorded[:, 1]) % 360, np.degrees(recorded[:, 2])])
            np.testing.assert_allclose(path, expected, atol=6e-3)
            belief = values(planner["belief"], np.uint16).reshape(10, 3) / 10_000
            np.testing.assert_allclose(belief.max(axis=1), records[name].top_probability[index], atol=1e-3)
            assert belief.argmax(axis=1).tolist() == records[name].predicted[index].tolist()
            assert planner["field"] is None
            assert (planner["target"] is None) is (name == "random")
        target = values(episode["planners"]["v-rotate"]["target"], np.uint16).reshape(-1, 3)
        assert len(target) == 9
        assert (target[:, 2] <= 100 * np.degrees(workspace.polar_max) + 1).all()
        people = values(episode["people"], np.int16).reshape(10, 1, 6, 3)
        assert np.abs(people[0].mean(axis=(0, 1))).max() < 2  # [mm], centred on where people are at first


def test_passers_by_are_replayed_where_they_walk(tiny: tuple[Path, str], tmp_path: Path) -> None:
    assert all(episode["passers"] is None for episode in embedded(tiny[1], "replays")["episodes"])
    replays = embedded(report_of(tiny_run(tmp_path, ("no-act", "h-rotate"), world=CROWD)), "replays")
    for episode in replays["episodes"]:
        bodies = values(episode["passers"], np.int16).reshape(10, CROWD.passers_by, 6, 3) / 1000
        place = bodies[..., :2].mean(axis=2)
        pace = np.linalg.norm(np.diff(place, axis=0), axis=-1) * replays["fps"]
        assert np.linalg.norm(place, axis=-1).max() < CROWD.passing_reach + 0.01
        assert 0.9 < np.median(pace) < 1.7


def test_a_planner_with_a_gain_field_shows_it(tmp_path: Path) -> None:
    best = np.array([10.0, np.pi, np.pi / 3])
    model = gain_model_path(tmp_path, Conditions())
    save_gain_model(model, model_of(peak_weights(best)), recogniser_sha256="fake", history={})
    run = tiny_run(tmp_path, ("no-act", "nbv-greedy"), models=tmp_path)
    replays = embedded(report_of(run), "replays")
    planner = replays["episodes"][0]["planners"]["nbv-greedy"]
    assert replays["episodes"][0]["planners"]["no-act"]["field"] is None
    field = values(planner["field"]["values"], np.uint8).reshape(9, 10, 37)
    assert np.unravel_index(field[-1].argmax(), field[-1].shape) == (6, 18)  # 60 degrees down, 180 around
    assert planner["field"]["low"] < 0 < planner["field"]["high"]


def test_data_that_has_gone_leaves_a_report_without_replays(tmp_path: Path) -> None:
    run = tiny_run(tmp_path)
    (tmp_path / "tiny.npz").unlink()
    log = Log()
    page = report_of(run, log)
    assert "There are no replays" in page
    assert embedded(page, "replays")["episodes"] == []
    assert any("the report has no replays" in note for note in log.notes)


def test_without_data_a_class_that_is_only_answered_is_shown(tmp_path: Path) -> None:
    held = make_records(1)
    records = {"no-act": replace(held, predicted=np.full_like(held.predicted, 4))}
    shown = embedded(report_of(written_run(tmp_path, hover(records))), "report")["grouped"]["focus"]["no-act"]
    assert np.shape(shown["confusion"]["data"][0]["z"]) == (5, 5)


def test_data_that_has_moved_is_found_where_it_lies_now(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("recognition.storage.load_recogniser", lambda *_, **__: HashedRecogniser())
    run = tiny_run(tmp_path)
    moved = (tmp_path / "tiny.npz").rename(tmp_path / "moved.npz")
    main(["report", str(run), "--data", str(moved)])
    capsys.readouterr()
    page = (run / "report.html").read_text(encoding="utf-8")
    assert embedded(page, "replays")["episodes"]
    assert "class 0" not in page
    assert "nowhere.npz" in fails_with(["report", str(run), "--data", "nowhere.npz"], capsys)


def test_names_with_html_are_shown_as_they_are(tmp_path: Path) -> None:
    class Hostile(HRotate):
        name = HOSTILE

    data = replace(tiny_data(sequences=40), class_names=(HOSTILE, "<i>left</i>", "right"))
    save_motion(tmp_path / "tiny.npz", data)
    run = tmp_path / "run"
    run_tiny(["no-act", Hostile()], starts=1, data=tmp_path / "tiny.npz", out=run)
    page = report_of(run)
    body = page.replace(plotly_script(), "")
    assert HOSTILE not in body
    assert "<i>left" not in body
    assert body.count("</script>") == 6
    assert "<!--<b>" not in body
    report = embedded(page, "report")
    assert HOSTILE in report["grouped"]["focus"]
    assert HOSTILE not in json.dumps(report["figures"])  # Plotly takes some HTML for markup
    titles = re.findall(r'<option value="([^"]*)"', page)
    assert HOSTILE in map(unescape, titles)


def test_json_in_a_script_cannot_end_it() -> None:
    text = for_script({"name": HOSTILE})
    assert "<" not in text and ">" not in text
    assert json.loads(text) == {"name": HOSTILE}


def hover(records: dict[str, EpisodeRecords]) -> dict[str, EpisodeRecords]:
    return {name: replace(record, viewpoint=np.tile([6.0, 0.0, 0.0], (9, 4, 1))) for name, record in records.items()}


def lonely(records: dict[str, EpisodeRecords]) -> dict[str, EpisodeRecords]:
    return {name: replace(record, sequence=("only",) * len(record)) for name, record in records.items()}


def one_class(records: dict[str, EpisodeRecords]) -> dict[str, EpisodeRecords]:
    return {
        name: replace(record, label=record.label * 0, predicted=record.predicted * 0)
        for name, record in records.items()
    }


@pytest.mark.parametrize(
    ("records", "told"),
    [
        (lonely(three_planners()), "No intervals can be had: all episodes are windows of one sequence"),
        (one_class(three_planners()), "No intervals can be had: there is one class only"),
        ({"mine": make_records(2), "oracle": make_records(3)}, "Gap closed needs both no-act and oracle"),
        ({"no-act": make_records(1), "mine": make_records(2)}, "Gap closed needs both no-act and oracle"),
        ({"no-act": make_records(1)}, "there is nothing to compare"),
        ({"oracle": make_records(1)}, "there is nobody to compare"),
        ({"mine": make_records(1)}, "There is no pair to compare"),
        (
            {name: flown(record) for name, record in three_planners().items()},
            "Cameras flew, and flights make no moves.",
        ),
        (
            {**three_planners(), "il-ppo/0": make_records(4), "il-ppo/1": make_records(5)},
            "trainings: il-ppo (0, 1)",
        ),
    ],
)
def test_runs_of_every_kind_have_a_report(tmp_path: Path, records: dict[str, EpisodeRecords], told: str) -> None:
    hovering = hover(records)
    track = "px4-max" if any(record.flight is not None for record in records.values()) else "ideal"
    page = report_of(written_run(tmp_path / "run", hovering, track=track))
    assert told in page
    flew = all(record.flight is not None for record in records.values())
    assert ("energy" in embedded(page, "report")["figures"]) == ('data-figure="energy"' in page) == flew
    for _, figure in figures_of(embedded(page, "report")):
        plotly.graph_objects.Figure(coloured(figure))


def test_the_gap_of_a_flight_without_an_oracle_is_that_of_the_ideal_track(tmp_path: Path) -> None:
    on_ideal = {"no-act": make_records(1), "oracle": make_records(2, skill=3.0)}
    records = {"no-act": flown(make_records(1)), "mine": flown(make_records(3, skill=1.0))}
    config = config_of_run(track="px4-auto")
    write_records(tmp_path / "run", config, records, summary_of(records, config, on_ideal=on_ideal))
    page = report_of(tmp_path / "run")
    assert "Gap closed needs" not in page and "100 the oracle on the ideal track." in page


def test_a_camera_that_hit_something_is_told_of(tmp_path: Path) -> None:
    touching = {
        name: replace(record, contacts=ContactRecords(np.full(len(record), 7), np.full(len(record), row)))
        for row, (name, record) in enumerate(hover(three_planners()).items())
    }
    page = report_of(written_run(tmp_path / "run", touching))
    table = page[page.index("Planners and their figures") :]
    assert "frames near" in table and CONTACTS_NOTE in table
    assert all(f'<td data-value="{row * 9}"' in table or f">{row * 9}<" in table for row in (1, 2))


@pytest.mark.parametrize("title", ["tiny (synthetic)", "tiny (synthetic), 3 trainings", "tiny (synthetic), 2 folds"])
def test_motion_that_was_generated_is_never_called_real(tmp_path: Path, title: str) -> None:
    page = report_of(written_run(tmp_path / "run", hover(three_planners()), data=title))
    assert "<strong>synthetic</strong>" in page and "<strong>real</strong>" not in page


@pytest.mark.parametrize("streams", [False, True])
def test_the_memory_of_a_report_does_not_depend_on_the_number_of_planners(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, streams: bool
) -> None:
    """Records are read from disk, and those of few planners are there at a time, however many there are."""
    alive: list[weakref.ref[EpisodeRecords]] = []
    together: list[int] = []
    made = OneByOne.__getitem__

    def counted(self: OneByOne[Any], name: str) -> Any:
        found = made(self, name)
        if isinstance(found, EpisodeRecords) and all(one() is not found for one in alive):
            alive.append(weakref.ref(found))
        together.append(sum(one() is not None for one in alive))
        return found

    records = {f"mine-{number}": make_records(number, skill=number / 2) for number in range(7)}
    if streams:
        labels = np.tile([-1, 0, 0, -1, 1, 1, 1, -1], (9, 1))
        records = {name: make_stream_records(labels, np.roll(labels, at)) for at, name in enumerate(records)}
    run = written_run(tmp_path / "run", records, track="px4-max", fps=4.0)
    monkeypatch.setattr(OneByOne, "__getitem__", counted)
    report_of(run)
    assert len(alive) > 3 * len(records) and max(together) <= 3


def test_trainings_are_one_planner_and_the_first_is_replayed(tmp_path: Path) -> None:
    class Trained(HRotate):
        def __init__(self, seed: int) -> None:
            self.name = f"mine/{seed}"

    run = tiny_run(tmp_path, ("no-act", Trained(0), Trained(1)))
    page = report_of(run)
    assert list(embedded(page, "report")["grouped"]["focus"]) == ["no-act", "mine"]
    replays = embedded(page, "replays")
    assert set(replays["episodes"][0]["planners"]) == {"no-act", "mine"}
    assert "the first training seed is shown" in page
    assert replays["notes"] == ["What mine/0 wanted is not shown: not replayable, as it cannot be made from its name."]


def test_an_own_recogniser_is_made_again(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(RECOGNISER)
    run = tiny_run(tmp_path, ("no-act", "h-rotate"), recogniser=f"{tmp_path / 'mine.py'}:Mine")
    replays = embedded(report_of(run), "replays")
    assert (replays["missing"], replays["notes"]) == (None, [])
    (tmp_path / "mine.py").write_text(RECOGNISER + "# changed\n")
    assert embedded(report_of(run), "replays")["missing"].startswith("config.json: recogniser: got sha256 ")


def test_a_run_that_is_not_finished_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert fails_with(["report", str(tmp_path)], capsys) == (
        f"ehar: error: {tmp_path}/config.json: expected a run of ehar benchmark, got: No such file or directory\n"
    )
    run = written_run(tmp_path / "run", three_planners())
    (run / SUMMARY).unlink()
    assert fails_with(["report", str(run)], capsys).endswith(
        f"{run}: expected a finished run, this one is incomplete: no summary.json\n"
    )


def test_a_summary_of_other_planners_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = written_run(tmp_path / "run", three_planners())
    held = json.loads((run / SUMMARY).read_text())
    held["planners"].pop()
    (run / SUMMARY).write_text(json.dumps(held))
    assert "expected the planners of the records, no-act, mine, oracle, got no-act, mine" in fails_with(
        ["report", str(run)], capsys
    )
    (run / SUMMARY).write_text("[]")
    assert "expected the JSON object of a finished run of ehar benchmark, got []" in fails_with(
        ["report", str(run)], capsys
    )


def test_benchmark_writes_a_report_unless_told_not_to(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_motion(tmp_path / "tiny.npz", tiny_data(sequences=40))
    options = ["benchmark", "no-act", "--data", str(tmp_path / "tiny.npz"), "--length", "10", "--workers", "1"]
    main([*options, "--out", str(tmp_path / "with")])
    assert f"report: {tmp_path / 'with' / 'report.html'}" in capsys.readouterr().out
    assert (tmp_path / "with" / "report.html").is_file()
    main([*options, "--out", str(tmp_path / "without"), "--no-report"])
    assert not (tmp_path / "without" / "report.html").exists()


def test_the_command_writes_the_same_report_each_time(
    tiny: tuple[Path, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run, page = tiny
    main(["report", str(run), "--out", str(tmp_path / "other.html")])
    assert capsys.readouterr().out == f"written to {tmp_path / 'other.html'}\n"
    assert (tmp_path / "other.html").read_text(encoding="utf-8") == page
