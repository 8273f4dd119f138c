"""What views are worth by when: a node's share is that of the frames that it stands for."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ehar.arrays import FloatArray
from ehar.data.scenario import windows
from ehar.errors import UsageError
from ehar.motion import GridMotion
from ehar.planner import Context, Observation, Planner
from ehar.rollout import rollout
from ehar.runner import Runner
from ehar.sensors.perfect import PerfectSensor
from planners.value.belief.chain import advance
from planners.value.belief.clips import BeliefModel
from planners.value.belief.streams import StreamBeliefModel
from planners.value.field import GainField
from planners.value.model import GainModel
from planners.value.situation import Tracker, frame_gains, frames_to_come
from planners.value.view_basis import BASIS_SIZE
from planners.value.view_value import ViewValue, node_gains
from tests.helpers.fakes import FakeRecogniser, tiny_batch, tiny_context
from tests.helpers.gain_models import PAIRS, model_of
from tests.helpers.streams import StreamRecogniser, raising_streams


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


CHAIN = StreamBeliefModel(  # the first raises, then the second, then the third, with nothing in between; a second each
    follows=((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
    rates=(1.0, 1.0, 1.0),
    gap_share=(0.0, 0.0, 0.0),
    gap_rate=1.0,
    share=(0.3, 0.3, 0.3, 0.1),
    phases=8,
)


class Foreseer(Valuer):
    """Keeps what views are worth at nodes of a second each."""

    def act(self, observation: Observation) -> FloatArray:
        target = super().act(observation)
        self.coming = self.value.coming(4, 10)
        return target


def foreseen(parts: tuple[str, ...]) -> Foreseer:
    """Return who has watched a second of streams; the field has the belief in a class as the weight of a function."""
    absolute = np.zeros((1 + 4 * len(parts), BASIS_SIZE))
    if parts:
        absolute[1:, 1:5] = np.eye(4)
    field = GainField(parts, absolute, np.zeros_like(absolute), 0.0)
    valuer = Foreseer(GainModel({"full": field}, CHAIN, PAIRS), "full")
    data, rng = raising_streams(), np.random.default_rng(0)
    runner = Runner(data, StreamRecogniser(), PerfectSensor())
    batch = runner.batch(windows(data, np.arange(8), 10, 10), np.arange(8), runner.world.sample_starts(rng, 8), rng)
    runner.roll(valuer, batch, rng)
    return valuer


def test_nodes_are_worth_what_is_expected_of_their_time() -> None:
    """State by state: each node has the mean of what the chain foretells of its ten frames."""
    valuer = foreseen(("belief",))
    later, foretold = valuer.value._tracker._belief._chain, []
    frames = frames_to_come(valuer.tracker.context)
    for _ in range(frames):
        later = advance(CHAIN, later, 0.1)
        foretold.append(later.classes)
    expected = valuer.coming.weights[..., 1:5]  # (B, 4 nodes, 3 classes and none)
    np.testing.assert_allclose(expected[:, 0], np.mean(foretold[:10], axis=0), atol=1e-12)
    np.testing.assert_allclose(expected[:, 1], np.mean(foretold[10:frames], axis=0), atol=1e-12)
    assert abs(expected[:, 1] - expected[:, 0]).max() > 0.1  # others are likely a second later


def test_over_all_nodes_the_belief_is_the_one_that_the_field_was_learned_with() -> None:
    """With nodes up to where planners look, the nodes' mean is the field now: it is linear in the belief."""
    valuer = foreseen(("belief",))
    nodes = valuer.value.coming(5)
    assert nodes.node_frames * 5 == frames_to_come(valuer.tracker.context)
    np.testing.assert_allclose(nodes.weights.mean(axis=1), valuer.value.weights, atol=1e-12)


def test_a_field_that_knows_no_belief_is_the_same_at_all_nodes() -> None:
    coming = foreseen(()).coming
    np.testing.assert_array_equal(coming.weights, np.repeat(coming.weights[:, :1], 4, axis=1))
