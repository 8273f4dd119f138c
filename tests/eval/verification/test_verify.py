"""A run that is as it was written is verified; what was edited, cut off or moved away is named."""

import json
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ehar.data.motion_file import save_motion
from ehar.errors import EharError, UsageError
from eval.cli.main import main
from eval.records.config import CONFIG, read_config
from eval.records.episode_lines import read_episodes
from eval.records.run_files import EPISODES, SUMMARY, TABLE
from eval.verification.checks import FAILED, OK, UNCHECKED, Verification
from eval.verification.steps import check_steps
from eval.verification.verify import other_versions, verify
from tests.helpers.agents import save_untrained
from tests.helpers.edited_runs import rewrite_figures
from tests.helpers.fakes import tiny_data
from tests.helpers.seeing import Seeing
from tests.helpers.tiny_benchmarks import HashedRecogniser, Log, save_models
from tests.helpers.tiny_benchmarks import run as run_tiny

pytestmark = pytest.mark.usefixtures("fake_weights")


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Return a folder with data, models, a run of everything that there is, and a flight that is compared with it."""
    folder = tmp_path_factory.mktemp("world")
    data = tiny_data(sequences=30)
    save_motion(folder / "tiny.npz", data)
    save_models(folder / "models", recogniser_sha256="fake")
    for seed in (0, 1):
        save_untrained(folder / "models", data, "il-ppo", seed=seed)
    options: Any = {"data": folder / "tiny.npz", "models": folder / "models"}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("recognition.storage.load_recogniser", lambda *_, **__: HashedRecogniser())
        planners = ["no-act", "random", "fixed-best", "nbv", "il-ppo", Seeing(), "oracle"]
        run_tiny(planners, starts=2, out=folder / "run", **options)  # 60 episodes, two chunks
        few = ["no-act", "v-rotate", "oracle"]
        run_tiny(few, starts=1, readout="belief", out=folder / "ideal", **options)
        flight: Any = {"track": "px4-max", "ideal": folder / "ideal"}
        run_tiny(few, starts=1, readout="belief", out=folder / "flight", **flight, **options)
    yield folder


@pytest.fixture
def run(world: Path, tmp_path: Path) -> Path:
    """Return a copy of the run to be edited."""
    return Path(shutil.copytree(world / "run", tmp_path / "run"))


def edit_json(path: Path, edit: Callable[[Any], object]) -> None:
    held = json.loads(path.read_text())
    edit(held)
    path.write_text(json.dumps(held))


def edit_lines(run: Path, edit: Callable[[list[dict[str, Any]]], object]) -> None:
    rows = [json.loads(line) for line in (run / EPISODES).read_text().splitlines()]
    edit(rows)
    (run / EPISODES).write_text("".join(json.dumps(row) + "\n" for row in rows))


def results(found: Verification) -> list[tuple[str, str]]:
    return [(check.name, check.result) for check in found.checks]


def test_a_run_is_verified_and_its_episodes_run_once_more(world: Path) -> None:
    found = verify(world / "run", rerun_episodes=480, reporter=Log())
    assert results(found) == [
        *((name, OK) for name in ("complete", "records", "privileged", "weights named", "steps", "figures")),
        *((name, OK) for name in ("data", "recogniser", "gain model", "fixed place", "agents", "warnings")),
        ("seen again", OK),
        ("moves again", OK),
        ("moves again", UNCHECKED),
        ("table", OK),
    ]
    what = {check.name: check.what for check in found.checks if check.result == OK}
    assert what["complete"] == "schema 2: 8 planners, 60 episodes of each"
    assert what["agents"] == "2 trainings"
    assert what["privileged"].startswith("7 planners with names of ehar are as in ehar; your own are asked when")
    assert what["warnings"] == "no warnings, as the weights say"
    assert what["seen again"].startswith("480 episodes of 8 planners, 480 drawn")
    assert what["moves again"] == f"{7 * 60 * 9} of {7 * 60 * 9} frames of 7 planners"
    assert found.checks[-2].what == "seeing: not replayable, as it cannot be made from its name"
    assert found.difference is None
    assert found.verdict == "verified, but for what was not checked: moves again"
    assert found.notes == ()


def test_nothing_is_run_unless_asked_for(world: Path) -> None:
    log = Log()
    found = verify(world / "run", reporter=log)
    assert found.verdict == "verified" and log.jobs == 0 and len(found.checks) == 13


def test_a_flight_is_compared_with_the_ideal_track_and_flown_once_more(world: Path, tmp_path: Path) -> None:
    found = verify(world / "flight", rerun_episodes=3, reporter=Log())
    assert found.verdict == "verified"
    assert found.checks[-2].what == f"{3 * 30 * 9} of {3 * 30 * 9} frames of 3 planners"
    flight = Path(shutil.copytree(world / "flight", tmp_path / "flight"))
    edit_lines(flight, lambda rows: rows[-1].update(peak_speed=rows[-1]["peak_speed"] / 2))
    found = verify(flight, rerun_episodes=90, reporter=Log())
    # The figures hold the largest peak only.
    assert found.difference is not None and "oracle, episode 29" in found.difference
    assert ": peak_speed: got " in found.difference


def test_how_far_a_flight_was_from_its_paths_is_checked(world: Path, tmp_path: Path) -> None:
    options: Any = {"data": world / "tiny.npz", "models": world / "models", "track": "px4-max"}
    flight = tmp_path / "flight"
    run_tiny(["nbv"], starts=1, out=flight, **options)
    assert verify(flight, rerun_episodes=1, reporter=Log()).verdict == "verified"
    edit_lines(flight, lambda rows: rows[3]["tracking_error"].__setitem__(5, rows[3]["tracking_error"][5] + 0.1))
    rewrite_figures(flight)
    assert verify(flight, reporter=Log()).difference is None
    found = verify(flight, rerun_episodes=30, reporter=Log())
    assert found.difference is not None
    assert "nbv, episode 3 ('sequence-16' from frame 10), frame 5: tracking_error: got 0.1" in found.difference


def test_every_step_is_a_move_of_the_grid(run: Path) -> None:
    def jump(rows: list[dict[str, Any]]) -> None:  # several moves at once
        row = next(row for row in rows if row["planner"] == "random")
        for frame in range(4, 10):
            row["viewpoint"][frame][0] += 0.3 if row["viewpoint"][frame][0] < 14 else -0.3

    edit_lines(run, jump)
    found = verify(run, reporter=Log())
    assert next(check.name for check in found.checks if check.result == FAILED) == "steps"
    assert found.difference is not None
    assert "random, episode 0 ('sequence-15' from frame 0), frame 4: viewpoint: got from [" in found.difference
    assert "expected a move of the grid within 5 to 15 m," in found.difference


@pytest.mark.parametrize(("metres", "limit"), [(0.6, "speed"), (0.05, "acceleration")])
def test_every_step_is_within_the_vehicle_s_limits(world: Path, tmp_path: Path, metres: float, limit: str) -> None:
    flight = Path(shutil.copytree(world / "flight", tmp_path / "flight"))

    def push(rows: list[dict[str, Any]]) -> None:  # no-act's: the camera stands still but for one push
        for viewpoint in rows[0]["viewpoint"][5:]:
            viewpoint[0] += metres if viewpoint[0] < 14 else -metres

    edit_lines(flight, push)
    found = verify(flight, reporter=Log())
    assert next(check.name for check in found.checks if check.result == FAILED) == "steps"
    assert found.difference is not None and f"with {limit} " in found.difference
    assert "no-act, episode 0" in found.difference and " of 'px4-max'" in found.difference


def test_steps_of_a_flight_need_the_frame_rate(world: Path, tmp_path: Path) -> None:
    flight = Path(shutil.copytree(world / "flight", tmp_path / "flight"))
    edit_json(flight / CONFIG, lambda held: held.update(source="gone.npz"))
    found = verify(flight, reporter=Log())
    assert ("steps", UNCHECKED) in results(found)
    config, records = read_config(flight), read_episodes(flight / EPISODES)
    told = replace(config.conditions, fps=25.0)
    assert check_steps(replace(config, conditions=told), records, None).result == OK
    assert check_steps(config, records, 500.0).result == FAILED  # 20 times as fast as it was flown


def test_the_ideal_run_may_lie_elsewhere_but_is_needed(world: Path, tmp_path: Path) -> None:
    flight = Path(shutil.copytree(world / "flight", tmp_path / "flight"))
    edit_json(flight / CONFIG, lambda held: held.update(ideal=str(tmp_path / "gone")))
    with pytest.raises(UsageError, match=r"gone/config\.json: expected a run.*; --ideal says where the run lies now"):
        verify(flight, reporter=Log())
    assert verify(flight, ideal=world / "ideal", reporter=Log()).verdict == "verified"
    edit_json(flight / CONFIG, lambda held: held.pop("ideal"))
    with pytest.raises(UsageError, match="compares flights with a run on the ideal track; expected its folder as --id"):
        verify(flight, reporter=Log())


def test_a_table_says_what_the_figures_say(world: Path, run: Path) -> None:
    path = run / TABLE
    lines = path.read_text().splitlines()
    row = next(number for number, line in enumerate(lines) if line.startswith("| nbv |"))
    better = re.sub(r"\| (\d+\.\d) \|", "| 99.9 |", lines[row], count=1)
    path.write_text("\n".join([*lines[:row], better, *lines[row + 1 :]]) + "\n")
    found = verify(run, reporter=Log())
    assert found.difference == f"table.md: line {row + 1}: got {better!r}, expected {lines[row]!r}"
    edit_json(run / CONFIG, lambda held: held["versions"].update(ehar="0.0.1"))
    assert verify(run, reporter=Log()).verdict == "verified, but for what was not checked: table"
    path.unlink()
    assert verify(run, reporter=Log()).verdict == "verified, but for what was not checked: table"
    path.write_bytes(b"\xff")
    assert str(verify(run, reporter=Log()).difference).startswith("table.md: expected text, got 'utf-8' codec")


EDITS: list[tuple[str, str, Callable[[Any], object], str]] = [
    (
        SUMMARY,
        "figures",
        lambda held: held["planners"][1].update(acc_mean=77.0),
        "planners: random: acc_mean: got 77.0",
    ),
    (SUMMARY, "figures", lambda held: held["differences"].pop(), "differences: got ["),
    (CONFIG, "records", lambda held: held.update(seed=1), "no-act, episode 0 ('sequence-15' from frame 0): start: got"),
    (CONFIG, "records", lambda held: held.update(length=9), "no-act: got episodes of 10 frames, expected 9"),
    (CONFIG, "records", lambda held: held.update(starts=1), "got 60 episodes of each planner, expected 30"),
    (
        CONFIG,
        "records",
        lambda held: held["planners"].pop(1),
        "random: got a planner that is not in config.json, expec",
    ),
    (
        CONFIG,
        "privileged",
        lambda held: held["planners"][-1].update(privileged=False),
        "config.json: oracle: privileged: got False, expected True",
    ),
    (CONFIG, "figures", lambda held: held.update(views="paper"), "summary.json: views: got 'moving', expected 'paper'"),
    (CONFIG, "data", lambda held: held.update(data_sha256="0"), "config.json: data: got sha256 0, expected "),
    (
        CONFIG,
        "recogniser",
        lambda held: held.update(recogniser_sha256="0"),
        "recogniser: got sha256 0, expected fake, w",
    ),
    (CONFIG, "gain model", lambda held: held.update(gain_model_sha256="0"), "gain model: got sha256 0, expected "),
    (
        CONFIG,
        "weights named",
        lambda held: held.update(gain_model_sha256=None),
        "config.json: gain_model_sha256, which nbv",
    ),
    (
        CONFIG,
        "weights named",
        lambda held: held["planners"][4].update(weights_sha256=None),
        "config.json: il-ppo/0: weights_sha256: got none, expected the hash of its weights",
    ),
    (
        CONFIG,
        "fixed place",
        lambda held: held["planners"][2].update(weights_sha256="0"),
        "fixed place: got sha256 0, expected ",
    ),
    (
        CONFIG,
        "agents",
        lambda held: held["planners"][4].update(weights_sha256="0"),
        "config.json: il-ppo/0: weights_sha256: got 0, expected ",
    ),
    (
        EPISODES,
        "records",
        lambda rows: rows[61].update(label=2 - rows[61]["label"]),
        "random, episode 1 ('sequence-15'",
    ),
    (EPISODES, "records", lambda rows: rows[61].update(subjects=[5]), "): subjects: got [5], expected [-1]"),
    (EPISODES, "records", lambda rows: [row.update(subjects=[5, 6]) for row in rows], "subjects: got [5, 6], expected"),
    (EPISODES, "records", lambda rows: rows[61].update(sequence="mine"), "sequence: got mine, expected sequence-15"),
    (
        EPISODES,
        "records",
        lambda rows: rows[3]["viewpoint"][0].__setitem__(0, 5.0),
        "episode 3 ('sequence-16' from fra",
    ),
    (EPISODES, "records", lambda rows: rows[3]["viewpoint"][4].__setitem__(0, 99.0), "frame 4: viewpoint: got [99.0, "),
    (
        EPISODES,
        "records",
        lambda rows: rows[3]["predicted"].__setitem__(5, 7),
        "frame 5: predicted: got 7, expected one ",
    ),
    (
        EPISODES,
        "records",
        lambda rows: rows[3]["true_probability"].__setitem__(9, 0.9999999),
        "true_probability: got 0.9",
    ),
    (
        EPISODES,
        "records",
        lambda rows: rows[3]["second_probability"].__setitem__(9, 0.9999999),
        "second_probability: got 0.9999999, expected at most the top_probability",
    ),
    (
        EPISODES,
        "records",
        lambda rows: rows.__setitem__(slice(0, 2), rows[1::-1]),
        "episode 0 ('sequence-15' from frame ",
    ),
    (
        EPISODES,
        "records",
        lambda rows: [row.pop("start") for row in rows[2:3]],
        "line 3: expected an episode with the f",
    ),
    (EPISODES, "complete", lambda rows: rows.pop(7), "this run is incomplete: no-act has 59 of 60 episodes"),
    (
        EPISODES,
        "complete",
        lambda rows: rows.insert(7, rows[7]),
        "this run is incomplete: random has 60 of 61 episodes",
    ),
    (
        EPISODES,
        "complete",
        lambda rows: rows.__delitem__(slice(60, 120)),
        "this run is incomplete: no episodes of random",
    ),
]


@pytest.mark.parametrize(("file", "name", "edit", "message"), EDITS)
def test_an_edit_is_found_and_named(
    run: Path, file: str, name: str, edit: Callable[[Any], object], message: str
) -> None:
    if file == EPISODES:
        edit_lines(run, edit)
    else:
        edit_json(run / file, edit)
    found = verify(run, rerun_episodes=1, reporter=Log())
    assert next(check.name for check in found.checks if check.result == FAILED) == name
    assert found.difference is not None and message in found.difference
    assert found.verdict == f"not verified: {found.difference}"
    assert not {"seen again", "moves again"} & {check.name for check in found.checks}


def raise_probability(rows: list[dict[str, Any]]) -> None:
    """Let a frame be better than it was, and let the records not contradict themselves."""
    row = rows[60 + 7]
    row["predicted"][4] = row["label"]
    row["true_probability"][4] = row["top_probability"][4] = row["top_probability"][4] / 2 + 0.5


def go_elsewhere(rows: list[dict[str, Any]]) -> None:
    for row in rows[60:120]:  # those of random
        row["viewpoint"] = [row["start"]] * 10


def of_no_act(rows: list[dict[str, Any]]) -> None:
    """Let random be no-act, in all that was seen."""
    rows[60:120] = [{**row, "planner": "random"} for row in rows[:60]]


@pytest.mark.parametrize(
    ("edit", "name", "message"),
    [
        (raise_probability, "seen again", "random, episode 7 ('sequence-18' from frame 10), frame 4: "),
        (go_elsewhere, "seen again", "random, episode "),
        (
            of_no_act,
            "moves again",
            "random, episode 0 ('sequence-15' from frame 0), frame 1: goes elsewhere in ",
        ),
    ],
)
def test_what_only_a_replay_finds(
    run: Path, edit: Callable[[list[dict[str, Any]]], None], name: str, message: str
) -> None:
    edit_lines(run, edit)
    rewrite_figures(run)
    assert verify(run, reporter=Log()).difference is None
    found = verify(run, rerun_episodes=14, reporter=Log())
    assert [check.name for check in found.checks if check.result == FAILED] == [name]
    assert found.difference is not None and message in found.difference


def test_who_is_told_the_truth_is_not_believed(run: Path) -> None:
    for path in (run / CONFIG, run / SUMMARY):
        edit_json(path, lambda held: held["planners"][-1].update(privileged=False))
    rewrite_figures(run)
    found = verify(run, reporter=Log())
    assert [check.name for check in found.checks if check.result == FAILED] == ["privileged"]
    assert found.difference == "config.json: oracle: privileged: got False, expected True"


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({"trained_open": True}, "trained_open: got True, expected False"),
        ({"trained_elsewhere": True}, "trained_elsewhere: got True, expected False"),
        ({"sensor_changed": True}, "sensor_changed: got True, expected False"),
        ({"trained_lengths": {"recogniser": 9}}, "trained_lengths: recogniser: got 9, expected nothing"),
        ({"trained_lengths": {"il-ppo/1": 60}}, "trained_lengths: il-ppo/1: got 60, expected nothing"),
        ({"trained_localisations": {"fixed-best": {}}}, "trained_localisations: fixed-best: got "),
    ],
)
def test_what_readers_are_warned_of_is_not_believed(run: Path, said: dict[str, Any], message: str) -> None:
    edit_json(run / CONFIG, lambda held: held.update(said))
    rewrite_figures(run)
    found = verify(run, reporter=Log())
    assert [check.name for check in found.checks if check.result == FAILED] == ["warnings"]
    assert found.difference is not None and found.difference.startswith(f"config.json: {message}")


def test_a_warning_that_was_taken_out_is_found(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(HashedRecogniser, "data_sha256", "that of other people")
    found = verify(run, reporter=Log())
    assert found.difference == "config.json: trained_elsewhere: got False, expected True"
    edit_json(run / CONFIG, lambda held: held.update(trained_elsewhere=True))
    rewrite_figures(run)
    with monkeypatch.context() as patch:
        patch.setattr(HashedRecogniser.spec, "length", 60)
        found = verify(run, reporter=Log())
    assert found.difference == "config.json: trained_lengths: recogniser: got nothing, expected 60"
    assert verify(run, reporter=Log()).difference is None
    edit_json(run / CONFIG, lambda held: held.pop("trained_lengths"))
    assert ("warnings", UNCHECKED) in results(verify(run, reporter=Log()))


def test_an_incomplete_run_is_called_so(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (run / SUMMARY).unlink()
    assert verify(run, reporter=Log()).verdict == f"not verified: {run}: this run is incomplete: no summary.json"
    (run / SUMMARY).write_text("{")
    assert "not verified: summary.json: expected JSON, got" in verify(run, reporter=Log()).verdict


def test_data_that_lie_elsewhere(run: Path, world: Path, tmp_path: Path) -> None:
    edit_json(run / CONFIG, lambda held: held.update(source=str(tmp_path / "gone.npz")))
    found = verify(run, reporter=Log())
    assert results(found)[6:] == [("data", UNCHECKED), ("weights", UNCHECKED), ("table", OK)]
    assert found.verdict == "verified, but for what was not checked: data, weights"
    assert found.checks[6].what.endswith("; --data says where they lie now")
    assert "their data not at hand" in found.checks[1].what
    with pytest.raises(UsageError, match=r"no episode can be run once more: .*gone\.npz: no such file"):
        verify(run, rerun_episodes=1, reporter=Log())
    moved = shutil.copy(world / "tiny.npz", tmp_path / "moved.npz")
    assert verify(run, data=moved, rerun_episodes=1, reporter=Log()).difference is None
    save_motion(tmp_path / "other.npz", tiny_data(sequences=24))
    other = verify(run, data=tmp_path / "other.npz", reporter=Log())
    assert other.difference is not None and other.difference.startswith("config.json: data: got sha256")
    with pytest.raises(EharError, match=r"absent\.npz: no such file"):
        verify(run, data=tmp_path / "absent.npz", reporter=Log())


def test_without_data_windows_and_starts_are_still_those_of_a_run(run: Path) -> None:
    edit_json(run / CONFIG, lambda held: held.update(source="gone.npz"))

    def twice(rows: list[dict[str, Any]]) -> None:
        for row in rows[1::60] + rows[31::60]:
            row["first"] = 0

    edit_lines(run, twice)
    found = verify(run, reporter=Log())
    assert found.difference is not None
    assert found.difference.endswith(
        "no-act, episode 1 ('sequence-15' from frame 0): got it twice, expected each window once a start"
    )


def test_weights_that_lie_elsewhere(run: Path, world: Path, tmp_path: Path) -> None:
    edit_json(run / CONFIG, lambda held: held.update(models=str(tmp_path / "gone")))
    found = verify(run, rerun_episodes=7, reporter=Log())
    unchecked = {check.name: check.what for check in found.checks if check.result == UNCHECKED}
    assert set(unchecked) == {"gain model", "fixed place", "agents", "moves again"}
    assert unchecked["agents"].startswith("2 of 2: il-ppo/0: ")
    assert found.difference is None
    assert verify(run, models=world / "models", reporter=Log()).verdict == "verified"


def test_other_versions_are_listed(run: Path) -> None:
    edit_json(run / CONFIG, lambda held: held["versions"].update(torch="1.0", jax="0.1"))
    (line,) = verify(run, reporter=Log()).notes
    assert line.startswith("warning: versions are not those of the run: torch 1.0, here 2.")
    assert line.endswith("; jax 0.1, here none")
    assert other_versions({}) != ()


def test_a_belief_is_scored_again(world: Path) -> None:
    found = verify(world / "ideal", rerun_episodes=1, reporter=Log())
    assert found.verdict == "verified"


@pytest.mark.parametrize(
    ("option", "message"), [("rerun_episodes", "at least 0, got -1"), ("seed", "at least 0, got -1")]
)
def test_negative_numbers_are_refused(world: Path, option: str, message: str) -> None:
    options: Any = {option: -1}
    with pytest.raises(UsageError, match=f"{option}: expected {message}"):
        verify(world / "run", reporter=Log(), **options)


def test_the_command_exits_with_0_1_or_2(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["verify", str(run), "--rerun-episodes", "1"])
    printed = capsys.readouterr().out
    assert "figures" in printed and "agents" in printed
    assert printed.splitlines()[-1].startswith("verified")
    edit_json(run / SUMMARY, lambda held: held.update(episodes=61))
    with pytest.raises(SystemExit) as ended:
        main(["verify", str(run)])
    assert ended.value.code == 1
    assert capsys.readouterr().out.splitlines()[-1] == "not verified: summary.json: episodes: got 61, expected 60"
    edit_json(run / CONFIG, lambda held: held.update(schema=0))
    for arguments in ([str(run)], [str(tmp_path / "absent")]):
        with pytest.raises(SystemExit) as ended:
            main(["verify", *arguments])
        assert ended.value.code == 2
        out, line = capsys.readouterr()
        assert (out, line.count("\n")) == ("", 1) and line.startswith("ehar: error: ")
