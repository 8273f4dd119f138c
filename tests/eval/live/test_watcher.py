"""The watcher: what it recognises is what the benchmark recognises, and no frame can upset it."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.conditions import Conditions
from ehar.errors import DataError, ModelError, UsageError
from ehar.planner import Context, Observation, Planner
from eval import Watcher
from eval.live.messages import read_frame
from eval.live.rehearsal import frame_message
from eval.running.episodes import cut_scenarios, random_starts
from planners.registry import make_planner
from planners.value.stream_belief import StreamBeliefModel, read_streams
from recognition.setting import load_setting
from recognition.storage import SHIPPED
from tests.helpers.live_worlds import FPS, START, frame, person, save_live_world

LENGTH = 45  # frames


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_live_world(tmp_path_factory.mktemp("live"))


def watcher_of(folder: Path, **options: Any) -> Watcher:
    return Watcher(**{"models": folder / "models", "sensor": "perfect", "planner": "no-act", **options})


def at(number: int) -> float:
    return number / FPS


# Targets of `random` jump, and which of several flights arrives first is then a matter of rounding.
@pytest.mark.parametrize(("planner", "apart"), [("no-act", 1e-9), ("h-rotate", 1e-6), ("random", 0.02)])
def test_it_recognises_what_the_benchmark_recognises_and_flies_the_same_way(
    folder: Path, planner: str, apart: float
) -> None:
    told = Conditions(data=str(folder / "raising.npz"), models=folder / "models", track="px4-auto", length=LENGTH)
    setting = load_setting(told)
    episodes = random_starts(cut_scenarios(setting.recordings, np.array([6, 7]), LENGTH, print), 1, 0, setting.world)
    batch = episodes.pick([1])
    model = StreamBeliefModel.believing((0.25,) * 4)
    watcher = watcher_of(folder, planner=planner, belief=model)
    record = setting.runner.roll(make_planner(planner), batch, np.random.default_rng(0))
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
    with pytest.raises(UsageError, match="expected a gain model"):
        watcher_of(folder, planner="nbv")
    with pytest.raises(ModelError, match="belief: expected a belief over 3 activities, got one over 2"):
        watcher_of(folder, belief=StreamBeliefModel.believing((0.4, 0.4, 0.2)))
    (tmp_path / "belief.json").write_text("{}")
    with pytest.raises(ModelError, match=r"belief.json: missing follows, rates"):
        watcher_of(folder, belief=tmp_path / "belief.json")
