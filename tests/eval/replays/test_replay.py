import importlib.util
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from ehar.camera import Camera, project
from ehar.conditions import Conditions
from ehar.errors import UsageError
from eval.cli.main import main
from eval.records.run_files import SUMMARY
from eval.replays.choice import choose_episodes
from eval.replays.episode import MAP_AZIMUTHS, map_polars, replay_episode
from eval.replays.replay import TELLING, _choose, make_replay
from eval.running.run import read_run
from eval.verification.inputs import check_inputs
from planners.heuristic import HRotate
from planners.value.model import gain_model_path, save_gain_model
from tests.helpers.commands import fails_with
from tests.helpers.fakes import CLASS_NAMES
from tests.helpers.gain_models import model_of, peak_weights
from tests.helpers.made_records import make_records
from tests.helpers.own_recogniser import OWN as RECOGNISER
from tests.helpers.reports import tiny_run, written_run
from tests.helpers.tiny_benchmarks import HashedRecogniser, Log

TWO = "--planners: expected one or two different planners"
BEST = np.array([10.0, np.pi, np.pi / 3])


pytestmark = pytest.mark.usefixtures("fake_weights")


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a run with a planner that has a gain field, made once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("recognition.storage.load_recogniser", lambda *_, **__: HashedRecogniser())
        directory = tmp_path_factory.mktemp("tiny")
        model = gain_model_path(directory, Conditions())
        save_gain_model(model, model_of(peak_weights(BEST)), recogniser_sha256="fake", history={})
        return tiny_run(directory, ("no-act", "v-rotate", "nbv-greedy", "oracle"), models=directory)


def test_what_is_shown_is_what_was_recorded(tiny: Path) -> None:
    run = read_run(tiny)
    replay = replay_episode(
        run, check_inputs(run.config, None, None), 5, ["nbv-greedy", "no-act"], advance=lambda _: None
    )
    assert (replay.index, set(replay.labels)) == (5, {run.records["no-act"].label[5]})
    assert replay.class_names == CLASS_NAMES
    assert replay.frames == 10
    for camera in replay.cameras:
        recorded = run.records[camera.name]
        np.testing.assert_allclose(camera.path, recorded.viewpoint[5])
        assert camera.probabilities.argmax(axis=1).tolist() == recorded.predicted[5].tolist()
        pixels, _ = project(replay.positions, camera.path, Camera())
        np.testing.assert_allclose(camera.joints_2d, pixels, atol=0.01)
        assert camera.seen.all()
    greedy, still = replay.cameras
    assert still.gain is None and all(still.wanted(frame) is None for frame in range(10))
    assert greedy.gain is not None and greedy.target is not None
    for gain in greedy.gain:
        polar, azimuth = np.unravel_index(gain.argmax(), gain.shape)
        assert (MAP_AZIMUTHS[azimuth], map_polars()[polar]) == (180, 60)
    wanted = greedy.wanted(3)
    assert wanted is not None and wanted == pytest.approx(greedy.path[4], abs=1e-5)  # the grid goes where it is told
    assert greedy.wanted(9) is None


def test_by_default_the_lead_is_shown_beside_no_act(tiny: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["replay", str(tiny), "3"])
    accuracy = {
        planner["name"]: planner["acc_mean"] for planner in json.loads((tiny / SUMMARY).read_text())["planners"]
    }
    lead = max(("v-rotate", "nbv-greedy"), key=lambda name: accuracy[name])
    path = tiny / "replay-3.mp4"
    assert b"ftyp" in path.read_bytes()[:16]
    first, second = capsys.readouterr().out.splitlines()[:2]
    assert first == f"episode 3, {lead} and no-act; {lead} is the most accurate planner that moves, without the truth"
    assert second == f"written to {path}"


def test_telling_episodes_are_the_first_of_a_report(tiny: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eval.replays.replay.write_film", lambda *_: None)
    chosen = choose_episodes(read_run(tiny).records, "v-rotate", "no-act")  # as a report does where v-rotate leads
    for word, told in zip(TELLING, chosen, strict=False):
        written = make_replay(tiny, word, planners=["v-rotate", "no-act"], reporter=Log())
        assert (written.episode, *written.why) == told


def test_a_gif_of_one_planner_has_all_frames(tiny: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.gif"
    main(["replay", str(tiny), "0", "--planners", "oracle", "--out", str(path), "--slower", "2"])
    with Image.open(path) as film:
        assert film.size == (1280, 720)
        assert film.info["duration"] == 80  # 25 frames a second, half as fast
        assert film.n_frames == 10  # type: ignore[attr-defined]


def test_rerun_writes_a_recording_beside_the_run(tiny: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    main(["replay", str(tiny), "1", "--planners", "nbv-greedy", "v-rotate", "--rerun"])
    assert capsys.readouterr().out == f"episode 1, nbv-greedy and v-rotate\nwritten to {tiny / 'replay-1.rrd'}\n"
    assert (tiny / "replay-1.rrd").read_bytes()[:4] == b"RRF2"


def test_a_planner_that_cannot_be_asked_again_is_shown_without_its_targets(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Mine(HRotate):
        name = "mine"

    run, log = tiny_run(tmp_path, ("no-act", Mine())), Log()
    monkeypatch.setattr("eval.replays.replay.write_film", lambda *_: None)
    make_replay(run, 0, planners=["mine"], reporter=log)
    held = read_run(run)
    replay = replay_episode(held, check_inputs(held.config, None, None), 0, ["mine"], advance=lambda _: None)
    assert replay.cameras[0].target is None
    assert [note for note in log.notes if note.startswith("What mine wanted is not shown: not replayable")]


def test_of_several_trainings_the_first_is_shown(tmp_path: Path) -> None:
    records = {name: make_records(seed) for seed, name in enumerate(("no-act", "il/1", "il/0"))}
    run = read_run(written_run(tmp_path, records, planners=()))
    assert [run.record_name(name) for name in ("il", "il/1", "no-act")] == ["il/0", "il/1", "no-act"]
    with pytest.raises(UsageError, match="no planner 'il/2'; expected one of: no-act, il, il/1, il/0"):
        run.record_name("il/2")


def test_data_that_has_moved_has_to_be_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = tiny_run(tmp_path, ("no-act",))
    moved = (tmp_path / "tiny.npz").rename(tmp_path / "moved.npz")
    line = fails_with(["replay", str(run), "0"], capsys)
    assert line.startswith(f"ehar: error: {tmp_path / 'tiny.npz'}: no such file; ")
    assert line.endswith("; --data says where they lie now\n")
    assert not list(run.glob("*replay*"))
    main(["replay", str(run), "0", "--data", str(moved), "--out", str(tmp_path / "a.gif")])
    assert (tmp_path / "a.gif").is_file()


def test_an_own_recogniser_is_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine.py").write_text(RECOGNISER)
    run = tiny_run(tmp_path, ("no-act",), recogniser=f"{tmp_path / 'mine.py'}:Mine")
    films: list[int] = []
    monkeypatch.setattr("eval.replays.replay.write_film", lambda draw, frames, *_: films.append(frames))
    make_replay(run, 0, reporter=Log())
    assert films == [10]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["40"], "episode: expected 0 to 39, or gain, loss, typical, got 40"),
        (["first"], "episode: expected 0 to 39, or gain, loss, typical, got 'first'"),
        (["gain", "--planners", "oracle"], "episode: gain compares two planners, got oracle alone"),
        (["0", "--out", "a.avi"], "a.avi: expected a film that ends in .mp4 or .gif"),
        (["0", "--out", "a.rrd"], "a.rrd: expected a film that ends in .mp4 or .gif"),
        (["0", "--out", "/absent/a.gif"], "/absent/a.gif: expected a file in a folder that is there, /absent is not"),
        (["0", "--slower", "0"], "--slower: expected a number above 0, and at most 1000, got 0"),
        (["0", "--slower", "nan"], "--slower: expected a number above 0, and at most 1000, got nan"),
        (["0", "--slower", "1e9"], "--slower: expected a number above 0, and at most 1000, got 1e+09"),
        (["0", "--since", "nan"], "--since, --until: expected two times from 0 to 0.4 s, got nan and 0.4"),
        (
            ["0", "--since", "0", "--until", "nan"],
            "--since, --until: expected two times from 0 to 0.4 s, got 0 and nan",
        ),
        (["0", "--planners", "oracle", "no-act", "v-rotate"], f"{TWO}, got oracle, no-act, v-rotate"),
        (["0", "--planners", "oracle", "oracle"], f"{TWO}, got oracle, oracle"),
        (["0", "--planners", "nbv"], "no planner 'nbv'; expected one of: no-act, v-rotate, nbv-greedy, oracle"),
    ],
)
def test_bad_input_ends_in_one_line(
    tiny: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    line = fails_with(["replay", str(tiny), *arguments], capsys)
    assert line.removeprefix("ehar: error: ").removeprefix(f"{tiny}: ") == f"{message}\n"


def test_without_rerun_it_says_so_before_any_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    find: Any = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *rest: None if name == "rerun" else find(name, *rest))
    line = fails_with(["replay", str(tmp_path / "absent"), "0", "--rerun"], capsys)
    told = "--rerun: expected rerun-sdk to be installed, it is not: pip install -e '.[rerun]' adds it"
    assert line == f"ehar: error: {told}\n"


def test_the_typical_episode_is_one_of_three() -> None:
    few: Any = SimpleNamespace(records={name: make_records(seed, episodes=2) for seed, name in enumerate(("a", "b"))})
    assert _choose(few, "loss", ("a", "b")).why.startswith("a loses most against b")
    with pytest.raises(UsageError, match="episode: typical needs 3 episodes to choose from, the run has 2"):
        _choose(few, "typical", ("a", "b"))
