"""A world with obstacles, end to end with a random network: run, records, verification, and what is refused."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from shutil import copytree
from typing import Any

import numpy as np
import pytest

from ehar import Conditions, EharError
from ehar.data.motion_file import save_motion
from ehar.data.scenario import part_of
from ehar.data.streams.scenario import StreamScenarios
from ehar.sensors.perfect import PerfectSensor
from ehar.viewpoint import cartesian
from ehar.world import CROWD, PAPER, ROOM, load_world
from eval import benchmark, compare, headroom, read_run, verify
from eval.records.contacts import contacts_of
from eval.records.run_files import EPISODES
from eval.running.choice import ModelPlace, choose_planners
from eval.running.run import Run
from planners.value.model import gain_model_path, load_gain_model, save_gain_model
from recognition.environments import make_vector_env
from recognition.networks.features import JOINT_CHANNELS
from recognition.setting import load_setting
from recognition.training.clips import ClipSource
from tests.helpers.commands import fails_with
from tests.helpers.edited_runs import rewrite_figures
from tests.helpers.fakes import tiny_data
from tests.helpers.gain_models import model_of, peak_weights
from tests.helpers.random_networks import save_random_world
from tests.helpers.settings import tiny_conditions
from tests.helpers.tiny_benchmarks import Log

LENGTH = 8
FILE = {
    "distance_min": 5,
    "distance_max": 9,
    "polar_min_deg": 60,
    "polar_max_deg": 95,
    "distance_step": 0.2,
    "angle_step_deg": 7.2,
    "camera": {"width": 320, "height": 240, "focal_length": 300},
}
PILLARS = [{"centre": [x, y, 0], "radius": 1.0, "height": 20} for x, y in ((6.5, 0.0), (-2.5, 0.0), (0.0, 7.0))]
OWN = """
from ehar.sensors.perfect import PerfectSensor
from ehar.motion import GridMotion
from ehar.planner import Planner

class Unaware(PerfectSensor):
    name = "unaware"
    def sense(self, positions, viewpoint, noise):
        return super().sense(positions, viewpoint, noise)

class Reckless(GridMotion):
    def keep_clear(self, surroundings):
        pass

class Circles(Planner):
    name = "circles"
    def reset(self, context):
        pass
    def act(self, observation):
        return observation.viewpoint + [0, 0.2, 0]
"""


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a world with pillars, and weights of the same world without them."""
    folder = tmp_path_factory.mktemp("pillars")
    (folder / "open.json").write_text(json.dumps(FILE), encoding="utf-8")
    inside = {"obstacles": {"cylinders": PILLARS}, "passers_by": 2}
    (folder / "lab.json").write_text(json.dumps(FILE | inside), encoding="utf-8")
    (folder / "own_lab.py").write_text(OWN, encoding="utf-8")
    world = load_world(folder / "open.json")
    save_random_world(folder, LENGTH, world)
    setting = load_setting(tiny_conditions(folder, world=world))
    save_gain_model(
        gain_model_path(folder / "models", Conditions()),
        model_of(peak_weights(np.array([6.0, 1.0, 1.3]))),
        recogniser_sha256=setting.recogniser_sha256,
        history={"length": LENGTH},
        world=world,
    )
    return folder


def told(folder: Path, **changes: Any) -> Conditions:
    return tiny_conditions(folder, **{"length": LENGTH, "world": str(folder / "lab.json"), "starts": 2, **changes})


@pytest.fixture(scope="module")
def log() -> Log:
    return Log()


@pytest.fixture(scope="module")
def run(lab: Path, log: Log) -> Run:
    planners = ["no-act", "random", "h-rotate", "nbv-greedy", "nbv-search", "nbv", "oracle"]
    return benchmark(planners, told(lab), out=lab / "run", reporter=log)


def test_no_camera_comes_too_near_and_the_records_and_the_table_say_so(lab: Path, run: Run) -> None:
    world = load_world(lab / "lab.json")
    for name, records in run.records.items():
        assert (world.obstacles.clearance(cartesian(records.viewpoint)) >= 0.3 - 1e-4).all(), name
        assert records.contacts is not None and records.contacts.near_frames.shape == (len(records),)
    table = run.summary.tables()[0]
    columns = [table.header.index(name) for name in ("frames near", "hit")]
    assert {row[column] for row in table.rows for column in columns} == {"0"}
    assert (np.diff(run.records["h-rotate"].viewpoint, axis=1) != 0).any()


def test_weights_of_the_open_world_will_do_and_that_is_said_aloud(lab: Path, run: Run, log: Log) -> None:
    said = "the recogniser was trained where nothing is in the way; in the world lab something is"
    assert f"warning: {said}" in log.notes
    assert f"Warning: {said}." in run.summary.tables()[0].footnotes
    opened = benchmark(["no-act"], told(lab, world=str(lab / "open.json")), reporter=Log())
    assert not opened.config.warnings and opened.records["no-act"].contacts is None
    assert "frames near" not in opened.summary.tables()[0].header
    assert "near_frames" not in opened.summary.to_json()["planners"][0]


def test_weights_that_met_things_in_the_way_need_no_warning(lab: Path, tmp_path: Path) -> None:
    copytree(lab / "models", tmp_path / "models")
    for description in (tmp_path / "models").glob("causal-*.json"):
        held = json.loads(description.read_text())
        held["training"].setdefault("run", {})["in_the_way"] = True
        description.write_text(json.dumps(held))
    assert load_setting(told(lab)).trained_open
    assert not load_setting(told(lab, models=str(tmp_path / "models"))).trained_open


def test_weights_of_a_world_with_obstacles_are_not_those_of_the_open_one(lab: Path, tmp_path: Path) -> None:
    save_random_world(tmp_path, LENGTH, load_world(lab / "lab.json"))
    load_setting(told(lab, models=str(tmp_path / "models")))
    load_setting(
        told(lab, models=str(tmp_path / "models"), world=replace(load_world(lab / "lab.json"), identity="tracked"))
    )
    with pytest.raises(EharError, match=r"trained in the world lab .* 3 cylinders, 2 passers-by\), asked for open"):
        load_setting(told(lab, models=str(tmp_path / "models"), world=str(lab / "open.json")))
    setting = load_setting(told(lab))
    other = replace(setting.conditions, world=replace(load_world(lab / "lab.json"), passers_by=0))
    assert load_gain_model(other, setting.data, setting.recogniser_sha256)


def test_a_run_among_obstacles_is_verified(lab: Path, run: Run, tmp_path: Path) -> None:
    read = read_run(lab / "run")
    assert read.config == run.config and read.config.world == load_world(lab / "lab.json")
    held = read.records["oracle"].contacts
    assert held is not None and not held.hit_frames.any()
    found = verify(lab / "run", rerun_episodes=8, reporter=Log())
    assert found.difference is None
    assert [check.name for check in found.checks if check.result == "not checked"] == []


def near(row: dict[str, Any], frames: int, hit: int = 0) -> None:
    row |= {"near_frames": frames, "hit_frames": hit}


@pytest.mark.parametrize(
    ("edit", "check", "message"),
    [
        (lambda row: near(row, 2, 3), "records", "hit_frames: got 3, expected at most the 2 near_frames"),
        (lambda row: near(row, 9), "records", "near_frames: got 9, expected at most the 8 frames"),
        (lambda row: near(row, 2), "seen again", "near_frames: got 2, expected 0"),
        (lambda row: near(row, 2, 2), "seen again", "near_frames: got 2, expected 0"),
    ],
)
def test_how_often_a_camera_was_too_near_is_checked(
    lab: Path, run: Run, tmp_path: Path, edit: Callable[[dict[str, Any]], None], check: str, message: str
) -> None:
    copytree(lab / "run", tmp_path / "run")
    rows = [json.loads(line) for line in (tmp_path / "run" / EPISODES).read_text().splitlines()]
    edit(rows[1])
    write_edited(tmp_path / "run", rows)
    found = verify(tmp_path / "run", rerun_episodes=len(rows), reporter=Log())
    assert [one.name for one in found.checks if one.result == "failed"] == [check]
    assert found.difference is not None and found.difference.endswith(message)
    assert "no-act, episode 1 (" in found.difference


def test_no_column_of_too_near_is_taken_out(lab: Path, run: Run, tmp_path: Path) -> None:
    copytree(lab / "run", tmp_path / "run")
    rows = [json.loads(line) for line in (tmp_path / "run" / EPISODES).read_text().splitlines()]
    for row in rows:
        del row["near_frames"], row["hit_frames"]
    write_edited(tmp_path / "run", rows)
    expected = "episodes.jsonl: no-act: near_frames, hit_frames: got none, expected some in the world lab"
    assert verify(tmp_path / "run", reporter=Log()).difference == expected


def write_edited(folder: Path, rows: list[dict[str, Any]]) -> None:
    """Write episodes, and the figures that they give."""
    (folder / EPISODES).write_text("".join(json.dumps(row) + "\n" for row in rows))
    rewrite_figures(folder)


def test_passers_by_hide_people_and_are_the_same_for_all_planners(lab: Path) -> None:
    crowded, opened = (
        benchmark(["no-act", "random"], told(lab, world=world, starts=1), reporter=Log())
        for world in (replace(load_world(lab / "open.json"), passers_by=5), str(lab / "open.json"))
    )
    first = [run.records[name].true_probability[:, 0] for run in (crowded, opened) for name in ("no-act", "random")]
    np.testing.assert_array_equal(first[0], first[1])
    assert (first[0] != first[2]).any()
    assert crowded.records["no-act"].contacts is None  # nothing stands there that a camera could hit


def test_a_run_in_which_passers_by_are_taken_for_people_is_verified(lab: Path, tmp_path: Path) -> None:
    """The same people pass, and hide the same; now some are looked at in place of those that are watched."""
    held = FILE | {"passers_by": 9}
    answers = []
    for identity in ("known", "tracked"):
        (tmp_path / f"{identity}.json").write_text(json.dumps(held | {"identity": identity}), encoding="utf-8")
        conditions = told(lab, world=str(tmp_path / f"{identity}.json"))
        run = benchmark(["no-act", "oracle"], conditions, out=tmp_path / identity, reporter=Log())
        assert verify(tmp_path / identity, rerun_episodes=4, reporter=Log()).difference is None
        title = (tmp_path / identity / "table.md").read_text(encoding="utf-8").splitlines()[0]
        assert ("identity tracked" in title) == (identity == "tracked")
        answers.append(run.records["no-act"].true_probability)
    found = compare(tmp_path / "known", tmp_path / "tracked")
    assert found.differing == {"identity": ("known", "tracked")}
    changed = (answers[0] != answers[1]).any(axis=1)
    assert 0 < changed.sum() < len(changed)


def test_passers_by_whom_cameras_meet_are_kept_clear_of_and_counted(lab: Path, tmp_path: Path) -> None:
    """Cameras are in the way of 40 people; a motion that does not know of them is counted as well."""
    held = FILE | {"passers_by": 40, "passers_reach": 9}
    street, motions = tmp_path / "street.json", tmp_path / "tiny.npz"
    street.write_text(json.dumps(held), encoding="utf-8")
    save_motion(motions, tiny_data(sequences=6, frames=200))
    reckless = f"{lab / 'own_lab.py'}:Reckless"
    found = {}
    for track, length in (("ideal", 200), ("tracking-drone", 100), (reckless, 200)):
        conditions = told(lab, world=str(street), data=str(motions), track=track, length=length)
        run = benchmark(["h-rotate"], conditions, out=tmp_path / Path(track).name, reporter=Log())
        contacts = run.summary.planner("h-rotate").contacts
        assert contacts is not None
        found[track] = contacts.hit_frames, contacts.near_frames
    assert found["tracking-drone"] == found["ideal"] == (0, 0) and found[reckless] > (0, 10)
    assert verify(tmp_path / "ideal", rerun_episodes=4, reporter=Log()).difference is None
    assert "Passers-by walk to where cameras may be" in (tmp_path / "ideal" / "table.md").read_text(encoding="utf-8")


def test_an_own_motion_that_does_not_know_of_obstacles_is_counted(lab: Path) -> None:
    reckless = f"{lab / 'own_lab.py'}:Reckless"
    circles = f"{lab / 'own_lab.py'}:Circles"
    found = benchmark([circles], told(lab, track=reckless, starts=4, length=20), reporter=Log()).summary
    contacts = found.planner("circles").contacts
    assert contacts is not None and contacts.near_frames > contacts.hit_frames > 0


def test_a_vehicle_keeps_clear(lab: Path) -> None:
    found = benchmark(["h-rotate", "nbv", "oracle"], told(lab, track="tracking-drone", length=20), reporter=Log())
    for planner in found.summary.planners:
        assert planner.contacts is not None and planner.contacts.near_frames == 0
        assert planner.flight is not None


@pytest.mark.slow
@pytest.mark.parametrize("name", ["no-act", "nbv"])
def test_in_a_room_a_vehicle_that_follows_people_hits_nothing(name: str) -> None:
    """Each couple walks 3 m another way, and would carry some cameras into walls or pillars."""
    setting = load_setting(Conditions(data="duo-stream", sensor="estimator", world="room", track="px4-auto"))
    data, frames = setting.recordings, 150
    streams = part_of(data, "test")[:6]
    angle = np.repeat(np.arange(len(data.offsets) - 1), np.diff(data.offsets)) * (np.pi / 3)
    walked = np.clip(np.arange(len(angle)) - np.repeat(data.offsets[:-1], np.diff(data.offsets)) - frames, 0, frames)
    way = 3.0 / frames * walked[:, None] * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    walking = replace(data, positions=data.positions + way[:, None, None].astype(np.float32))
    watched = StreamScenarios(walking, frames, streams, np.full(len(streams), frames))
    starts = ROOM.sample_starts(np.random.default_rng(1), len(streams))
    batch = setting.runner.batch(watched, np.arange(len(streams)), starts, np.random.default_rng(2))
    chosen = choose_planners([name], ModelPlace.of(setting), readout="recogniser", note=lambda _: None)
    viewpoints = setting.runner.roll(chosen.planners[0], batch, np.random.default_rng(3)).viewpoints
    assert batch.surroundings is not None
    carried, flown = (
        contacts_of(batch.surroundings, each)
        for each in (np.repeat(starts[:, None], viewpoints.shape[1], axis=1), viewpoints)
    )
    assert carried is not None and (carried.hit_frames > 0).sum() > 1
    assert flown is not None and not flown.hit_frames.any()


def test_environments_follow_the_world(lab: Path) -> None:
    world = load_world(lab / "lab.json")
    env = make_vector_env(4, conditions=told(lab, part="policy", sensor="perfect"))
    missing = 0
    for seed in range(6):
        observations, _ = env.reset(seed=seed)
        for _ in range(LENGTH - 1):
            missing += int((observations["confidence"] == 0).sum())
            observations, *_ = env.step(env.action_space.sample())
            assert (world.obstacles.clearance(cartesian(env.episodes.viewpoint)) >= 0.3 - 1e-6).all()
    assert missing > 0


def test_a_recogniser_learns_with_what_is_hidden_in_its_world(lab: Path) -> None:
    data = load_setting(told(lab)).data
    confidence = {}
    for name in ("lab", "open"):
        world = load_world(lab / f"{name}.json")
        options = {"length": LENGTH, "views": "moving", "form": "causal", "augment": True, "world": world}
        sensor = PerfectSensor(camera=world.camera)
        source = ClipSource(data=data, sequences=np.arange(6), sensor=sensor, **options)
        confidence[name] = source.draw(np.random.default_rng(0), 64).features[..., JOINT_CHANNELS - 1]
    assert (confidence["open"] == 1).all()
    assert 0.02 < float((confidence["lab"] == 0).float().mean()) < 0.5


SCREENS = [  # on all sides of people, and above them
    *(
        {"centre": [2 * x, 2 * y, 0], "size": [4 * abs(y) + 0.2, 4 * abs(x) + 0.2, 8]}
        for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1))
    ),
    {"centre": [0, 0, 3], "size": [4, 4, 0.2]},
]


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"obstacles": {"walls": {"centre": [0, 0, 0], "size": [3, 3, 3]}}}, "expected free space for cameras"),
        (
            {"obstacles": {"cylinders": [{"centre": [0, 0, 0], "radius": 1, "height": 2}]}, "passers_by": -1},
            "passers_by: expected at least 0",
        ),
        ({"obstacles": {"boxes": [{"centre": [0, 0], "size": [1, 1, 1]}]}}, "boxes[0].centre: expected 3 items"),
        ({"obstacles": {"boxes": SCREENS}}, "expected a cell that sees somebody at the centre, they hide everything"),
    ],
)
def test_what_cannot_be_ends_in_one_line_and_exit_code_2(
    lab: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], change: dict[str, Any], complaint: str
) -> None:
    (tmp_path / "bad.json").write_text(json.dumps(FILE | change), encoding="utf-8")
    options = ["--data", str(lab / "tiny.npz"), "--models", str(lab / "models"), "--world", str(tmp_path / "bad.json")]
    assert complaint in fails_with(["benchmark", "no-act", *options, "--length", str(LENGTH)], capsys)


def test_a_sensor_that_cannot_be_told_what_is_hidden_is_refused(lab: Path) -> None:
    unaware = f"{lab / 'own_lab.py'}:Unaware"
    with pytest.raises(EharError, match="sense: expected an argument `hidden`, the joints that are hidden"):
        load_setting(told(lab, sensor=unaware))


def test_headroom_needs_an_open_world(lab: Path) -> None:
    with pytest.raises(EharError, match="expected a world without obstacles, got lab"):
        headroom(told(lab), reporter=Log())


def test_the_worlds_with_obstacles_are_the_paper_s_but_for_these() -> None:
    for world in (ROOM, CROWD):
        assert world.opened.agrees_with(PAPER) and not world.is_open
