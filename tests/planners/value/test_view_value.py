"""What views are worth by when: a node's share is that of the frames that it stands for."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ehar.arrays import FloatArray
from ehar.errors import UsageError
from ehar.motion import GridMotion
from ehar.planner import Context, Observation, Planner
from ehar.rollout import rollout
from ehar.sensors.perfect import PerfectSensor
from planners.value.belief.clips import BeliefModel
from planners.value.field import GainField
from planners.value.model import GainModel
from planners.value.situation import Tracker, frame_gains
from planners.value.view_basis import BASIS_SIZE
from planners.value.view_value import ViewValue, node_gains
from tests.helpers.fakes import FakeRecogniser, tiny_batch, tiny_context
from tests.helpers.gain_models import PAIRS, model_of


@given(st.integers(1, 90), st.integers(0, 60), st.integers(1, 40), st.integers(1, 20))
def test_nodes_share_what_the_frames_weigh(remaining: int, frame: int, nodes: int, node_frames: int) -> None:
    length = frame + 1 + remaining
    gains = frame_gains(frame, length)
    weights = node_gains(gains, nodes, node_frames)
    assert weights.shape == (nodes,)
    assert weights.sum() == pytest.approx(1)
    for node in range(nodes - 1):
        assert weights[node] == pytest.approx(gains[node * node_frames : (node + 1) * node_frames].sum())
    assert weights[-1] == pytest.approx(gains[(nodes - 1) * node_frames :].sum())
    assert (weights[-(-remaining // node_frames) :] == 0).all(), "beyond the end of the episode"


def test_a_horizon_beyond_the_end_weighs_nothing_there() -> None:
    np.testing.assert_allclose(node_gains(frame_gains(8, 10), 5, 4), [1, 0, 0, 0, 0])
    np.testing.assert_allclose(node_gains(frame_gains(0, 61), 1, 4), [1])
    # Frames 2 and 3 of 3, one each: 1/2 + 1/3 and 1/3.
    np.testing.assert_allclose(node_gains(frame_gains(0, 3), 3, 1), [5 / 7, 2 / 7, 0])


class Valuer(Planner):
    """Stays, and keeps the weights after every frame, and those of the field for a tracker of its own."""

    name = "valuer"

    def __init__(self, model: GainModel, variant: str) -> None:
        self.value, self.field = ViewValue(model, variant=variant), model.fields[variant]
        self.tracker = Tracker(belief=model.belief, pairs=model.pairs)

    def reset(self, context: Context) -> None:
        self.value.reset(context)
        self.tracker.reset(context)

    def act(self, observation: Observation) -> FloatArray:
        self.value.update(observation)
        self.tracker.update(observation)
        np.testing.assert_array_equal(self.value.weights, self.field.weights(self.tracker.situation))
        return observation.viewpoint


def test_the_weights_are_the_chosen_field_s_in_the_tracked_situation() -> None:
    rng = np.random.default_rng(0)
    fields = {
        name: GainField(("ratio", "belief"), rng.normal(size=(5, BASIS_SIZE)), np.zeros((5, BASIS_SIZE)), 0.0)
        for name in ("full", "other")
    }
    model = GainModel(fields, BeliefModel(), PAIRS)
    for variant in fields:
        valuer = Valuer(model, variant)
        rollout(valuer, tiny_batch(), FakeRecogniser(), PerfectSensor(), GridMotion(), tiny_context())
        assert valuer.value.field is fields[variant]


def test_an_unknown_variant_names_those_that_there_are() -> None:
    with pytest.raises(UsageError, match="unknown gain field 'best'; expected one of: full"):
        ViewValue(model_of(np.zeros(BASIS_SIZE)), variant="best")
