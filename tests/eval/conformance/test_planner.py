"""The conformance kit of planners finds what is wrong, and nothing where nothing is."""

import random
import re
import sys
import threading
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.conditions import Conditions
from ehar.planner import Context, Observation, Planner
from eval import check_planner
from eval.conformance.checks import Conformance
from planners.registry import make_planner, planner_names
from tests.helpers.agents import untrained_agent
from tests.helpers.fakes import tiny_data
from tests.helpers.fixed_places import fixed_place
from tests.helpers.gain_models import model_of, peak_weights

pytestmark = pytest.mark.usefixtures("fake_weights")


def checked(planner: str | Planner, **options: Any) -> Conformance:
    return check_planner(planner, Conditions(data=tiny_data(**options)))


class Still(Planner):
    name = "still"

    def reset(self, context: Context) -> None:
        self.context = context

    def act(self, observation: Observation) -> FloatArray:
        return observation.viewpoint


class Mean(Still):
    def act(self, observation: Observation) -> FloatArray:
        return observation.viewpoint + observation.log_probs.mean()


class Ranked(Still):
    def act(self, observation: Observation) -> FloatArray:
        target: FloatArray = observation.viewpoint + np.arange(len(observation.viewpoint))[:, None]
        return target


class InPlace(Still):
    def act(self, observation: Observation) -> FloatArray:
        observation.viewpoint[:, 1] += 0.1
        return observation.viewpoint


class Unseeded(Still):
    def act(self, observation: Observation) -> FloatArray:
        return observation.viewpoint + random.random()


class Counting(Still):
    def __init__(self) -> None:
        self.calls = 0

    def act(self, observation: Observation) -> FloatArray:
        self.calls += 1
        return observation.viewpoint + self.calls


class SeededOnce(Still):
    def __init__(self) -> None:
        self.rng = np.random.default_rng(0)

    def act(self, observation: Observation) -> FloatArray:
        return observation.viewpoint + self.rng.normal()


class DrawsInDoubt(Still):
    def act(self, observation: Observation) -> FloatArray:
        doubtful = observation.viewpoint[:, 1] < np.pi
        target = observation.viewpoint.copy()
        target[doubtful] += self.context.rng.normal(size=(int(doubtful.sum()), 3))
        return target


class PeeksAtLabels(Still):
    def act(self, observation: Observation) -> FloatArray:
        frame = sys._getframe()
        while "batch" not in frame.f_locals:
            assert frame.f_back is not None
            frame = frame.f_back
        target: FloatArray = observation.viewpoint + frame.f_locals["batch"].labels[:, None]
        return target


class PeeksAtJoints(PeeksAtLabels):
    def act(self, observation: Observation) -> FloatArray:
        frame = sys._getframe()
        while "batch" not in frame.f_locals:
            assert frame.f_back is not None
            frame = frame.f_back
        target: FloatArray = observation.viewpoint + frame.f_locals["batch"].positions[:, -1, 0, 0]
        return target


class Remembers(Still):
    """Knows episodes again by their first frame, and goes where people ended when it saw them before."""

    def __init__(self) -> None:
        self.ends: dict[bytes, FloatArray] = {}

    def act(self, observation: Observation) -> FloatArray:
        if observation.frame == 0:
            self.key = observation.joints_2d.tobytes()
            self.remembered = self.ends.get(self.key)
        self.ends[self.key] = observation.joints_2d[:, 0, 0, :1] / 1000
        if self.remembered is None:
            return observation.viewpoint
        return observation.viewpoint + self.remembered


class Tape(Still):
    """Reads ahead: the next frame's joints, from the episodes that are being run."""

    def act(self, observation: Observation) -> FloatArray:
        frame = sys._getframe()
        while "batch" not in frame.f_locals:
            assert frame.f_back is not None
            frame = frame.f_back
        here, there = (frame.f_locals["batch"].positions[:, observation.frame + step] for step in (0, 1))
        target: FloatArray = observation.viewpoint + (there - here).mean(axis=(1, 2))
        return target


class Squeezing(Still):
    def act(self, observation: Observation) -> FloatArray:
        return observation.viewpoint.squeeze()


class Lost(Still):
    def act(self, observation: Observation) -> FloatArray:
        return observation.viewpoint * np.where(observation.frame == 3, np.nan, 1)


class Broken(Still):
    def act(self, observation: Observation) -> FloatArray:
        return observation.viewpoint[:, 7]


class Leaving(Still):
    def act(self, observation: Observation) -> FloatArray:
        sys.exit(0)  # without a word, and a shell would take it for a pass


class LongSighted(Still):
    def reset(self, context: Context) -> None:
        self.pace = 1 / (context.length - 2)


class Locked(Still):
    def __init__(self) -> None:
        self.lock = threading.Lock()


ROWS = "rows alone, and in another order, are told the same"
DEFECTS = [
    (Mean(), "no row looks at another", r"row 0 after frame 0: \[.*\] beside some episodes, \[.*\] beside others"),
    (Ranked(), ROWS, r"target of row 0 after frame 0: \[.*\] in a batch of 7, \[.*\] in another order$"),
    (InPlace(), "leaves what it is shown as it is", r"observation.viewpoint changed in frame 0$"),
    (Unseeded(), "does the same with the same generator", r"row 0 .*: \[.*\] at first, \[.*\] the second time"),
    (Counting(), "forgets all in reset", r"row 0 .* when new, \[.*\] after it ran other episodes"),
    (SeededOnce(), "forgets all in reset", r"after it ran other episodes"),
    (DrawsInDoubt(), "no row looks at another", r"beside others"),
    (PeeksAtLabels(), "the hidden truth changes nothing", r"\] at first, \[.*\] with other labels and 3D joints"),
    (PeeksAtJoints(), "the hidden truth changes nothing", r"with other labels and 3D joints"),
    (Remembers(), "forgets all in reset", r"when new, \[.*\] after it ran the same episodes$"),
    (Tape(), "the future changes nothing", r"row 0 after frame 10: .* with another future"),
    (PeeksAtJoints(), "the future changes nothing", r"row 0 after frame 0: .* with another future"),
    (
        Squeezing(),
        "answers a batch of 1 with finite targets (1, 3)",
        r"of shape \(1, 3\), or paths \(1, F, 3, 3\), got \(3,\)$",
    ),
    (Lost(), "answers a batch of 7 with finite targets (7, 3)", r"frame 3: expected a finite target .* \[nan"),
    (Broken(), "answers a batch of 7 with finite targets (7, 3)", r"IndexError: .*test_planner.py, line \d+"),
    (Leaving(), "answers a batch of 7 with finite targets (7, 3)", r"SystemExit: 0 \(.*test_planner.py, line \d+"),
    (LongSighted(), "runs episodes of 1 and of 2 frames", r"'still', reset: ZeroDivisionError: .*, line \d+\)$"),
    (Locked(), "can be sent to a worker process", r"TypeError: cannot pickle '_thread.lock' object"),
]  # fmt: skip


@pytest.mark.parametrize(("planner", "name", "got"), DEFECTS, ids=[type(defect[0]).__name__ for defect in DEFECTS])
def test_what_is_wrong_is_found_and_said(planner: Planner, name: str, got: str) -> None:
    found = checked(planner)
    assert not found.passed
    failed = {check.name: check for check in found.failed}
    assert name in failed
    assert re.search(got, failed[name].got)
    assert failed[name].expected
    assert failed[name].mend
    if type(planner) in (Mean, PeeksAtLabels, PeeksAtJoints, Squeezing, Tape):
        assert 1 <= len(failed) <= 4
    else:
        assert len(failed) == 1, "and nothing else"


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name == "nbv" else name for name in planner_names()]
)
def test_our_planners_pass(name: str) -> None:
    model = model_of(peak_weights(np.array([8.0, 1.0, 1.2])))
    found = checked(make_planner(name, lambda: model, untrained_agent, fixed_place))
    assert found.passed, str(found)
    unchecked = {check.name for check in found.checks if check.passed is None}
    expected = {"random": {ROWS}, "oracle": {"the hidden truth changes nothing", "the future changes nothing"}}
    assert unchecked == expected.get(name.partition("-")[0], set())


def test_it_prints_a_line_a_check_and_how_to_mend_what_failed() -> None:
    lines = str(checked(Mean())).splitlines()
    assert lines[0] == "planner still: 9 passed, 2 failed"
    at = lines.index("  FAILED       no row looks at another")
    assert [line.split(":")[0].strip() for line in lines[at + 1 : at + 4]] == ["got", "expected", "to mend"]
    assert lines[1] == "  passed       answers a batch of 7 with finite targets (7, 3)"
    assert "ms for one frame of one episode" in lines[-1]


@pytest.mark.parametrize("frames", [3, 7])
def test_short_sequences_will_do(frames: int) -> None:
    assert checked(Still(), frames=frames).passed
