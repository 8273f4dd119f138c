"""What a privileged planner imagines is what is recognised when it goes there, on the grid and in flight."""

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.conditions import Conditions
from ehar.data.scenario import part_of, windows
from ehar.planner import Context, Observation, Planner
from recognition.setting import load_setting

FRAMES = 150


class Imagines(Planner):
    """Goes round people, and keeps what it imagined of each next frame, and what was recognised then."""

    name = "imagines"
    privileged = True

    def reset(self, context: Context) -> None:
        self.context = context
        self.imagined: list[FloatArray] = []
        self.recognised: list[FloatArray] = []
        self.blocked = False

    def act(self, observation: Observation) -> FloatArray:
        truth = observation.truth
        assert truth is not None
        self.recognised.append(observation.log_probs)
        target = observation.viewpoint + np.array([0.0, 1.0, 0.0])
        assert truth.fork_motion is not None
        reached = truth.fork_motion(1).advance(target)
        self.blocked |= bool((reached[:, 1] == observation.viewpoint[:, 1]).any())
        found, _ = truth.imagine(truth.state.fork(1), observation.frame + 1, reached[:, None])
        self.imagined.append(found.log_probs[:, 0])
        return target


@pytest.mark.parametrize(("track", "world"), [("ideal", "paper"), ("px4-auto", "paper"), ("ideal", "room")])
def test_what_is_imagined_is_what_is_recognised_there(track: str, world: str) -> None:
    setting = load_setting(Conditions(data="solo-stream", sensor="estimator", track=track, world=world))
    parts = windows(setting.recordings, part_of(setting.recordings, "test")[:2], FRAMES, FRAMES)
    rng = np.random.default_rng(2)
    batch = setting.runner.batch(parts, np.arange(2), setting.world.sample_starts(rng, 2), rng)
    planner = Imagines()
    setting.runner.roll(planner, batch, np.random.default_rng(0))
    if world == "room":
        assert planner.blocked, "something should be in the way, or this tests nothing"
    if track != "ideal":  # people are beside the centre that the vehicle flies around, or this tests nothing
        assert batch.gaze is not None and np.linalg.norm(batch.gaze, axis=-1).max() > 0.2
    imagined, recognised = np.exp(planner.imagined[:-1]), np.exp(planner.recognised[1:])
    np.testing.assert_allclose(imagined, recognised, atol=1e-5)


class Beholds(Planner):
    """Keeps what it is told of where its camera looks, and tries to write into it."""

    name = "beholds"

    def reset(self, context: Context) -> None:
        self.gazes: list[FloatArray] = []

    def act(self, observation: Observation) -> FloatArray:
        assert observation.gaze is not None
        with pytest.raises(ValueError, match="read-only"):
            observation.gaze[:] = 0
        self.gazes.append(observation.gaze)
        return observation.viewpoint


def test_in_flight_planners_are_told_where_cameras_look_now_and_cannot_write_it() -> None:
    setting = load_setting(Conditions(data="solo-stream", sensor="estimator", track="px4-auto"))
    parts = windows(setting.recordings, part_of(setting.recordings, "test")[:2], FRAMES, FRAMES)
    begins = np.array([[7.0, 1.0, 1.3], [12.0, 3.0, 0.9]])
    batch = setting.runner.batch(parts, np.arange(2), begins, np.random.default_rng(0))
    planner = Beholds()
    setting.runner.roll(planner, batch, np.random.default_rng(0))
    assert batch.gaze is not None
    np.testing.assert_array_equal(np.stack(planner.gazes, axis=1), batch.gaze[:, :-1])
