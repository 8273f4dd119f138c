"""A world from a file, end to end with a random network: run, records, verification, report; and what is refused."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from ehar import Camera, Conditions, EharError, World
from ehar.data.skeleton_tree import parents
from ehar.sensors.perfect import PerfectSensor
from ehar.world import INDOOR, PAPER, load_world
from eval import benchmark, headroom, read_run, verify
from eval.running.run import Run
from planners.value.model import gain_model_path, load_gain_model, save_gain_model
from recognition.environments import make_vector_env
from recognition.networks.features import features
from recognition.setting import load_setting
from tests.helpers.gain_models import model_of, peak_weights
from tests.helpers.random_networks import save_random_world
from tests.helpers.settings import tiny_conditions
from tests.helpers.tiny_benchmarks import Log

LENGTH = 6
LAB = {
    "distance_min": 1.5,
    "distance_max": 3.33,
    "polar_min_deg": 41,
    "polar_max_deg": 95,
    "distance_step": 0.1,
    "angle_step_deg": 7.2,
    "camera": {"width": 320, "height": 240, "focal_length": 300},
}


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a world file, data, and a random recogniser and gain field of that world."""
    folder = tmp_path_factory.mktemp("lab")
    (folder / "lab.json").write_text(json.dumps(LAB), encoding="utf-8")
    world = load_world(folder / "lab.json")
    save_random_world(folder, LENGTH, world)
    setting = load_setting(tiny_conditions(folder, world=world))
    save_gain_model(
        gain_model_path(folder / "models", Conditions()),
        model_of(peak_weights(np.array([2.0, 1.0, 1.5]))),
        recogniser_sha256=setting.recogniser_sha256,
        history={"length": LENGTH + 4},
        world=world,
    )
    return folder


def told(folder: Path, **changes: Any) -> Conditions:
    return tiny_conditions(folder, **{"length": LENGTH, "world": str(folder / "lab.json"), **changes})


@pytest.fixture(scope="module")
def run(lab: Path) -> Run:
    return benchmark(["no-act", "random", "nbv-search"], told(lab), out=lab / "run", reporter=Log())


def test_cameras_are_in_the_world_of_the_file(lab: Path, run: Run) -> None:
    world = load_world(lab / "lab.json")
    for records in run.records.values():
        assert world.workspace.contains(records.viewpoint, tolerance=1e-6).all()
        cells = world.workspace.to_cells(records.viewpoint)
        np.testing.assert_allclose(world.workspace.from_cells(cells), records.viewpoint, atol=1e-6)
    assert (np.diff(run.records["random"].viewpoint, axis=1) != 0).any()
    assert "world lab" in str(run.summary)


def test_a_run_holds_its_world_and_is_verified_without_the_file(lab: Path, run: Run, tmp_path: Path) -> None:
    (lab / "lab.json").rename(tmp_path / "gone.json")
    try:
        read = read_run(lab / "run")
        assert read.config == run.config
        assert isinstance(read.conditions.world, World) and read.conditions.world.name == "lab"
        found = verify(lab / "run", rerun_episodes=1, reporter=Log())
        assert found.difference is None
        assert [check.name for check in found.checks if check.result == "not checked"] == []
    finally:
        (tmp_path / "gone.json").rename(lab / "lab.json")


def test_a_camera_outside_of_its_world_is_found(lab: Path, run: Run, tmp_path: Path) -> None:
    held = json.loads((lab / "run" / "config.json").read_text(encoding="utf-8"))
    held["world"]["workspace"]["distance_max"] = 2.0
    for name in ("episodes.jsonl", "summary.json"):
        (tmp_path / name).write_bytes((lab / "run" / name).read_bytes())
    (tmp_path / "config.json").write_text(json.dumps(held), encoding="utf-8")
    found = verify(tmp_path, reporter=Log())
    assert found.difference is not None


@pytest.mark.parametrize(
    ("world", "asked"),
    [("paper", r"asked for paper \(5 to 15 m"), ("indoor", r"asked for indoor \(1.5 to 4 m")],
)
def test_weights_of_another_world_are_refused_in_one_line(lab: Path, world: str, asked: str) -> None:
    with pytest.raises(
        EharError, match=rf"trained in the world lab \(1.5 to 3.33 m.*{asked}.*--world {world}"
    ) as error:
        load_setting(told(lab, world=world))
    assert "\n" not in str(error.value)


def test_shipped_weights_are_of_the_paper_s_world() -> None:
    with pytest.raises(EharError, match=r"trained in the world paper .* asked for indoor"):
        load_setting(Conditions(data="duo", world="indoor"))


def test_a_gain_field_of_another_world_is_refused(lab: Path) -> None:
    setting = load_setting(told(lab))
    elsewhere = replace(setting.conditions, world=replace(INDOOR, name="elsewhere"))
    with pytest.raises(EharError, match=r"gain-field.*trained in the world lab .* asked for elsewhere"):
        load_gain_model(elsewhere, setting.data, setting.recogniser_sha256)


def test_another_length_is_said_aloud_and_in_the_table(lab: Path) -> None:
    log = Log()
    run = benchmark(["no-act", "nbv-search"], told(lab, length=5), reporter=log)
    said = "episodes have 5 frames, but weights were trained at another length: recogniser at 6, gain field at 10"
    assert f"warning: {said}" in log.notes
    assert said in " ".join(run.summary.tables()[0].footnotes)
    log = Log()
    run = benchmark(["no-act"], told(lab), reporter=log)
    assert not any("trained at" in note for note in (*log.notes, *run.summary.tables()[0].footnotes))


def test_a_sensor_with_another_camera_is_refused_and_one_with_the_world_s_runs(lab: Path) -> None:
    with pytest.raises(EharError, match=r"camera: expected that of the world lab, 320 x 240 px, .* got 1280 x 720 px"):
        load_setting(told(lab, sensor=PerfectSensor()))
    camera = Camera(320, 240, 300)
    assert load_setting(told(lab, sensor=PerfectSensor(camera=camera))).runner.sensor.camera == camera


def test_the_recogniser_reads_pixels_as_its_world_s_camera_takes_them(lab: Path) -> None:
    setting = load_setting(told(lab))
    rng = np.random.default_rng(0)
    positions, viewpoint = rng.normal(0, 0.3, (4, 1, 6, 3)), setting.world.sample_starts(rng, 4)
    recogniser = setting.runner.recogniser
    joints = PerfectSensor(camera=setting.world.camera).sense(positions, viewpoint, None)  # type: ignore[arg-type]
    seen = recogniser._features(joints, viewpoint)  # type: ignore[attr-defined]
    sensed = (torch.from_numpy(joints.joints_2d), torch.from_numpy(joints.confidence))
    distance = torch.from_numpy(viewpoint[:, 0].astype(np.float32))
    parent = torch.from_numpy(parents(setting.data.skeleton))
    expected, other = (features(*sensed, distance, parent, camera) for camera in (setting.world.camera, Camera()))
    torch.testing.assert_close(seen, expected)
    assert not torch.allclose(seen, other, atol=0.1)


def test_environments_and_headroom_follow_the_world(lab: Path) -> None:
    env = make_vector_env(4, conditions=told(lab, part="policy"))
    env.reset(seed=0)
    space = load_world(lab / "lab.json").workspace
    for _ in range(LENGTH - 1):
        env.step(env.action_space.sample())
        assert space.contains(env.episodes.viewpoint).all()
    found = headroom(told(lab), azimuths=2, polars=2, reporter=Log())
    assert found.distance == pytest.approx((1.5 + 3.33) / 2)
    assert space.contains(found.viewpoints).all()
    assert math.degrees(found.viewpoints[0, 0, 2]) == pytest.approx(41)


def test_the_paper_s_world_is_recorded_as_such(tmp_path: Path) -> None:
    save_random_world(tmp_path, LENGTH)
    run = benchmark(["no-act"], tiny_conditions(tmp_path, length=LENGTH), out=tmp_path / "run", reporter=Log())
    assert run.conditions.world == "paper"
    held = json.loads((tmp_path / "run" / "config.json").read_text(encoding="utf-8"))
    del held["world"]
    del held["trained_lengths"]  # a run from before there were worlds
    (tmp_path / "run" / "config.json").write_text(json.dumps(held), encoding="utf-8")
    assert read_run(tmp_path / "run").config.world == PAPER
