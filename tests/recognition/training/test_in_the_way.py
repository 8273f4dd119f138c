"""Things in the way of training clips: where they stand, what they hide, and where there is no room for them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ehar.conditions import Conditions
from ehar.data.motion_data import MotionData
from ehar.data.motion_file import save_motion
from ehar.data.scenario import draw_scenarios, localised
from ehar.data.streams.data import StreamData
from ehar.errors import UsageError
from ehar.obstacles.shapes import MARGIN, Cylinder, Obstacles
from ehar.sensors.perfect import PerfectSensor
from ehar.viewpoint import cartesian
from ehar.world import CROWD, INDOOR, LEAST_REACH, PAPER, PASSER_ROOM, ROOM, World
from recognition.networks.features import JOINT_CHANNELS
from recognition.storage import recogniser_path
from recognition.training import in_the_way, material
from recognition.training.clips import ClipSource
from recognition.training.config import TrainingConfig
from recognition.training.in_the_way import (
    MOST_BOXES,
    MOST_PASSERS,
    MOST_PILLARS,
    SHARE,
    TOGETHER,
    check_room,
    draw_world,
    hide,
)
from recognition.training.trainer import train_recogniser
from tests.helpers.fakes import tiny_data
from tests.helpers.streams import raising_streams

LENGTH = 10
CLIPS = 800


def many_worlds(world: World = PAPER) -> list[World]:
    return [draw_world(world, np.random.default_rng(seed)) for seed in range(300)]


@pytest.mark.parametrize("nearest", [PAPER.workspace.distance_min, LEAST_REACH + PASSER_ROOM])
def test_things_stand_between_people_and_cameras(nearest: float) -> None:
    opened = replace(PAPER, workspace=replace(PAPER.workspace, distance_min=nearest))
    check_room(opened)
    around = np.linspace(0, 2 * np.pi, 90)
    cameras = cartesian(np.stack([np.full(90, nearest), around, np.full(90, np.pi / 2)], axis=-1))
    for world in many_worlds(opened):
        assert world.obstacles.clearance(cameras).min() > MARGIN - 1e-6
        assert replace(world, obstacles=opened.obstacles, passers_by=0) == opened  # all else stays


def test_there_are_as_many_as_it_says() -> None:
    worlds = many_worlds()
    assert {len(world.obstacles.cylinders) for world in worlds} == set(range(1, MOST_PILLARS + 1))
    assert {len(world.obstacles.boxes) for world in worlds} == set(range(MOST_BOXES + 1))
    assert {world.passers_by for world in worlds} == set(range(MOST_PASSERS + 1))
    assert all(world.obstacles.walls is None for world in worlds)  # a wall hides nobody


@pytest.mark.parametrize("data", [tiny_data(frames=LENGTH), raising_streams()])
def test_half_of_the_clips_have_something_in_the_way(data: MotionData | StreamData) -> None:
    rng = np.random.default_rng(0)
    scenarios = localised(draw_scenarios(data, np.arange(len(data.lengths)), LENGTH, rng, CLIPS), PAPER)
    positions = scenarios.positions(np.arange(CLIPS))
    viewpoints = np.repeat(PAPER.sample_starts(rng, CLIPS)[:, None], LENGTH, axis=1)
    hidden = hide(scenarios, PAPER, viewpoints, positions, rng)
    assert hidden.shape == positions.shape[:-1]
    share = hidden.any(axis=(1, 2, 3)).mean()
    assert 0.1 < share < SHARE  # of the half in which things stand, some stand beside the line of sight
    assert 0.02 < hidden.mean() < 0.15


def test_few_clips_see_the_same_things(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[World] = []

    def drawing(world: World, rng: np.random.Generator) -> World:
        drawn.append(draw_world(world, rng))
        return drawn[-1]

    monkeypatch.setattr(in_the_way, "draw_world", drawing)
    rng = np.random.default_rng(0)
    scenarios = draw_scenarios(tiny_data(), np.arange(12), LENGTH, rng, CLIPS)
    viewpoints = np.repeat(PAPER.sample_starts(rng, CLIPS)[:, None], LENGTH, axis=1)
    hide(scenarios, PAPER, viewpoints, scenarios.positions(np.arange(CLIPS)), rng)
    assert len(drawn) == pytest.approx(SHARE * CLIPS / TOGETHER, abs=3)
    assert len({str(world.obstacles) for world in drawn}) > 1


def test_a_camera_inside_a_thing_sees_as_if_it_were_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    overhead = Cylinder(centre=(0.0, 0.0, 5.5), radius=0.5, height=2.0)
    monkeypatch.setattr(
        in_the_way, "draw_world", lambda world, rng: replace(world, obstacles=Obstacles(cylinders=(overhead,)))
    )
    rng = np.random.default_rng(0)
    scenarios = draw_scenarios(tiny_data(), np.arange(12), LENGTH, rng, CLIPS)
    positions = scenarios.positions(np.arange(CLIPS))
    for distance, share in ((5.0, 0.0), (9.0, SHARE)):  # inside it, and above it
        viewpoints = np.broadcast_to([distance, 0.0, 0.0], (CLIPS, LENGTH, 3))
        hidden = hide(scenarios, PAPER, viewpoints, positions, rng)
        assert hidden.any(axis=(1, 2, 3)).mean() == pytest.approx(share, abs=0.06)


def test_what_is_hidden_the_network_does_not_see() -> None:
    options = {"length": LENGTH, "sensor": PerfectSensor(), "views": "moving", "form": "causal", "augment": False}
    unseen = []
    for asked in (False, True):
        source = ClipSource(data=tiny_data(), sequences=np.arange(12), in_the_way=asked, **options)  # type: ignore[arg-type]
        clips = source.draw(np.random.default_rng(0), CLIPS)
        unseen.append(float((clips.features[..., JOINT_CHANNELS - 1] == 0).float().mean()))
    assert unseen[0] == 0
    assert 0.02 < unseen[1] < 0.15


@pytest.mark.parametrize(
    ("world", "message"),
    [
        (ROOM, "--in-the-way: expected an open world, room has obstacles or passers-by of its own"),
        (CROWD, "--in-the-way: expected an open world, crowd has obstacles or passers-by of its own"),
        (
            INDOOR,
            "--in-the-way: expected a world with distance_min of at least 2.55 m, as things stand between people and "
            "cameras; indoor has 1.5 m",
        ),
    ],
)
def test_a_world_without_room_for_them_is_refused(world: World, message: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError) as caught:
        check_room(world)
    assert str(caught.value) == message
    save_motion(tmp_path / "tiny.npz", tiny_data(sequences=24))
    conditions = Conditions(data=str(tmp_path / "tiny.npz"), length=LENGTH, world=world)
    with pytest.raises(UsageError, match="--in-the-way"):
        train_recogniser(TrainingConfig(conditions=conditions, out=tmp_path, in_the_way=True))


def test_weights_say_whether_they_met_any(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(material, "VALIDATION_CLIPS", 24)
    save_motion(tmp_path / "tiny.npz", tiny_data(sequences=24))
    conditions = Conditions(data=str(tmp_path / "tiny.npz"), length=LENGTH)
    runs = {}
    for asked in (False, True):
        out = tmp_path / str(asked)
        config = TrainingConfig(conditions=conditions, out=out, clips=16, batch=8, interval=8, threads=1)
        train_recogniser(replace(config, in_the_way=asked))
        description = recogniser_path(out, conditions).with_suffix(".json")
        runs[asked] = json.loads(description.read_text())["training"]["run"]
    assert "in_the_way" not in runs[False]  # as in files from before there was the choice
    assert runs[True] == {**runs[False], "in_the_way": True}
