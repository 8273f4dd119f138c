"""The watcher: what it recognises is what the benchmark recognises, and no frame can upset it."""

import json
import math
import shutil
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.camera import Camera, project
from ehar.conditions import Conditions
from ehar.errors import DataError, ModelError, UsageError
from ehar.planner import Context, Observation, Planner
from ehar.viewpoint import cartesian
from ehar.world import INDOOR, ROOM
from eval import Watcher
from eval.live.messages import CameraPose, Frame, SeenPerson, read_frame
from eval.live.rehearsal import frame_message
from eval.running.choice import ModelPlace
from eval.running.episodes import cut_scenarios, random_starts
from planners.agents.agent import Agent
from planners.registry import ORACLES, make_planner, planner_names
from planners.value.belief.filters import read_streams
from planners.value.belief.streams import StreamBeliefModel
from recognition.setting import load_setting
from recognition.storage import SHIPPED
from recognition.weight_files import files_sha256
from tests.helpers.agents import save_untrained, untrained_agent
from tests.helpers.fakes import POSE, tiny_data
from tests.helpers.live_worlds import FPS, PEAK, START, frame, person, save_live_world

LENGTH = 45  # frames


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_live_world(tmp_path_factory.mktemp("live"))


def watcher_of(folder: Path, **options: Any) -> Watcher:
    return Watcher(**{"models": folder / "models", "sensor": "perfect", "planner": "no-act", **options})


def at(number: int) -> float:
    return number / FPS


# Targets of `random` jump, and which of several flights arrives first is then a matter of rounding.
@pytest.mark.parametrize(
    ("planner", "apart"),
    [
        ("no-act", 1e-9),
        ("h-rotate", 1e-6),
        ("random", 0.02),
        ("nbv", 1e-6),
        ("fixed-best", 1e-6),
        ("il", 1e-6),  # an agent of the grid
        ("dagger", 1e-6),  # one of flights, which sees its velocity
    ],
)
def test_it_recognises_what_the_benchmark_recognises_and_flies_the_same_way(
    folder: Path, planner: str, apart: float
) -> None:
    told = Conditions(data=str(folder / "raising.npz"), models=folder / "models", track="px4-auto", length=LENGTH)
    setting = load_setting(told)
    episodes = random_starts(cut_scenarios(setting.recordings, np.array([6, 7]), LENGTH, print), 1, 0, setting.world)
    batch = episodes.pick([1])
    model = StreamBeliefModel.believing((0.25,) * 4)
    watcher = watcher_of(folder, planner=planner, belief=model)
    place = ModelPlace.of(setting)
    made = make_planner(planner, place.load_gain_model, place.load_agent, place.load_fixed_place)
    record = setting.runner.roll(made, batch, np.random.default_rng(0))
    there = read_streams(model, record.log_probs, record.viewpoints, fps=FPS)[0]
    assert np.ptp(there, axis=0).max() > 0.05, "something happens"

    viewpoint, believed, flown = batch.starts, [], []
    for number in range(LENGTH):
        sensed = setting.runner.sensor.sense(batch.positions[:, number], viewpoint, batch.noise.frame(number))
        answer = watcher.see(frame_message(sensed, viewpoint, 100 + at(number)))
        believed.append(list(answer.belief.values()))
        flown.append(viewpoint[0])
        assert answer.notes == () and watcher.setpoint() is not None
        viewpoint = watcher.setpoints.state().viewpoint
    np.testing.assert_allclose(believed, there, atol=1e-3)
    np.testing.assert_allclose(flown, record.viewpoints[0], atol=apart)
    assert watcher.counts == {"frames": LENGTH}


def seen_from(viewpoint: FloatArray) -> dict[str, Any]:
    """Return people as the recogniser's camera sees them from somewhere."""
    pixels, _ = project(POSE[None, None], viewpoint[None], Camera())
    return {"keypoints": [[*point, 0.9] for point in pixels[0, 0].tolist()]}


@pytest.mark.parametrize("name", [name for name in planner_names() if name not in ("ppo", "il-ppo")])  # as il
def test_every_planner_without_the_truth_flies_by_its_name(folder: Path, name: str) -> None:
    if name in [oracle.name for oracle in ORACLES]:
        with pytest.raises(UsageError, match="expected one that needs no truth"):
            watcher_of(folder, planner=name)
        return
    watcher = watcher_of(folder, planner=name)
    for number in range(24):
        viewpoint = watcher.setpoints.state().viewpoint[0] if number else START
        answer = watcher.see(frame(at(number), seen_from(viewpoint), viewpoint=viewpoint), newest=number > 2)
        assert not any("failed" in note for note in answer.notes), answer.notes
        setpoint = watcher.setpoint()
    assert answer.target is not None and setpoint is not None
    assert (np.linalg.norm(setpoint.velocity) == 0) == (name == "no-act")
    if name.startswith("nbv"):
        away = np.linalg.norm(cartesian(np.array([START, setpoint.viewpoint])) - cartesian(PEAK), axis=1)
        assert away[1] < away[0]


def test_an_agent_is_the_one_of_its_name_seed_and_vehicle(folder: Path) -> None:
    def agent_of(planner: str, vehicle: str) -> tuple[str, str, bool]:
        made = watcher_of(folder, planner=planner, vehicle=vehicle).planner
        assert isinstance(made, Agent)
        found = [path for path in (folder / "models").glob("agent-*.safetensors") if files_sha256(path) == made.sha256]
        return made.name, found[0].stem, made.network.spec.sizes.flown

    assert agent_of("il", "px4-auto") == ("il", "agent-il-perfect-moving-seed2", False)
    assert agent_of("il/10", "px4-auto") == ("il/10", "agent-il-perfect-moving-seed10", False)
    assert agent_of("dagger", "px4-auto") == ("dagger", "agent-dagger-perfect-moving-px4-auto-seed1", True)
    assert agent_of("dagger", "px4-max") == ("dagger", "agent-dagger-perfect-moving-seed0", False)


def test_agents_that_do_not_fit_are_refused_in_a_line(folder: Path, tmp_path: Path) -> None:
    models = shutil.copytree(folder / "models", tmp_path / "models")
    clips = save_untrained(models, tiny_data(), "ppo", recogniser=watcher_of(folder).recogniser.sha256)
    with pytest.raises(ModelError, match=rf"{clips.name}: trained on clips, expected an agent of streams: train it"):
        watcher_of(folder, models=models, planner="ppo")
    with pytest.raises(ModelError, match=r"agent-il-ppo-perfect-moving-seed3.safetensors: no such file: .* an agent"):
        watcher_of(folder, models=models, planner="il-ppo/3")
    description = models / "agent-il-perfect-moving-seed2.json"
    held = json.loads(description.read_text())
    description.write_text(json.dumps(held | {"recogniser_sha256": "beef" * 16}))
    with pytest.raises(ModelError, match=r"seed2\.safetensors: trained for another recogniser: its sha256 was beef"):
        watcher_of(folder, models=models, planner="il")
    description.write_text(json.dumps(held | {"world": asdict(INDOOR)}))
    with pytest.raises(ModelError, match=r"seed2\.safetensors: trained in the world "):
        watcher_of(folder, models=models, planner="il")
    with pytest.raises(UsageError, match="planner 'il': expected models to be a folder with its weights"):
        watcher_of(folder, planner="il", models=watcher_of(folder).recogniser)
    with pytest.raises(UsageError, match="planner 'il': got an agent of clips, expected one of streams"):
        watcher_of(folder, planner=untrained_agent("il"))


def test_setpoints_keep_the_pace_of_the_clock_at_any_frame_rate(tmp_path: Path) -> None:
    """They come twice a frame at 15 frames a second, and fly no faster than at 30."""
    flown = []
    for fps in (15.0, 30.0):
        watcher = watcher_of(save_live_world(tmp_path / str(fps), fps=fps), planner="h-rotate")
        watcher.see(frame(0.0, person()))
        assert watcher.setpoint_rate == 30
        flown.append([watcher.setpoint() for _ in range(30)][-1])
        slow = watcher_of(tmp_path / str(fps), planner="nbv")  # at 15 it heads for the ends of its plans
        assert slow.see(frame(0.0, person())).target is not None and slow.counts == {"frames": 1}
    one, other = flown
    assert one is not None and other is not None
    assert one.time == other.time == pytest.approx(1)
    np.testing.assert_allclose(one.position, other.position, atol=1e-3)


def test_without_a_belief_the_recogniser_is_believed(folder: Path) -> None:
    watcher = watcher_of(folder)
    for number in range(20):
        answer = watcher.see(frame(at(number), person(600 + 3 * number)))
    assert watcher._recognition is not None
    np.testing.assert_allclose(list(answer.belief.values()), np.exp(watcher._recognition.log_probs[0]), rtol=1e-4)
    assert tuple(answer.belief) == ("nod", "left", "right", "no activity")


def test_a_decision_is_an_activity_that_is_sure(folder: Path) -> None:
    sure, unsure = watcher_of(folder, sure=1e-6), watcher_of(folder, sure=1.0)
    decided = [sure.see(frame(at(number), person(size=30 * number + 20))) for number in range(30)]
    assert {answer.decision for answer in decided} <= {None, "nod", "left", "right"}
    for answer in decided:
        name = max(answer.belief, key=answer.belief.__getitem__)
        assert answer.decision == (None if name == "no activity" else name)
    assert unsure.see(frame(0.0, person())).decision is None


def test_frames_that_are_wrong_are_counted_said_and_do_no_harm(folder: Path) -> None:
    watcher = watcher_of(folder, planner="h-rotate")
    said = [
        watcher.see(frame(0.0, person())).notes,
        watcher.see(frame(0.0, person())).notes,
        watcher.see(frame(at(2), person())).notes,
        watcher.see(frame(at(1), person())).notes,
        watcher.see(frame(at(3))).notes,
        watcher.see(frame(at(4), person(), viewpoint=None)).notes,
        watcher.see(frame(at(5), person(300), person(900))).notes,
        watcher.see(frame(9.0, person())).notes,
        watcher.see(frame(9.0 + at(1), person())).notes,
    ]
    assert [note for notes in said for note in notes] == [
        "doubled",
        "out of order",
        "empty",
        "no camera pose",
        "people left out: 2",
        "empty",
        "began anew",
    ]
    assert watcher.counts["frames"] == 9 and watcher.counts["began anew"] == 1
    for wrong in ("{", {"time": 9.1, "people": [{"keypoints": [[1, 2, 1]]}], "joints": "own"}, {"people": []}):
        with pytest.raises(DataError, match=r"frame: |people: expected 6 keypoints"):
            watcher.see(wrong)
    assert watcher.see(frame(9.0 + at(2), person())).notes == ()


@pytest.mark.parametrize(
    ("wrong", "problem"),
    [
        (
            frame(at(5), {"keypoints": [[1e300, 2.0, 0.9]] * 6}),
            "people: expected keypoints within 1e\\+06 px, got 1e\\+300",
        ),
        (
            frame(at(5), person(), camera={"position": [1e300, 0.0, 1.0]}, viewpoint=None),
            "camera.position: expected 0.1 to",
        ),
        (frame(at(5), person(), origin=[1e300, 0.0, 0.0]), "origin: expected a place within 1e\\+07 m"),
        (Frame(time=at(5), people=(SeenPerson(keypoints=((math.nan, 2.0, 0.9),) * 6),), joints="own"), "px, got nan"),
    ],
    ids=["keypoint", "camera", "origin", "nan"],
)
def test_numbers_that_would_stay_in_the_network_are_refused(
    folder: Path, wrong: dict[str, Any] | Frame, problem: str
) -> None:
    watcher = watcher_of(folder)
    for number in range(5):
        before = watcher.see(frame(at(number), person()))
    with pytest.raises(DataError, match=problem):
        watcher.see(wrong)
    after = watcher.see(frame(at(5), person()))
    assert after.notes == () and list(after.belief.values()) == pytest.approx(list(before.belief.values()), abs=0.2)


def test_frames_from_python_hold_finite_numbers() -> None:
    with pytest.raises(DataError, match="time: expected a finite number, got nan"):
        Frame(time=math.nan)
    with pytest.raises(DataError, match=r"camera.position: expected 0\.1 to 10000 m from the people, got \[nan, "):
        CameraPose(position=(math.nan, 0.0, 1.0))
    with pytest.raises(DataError, match="camera: expected yaw and pitch or none, got inf and 0"):
        CameraPose(position=(6.0, 0.0, 1.0), yaw=math.inf, pitch=0.0)
    near = CameraPose(position=(6.0, 0.0, 1.0))
    assert near.moved((-6.0, 0.0, -1.0)) is near and near.moved((1e9, 0.0, 0.0)) is near


def test_what_is_lost_in_between_is_filled_in(folder: Path) -> None:
    whole, holed = watcher_of(folder), watcher_of(folder)
    for number in range(31):
        moving = frame(at(number), person(500 + 5 * number))  # at a constant speed, so nothing is lost with a frame
        expected = whole.see(moving)
        if number not in (3, 10, 11, 12, 20):
            got = holed.see(moving)
    np.testing.assert_allclose(list(got.belief.values()), list(expected.belief.values()), atol=1e-4)


def test_without_a_pose_the_camera_is_where_it_was_told_to_be(folder: Path) -> None:
    watcher = watcher_of(folder)
    assert watcher.see(frame(0.0, person(), viewpoint=None)).viewpoint is None
    assert watcher.setpoint() is None
    watcher.see(frame(at(1), person()))
    for _ in range(28):
        watcher.setpoints.aim(np.array([12.0, 1.0, 1.2]))
        place = watcher.setpoint()
    answer = watcher.see(frame(at(2), person(), viewpoint=None))
    assert place is not None and answer.viewpoint == pytest.approx(place.viewpoint)
    assert place.viewpoint[0] > START[0] + 0.2


def test_a_camera_is_placed_around_the_people_s_frame_that_is_followed(folder: Path) -> None:
    """What frames say is relative to where people are said to be; what counts is where the vehicle takes them to be."""
    watcher = watcher_of(folder)
    for number in range(30):
        origin = [10.0, 1.2 * at(number), 0.0]
        answer = watcher.see(frame(at(number), person()) | {"origin": origin})
        setpoint = watcher.setpoint()
    assert setpoint is not None and setpoint.centre is not None and answer.viewpoint is not None
    behind = np.subtract(origin, setpoint.centre.position)
    assert 0.1 < behind[1] < 1.2
    np.testing.assert_allclose(cartesian(np.array(answer.viewpoint)), cartesian(START) + behind, atol=0.05)


def test_nothing_flies_until_the_camera_is_in_the_workspace(folder: Path) -> None:
    watcher = watcher_of(folder)
    near = watcher.see(frame(0.0, person(), viewpoint=np.array([2.0, 0.0, 1.0])))
    assert near.notes[0].startswith("camera out of the workspace: ") and near.target is None
    assert watcher.setpoint() is None
    assert sum(near.belief.values()) == pytest.approx(1), "it watches all the same"
    assert watcher.see(frame(at(1), person())).target == pytest.approx(tuple(START))
    assert watcher.setpoint() is not None


class Failing(Planner):
    """Wants one place, and fails from then on."""

    name = "failing"

    def reset(self, context: Context) -> None:
        if getattr(self, "calls", 0) > 30:
            raise ValueError("not again")
        self.calls = 0

    def act(self, observation: Observation) -> FloatArray:
        self.calls += 1
        if self.calls > 30:
            raise ValueError("no idea")
        return np.array([[14.0, 1.0, 1.2]])


def test_a_planner_that_fails_makes_the_vehicle_brake(folder: Path) -> None:
    watcher = watcher_of(folder, planner=Failing())
    for number in range(31):
        answer = watcher.see(frame(at(number), person()))
        setpoint = watcher.setpoint()
    assert answer.notes[0].startswith("planner failed: planner 'failing': ") and "no idea" in answer.notes[0]
    assert answer.target is None and setpoint is not None and setpoint.braking
    for number in range(31, 150):
        watcher.see(frame(at(number), person()))
        setpoint = watcher.setpoint()
    assert setpoint is not None and setpoint.velocity == (0, 0, 0)
    anew = watcher.see(frame(99.0, person()))
    assert "not again" in anew.notes[1] and sum(anew.belief.values()) == pytest.approx(1)


def test_other_orders_of_joints_are_told_by_each_frame(folder: Path) -> None:
    watcher = watcher_of(folder)
    keypoints = [[600.0 + number, 300.0, 0.9] for number in range(17)]
    held = frame(0.0, {"keypoints": keypoints}) | {"joints": "coco17"}
    answer = watcher.see(json.dumps(held))
    assert answer.joints is not None
    np.testing.assert_allclose(answer.joints[0, :4, 0], [600, 605, 606, 611.5])  # head, shoulders, pelvis
    assert read_frame(json.dumps(held)).joints == "coco17"


def test_what_cannot_watch_live_is_refused_in_a_line(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="expected weights that are trained on streams"):
        watcher_of(folder, models=SHIPPED / "solo")
    with pytest.raises(ModelError, match="no such file: expected a recogniser"):
        watcher_of(tmp_path)
    with pytest.raises(UsageError, match="expected one that needs no truth"):
        watcher_of(folder, planner="oracle")
    walled = Path(shutil.copytree(folder / "models", tmp_path / "walled"))
    (told,) = walled.glob("causal-*.json")
    held = json.loads(told.read_text())
    held["spec"]["world"] |= {"name": "walled", "obstacles": asdict(ROOM.obstacles), "passers_by": 0}
    told.write_text(json.dumps(held))
    with pytest.raises(ModelError, match="weights of the world walled, which has obstacles: nobody tells"):
        watcher_of(folder, models=walled)
    alone = tmp_path / "alone"
    alone.mkdir()
    for file in (folder / "models").glob("causal-*"):
        shutil.copy(file, alone)
    with pytest.raises(
        ModelError, match=r"gain-field-perfect-moving\.safetensors: no such file: expected a gain field"
    ):
        watcher_of(folder, models=alone, planner="nbv")
    with pytest.raises(ModelError, match=r"fixed-best-perfect-moving\.json: no such file: expected a fixed place"):
        watcher_of(folder, models=alone, planner="fixed-best")
    with pytest.raises(UsageError, match="planner 'nbv': expected models to be a folder with its weights"):
        watcher_of(folder, planner="nbv", models=watcher_of(folder).recogniser)
    with pytest.raises(ModelError, match="belief: expected a belief over 3 activities, got one over 2"):
        watcher_of(folder, belief=StreamBeliefModel.believing((0.4, 0.4, 0.2)))
    (tmp_path / "belief.json").write_text("{}")
    with pytest.raises(ModelError, match=r"belief.json: missing follows, rates"):
        watcher_of(folder, belief=tmp_path / "belief.json")
