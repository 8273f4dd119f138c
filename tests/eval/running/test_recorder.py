"""The recorder of planners: it changes nothing of what a planner does, and keeps what it was shown."""

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.errors import EpisodeError
from ehar.planner import Context, Observation, Planner
from eval.running.recorder import Recorder
from tests.helpers.fakes import tiny_context


class Spoiling(Planner):
    name = "spoiling"
    privileged = True

    def reset(self, context: Context) -> None:
        self.told = context

    def act(self, observation: Observation) -> FloatArray:
        if observation.frame > 1:
            raise ValueError("that is enough")
        observation.viewpoint[:] += 1.0
        return observation.viewpoint


def observation_at(frame: int) -> Observation:
    viewpoint = np.full((2, 3), float(frame))
    return Observation(
        frame=frame,
        length=9,
        joints_2d=np.zeros((2, 1, 4, 2)),
        confidence=np.ones((2, 1, 4)),
        viewpoint=viewpoint,
        log_probs=np.zeros((2, 5)),
        embedding=np.zeros((2, 6)),
        velocity=np.zeros((2, 3)),
        acceleration=np.zeros((2, 3)),
    )


def test_it_keeps_what_was_shown_as_it_was_and_what_was_answered() -> None:
    handed = []
    recorder = Recorder(Spoiling(), name="spoiling/0", answered=handed.append)
    assert (recorder.name, recorder.privileged) == ("spoiling/0", True)
    recorder.reset(tiny_context(episodes=2))
    for frame in (0, 1):
        shown = observation_at(frame)
        np.testing.assert_array_equal(recorder.act(shown), np.full((2, 3), frame + 1.0))
        np.testing.assert_array_equal(shown.viewpoint, frame)
    assert [observation.frame for observation in recorder.observations] == [0, 1]
    assert [float(observation.viewpoint[0, 0]) for observation in recorder.observations] == [0.0, 1.0]
    assert [float(observation.viewpoint[0, 0]) for observation in handed] == [1.0, 2.0]
    np.testing.assert_array_equal(recorder.targets[1], np.full((2, 3), 2.0))
    assert recorder.seconds > 0
    recorder.reset(tiny_context(episodes=2))
    assert (recorder.observations, recorder.targets, recorder.seconds) == ([], [], 0.0)


def test_it_blames_the_planner_that_it_asks() -> None:
    recorder = Recorder(Spoiling())
    recorder.reset(tiny_context(episodes=2))
    with pytest.raises(EpisodeError, match=r"planner 'spoiling', frame 2: .*that is enough.*test_recorder"):
        recorder.act(observation_at(2))
