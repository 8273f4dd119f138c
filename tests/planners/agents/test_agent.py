"""The agent as a planner: it streams, episodes do not mix, and it sees what the environments show."""

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from ehar.arrays import FloatArray, IntArray
from ehar.envs.controls import GridControls
from ehar.envs.environment import EpisodeVectorEnv
from ehar.envs.observations import shown_to_agent
from ehar.envs.task import EpisodeTask
from ehar.flight.vehicle import VEHICLES
from ehar.motion import GridMotion
from ehar.planner import Observation
from ehar.rollout import rollout
from ehar.sensors.perfect import PerfectSensor
from ehar.sensors.registry import make_sensor
from ehar.viewpoint import MOVES, Workspace, apply_moves
from ehar.world import PAPER
from planners.agents.agent import Agent, decide
from planners.agents.inputs import ENCODED, AgentInputs, Inputs
from planners.agents.network import STATE, AgentNetwork
from tests.helpers.agents import random_observation, untrained_agent, untrained_network
from tests.helpers.fakes import FakeRecogniser, tiny_batch, tiny_context, tiny_scenarios

LENGTH = 10
ABLATED = ("il", *(f"il-no-{name}" for name in ENCODED))


class Watched(AgentNetwork):
    """Keeps the inputs of every call."""

    def __init__(self, network: AgentNetwork) -> None:
        super().__init__(network.spec)
        self.load_state_dict(network.state_dict())
        self.calls: list[Inputs] = []

    def state(self, inputs: Any) -> torch.Tensor:
        self.calls.append({name: values.numpy().copy() for name, values in inputs.items()})
        return super().state(inputs)


def watched_agent(spec: str = "il", *, persons: int = 1) -> tuple[Agent, list[Inputs]]:
    network = Watched(untrained_agent(spec, persons=persons).network)
    return Agent(name=spec, network=network), network.calls


def observations(*, persons: int = 1, length: int = LENGTH, episodes: int = 5, seed: int = 0) -> list[Observation]:
    rng = np.random.default_rng(seed)
    return [
        random_observation(rng, frame=frame, length=length, episodes=episodes, persons=persons)
        for frame in range(length - 1)
    ]


def from_all_frames(history: list[Observation]) -> Inputs:
    """Return the inputs after a history, from all of it at once."""
    context = tiny_context(episodes=len(history[0].viewpoint))
    last = AgentInputs().see(shown_to_agent(history[-1], context))  # all but the mean is of the last frame
    mean = np.stack([observation.embedding for observation in history]).mean(axis=0)
    size = mean.shape[1]
    recognition = np.hstack([last["recognition"][:, :size], mean, last["recognition"][:, 2 * size :]])
    return {**last, "recognition": recognition.astype(np.float32)}


@pytest.mark.parametrize("persons", [1, 2])
@pytest.mark.parametrize("spec", ABLATED)
def test_frame_by_frame_is_as_from_the_whole_history_at_every_frame(spec: str, persons: int) -> None:
    agent, calls = watched_agent(spec, persons=persons)
    context, history = tiny_context(episodes=5), observations(persons=persons)
    for _ in range(2):  # a second batch of episodes remembers nothing of the first
        agent.reset(context)
        calls.clear()
        for frame, observation in enumerate(history):
            target = agent.act(observation)
            state = agent.state
            expected = from_all_frames(history[: frame + 1])
            for name in ENCODED:
                np.testing.assert_allclose(calls[frame][name], expected[name], rtol=1e-5, atol=1e-6, err_msg=name)
            moves, states = decide(untrained_agent(spec, persons=persons).network, expected)
            np.testing.assert_allclose(state, states, rtol=1e-4, atol=1e-5)
            np.testing.assert_array_equal(target, apply_moves(observation.viewpoint, moves, context.workspace))


def test_a_late_frame_costs_what_the_first_does() -> None:
    agent, calls = watched_agent()
    ran: list[int] = []
    for module in agent.network.modules():
        if isinstance(module, torch.nn.Linear):
            module.register_forward_hook(lambda _, inputs, __: ran.append(inputs[0].shape[0]))
    agent.reset(tiny_context(episodes=5))
    layers, remembered = [], []
    for observation in observations(length=100):
        ran.clear()
        agent.act(observation)
        assert len(calls[-1]) == len(ENCODED)
        layers.append(tuple(ran))
        remembered.append(len(pickle.dumps(agent._inputs)))
    assert len(calls) == 99
    assert set(layers) == {(5,) * 8}, "two layers of each encoder, the state encoder and the actor, for one frame"
    assert len(set(remembered)) == 1, "what is remembered does not grow"


def test_the_state_is_what_the_move_is_chosen_from() -> None:
    agent, calls = watched_agent()
    context = tiny_context(episodes=5)
    agent.reset(context)
    assert agent.state.shape == (5, 0), "nothing was seen yet"
    for observation in observations():
        target = agent.act(observation)
        assert agent.state.shape == (5, STATE)
        assert agent.state.dtype == np.float32
        with torch.inference_mode():
            state = untrained_agent().network.state(
                {name: torch.from_numpy(array) for name, array in calls[-1].items()}
            )
            moves = agent.network.logits(torch.from_numpy(agent.state)).argmax(dim=1).numpy()
        np.testing.assert_array_equal(agent.state, state.numpy())
        np.testing.assert_array_equal(target, apply_moves(observation.viewpoint, moves, context.workspace))


def rows(observation: Observation, chosen: Any) -> Observation:
    """Return some episodes of an observation."""
    arrays = {name: value[chosen] for name, value in vars(observation).items() if isinstance(value, np.ndarray)}
    return replace(observation, **arrays)


def acted(agent: Agent, history: list[Observation]) -> tuple[FloatArray, FloatArray]:
    """Return all targets (T, B, 3) and states (T, B, S)."""
    agent.reset(tiny_context(episodes=len(history[0].viewpoint)))
    pairs = [(agent.act(observation), agent.state) for observation in history]
    return np.stack([target for target, _ in pairs]), np.stack([state for _, state in pairs])


@pytest.mark.parametrize("chosen", [[4, 2, 0, 1, 3], [3], [1, 1, 4]], ids=["reordered", "alone", "beside its like"])
def test_an_episode_goes_as_it_would_beside_any_others(chosen: list[int]) -> None:
    history = observations()
    targets, states = acted(untrained_agent(), history)
    some_targets, some_states = acted(untrained_agent(), [rows(observation, chosen) for observation in history])
    np.testing.assert_allclose(some_states, states[:, chosen], rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(some_targets, targets[:, chosen])


@pytest.mark.parametrize("persons", [1, 2])
@pytest.mark.parametrize("sensor", ["perfect", "estimator"])
def test_it_sees_what_the_environment_shows_and_goes_the_same_way(sensor: str, persons: int) -> None:
    scenarios = tiny_scenarios(length=LENGTH, persons=persons)
    eye = make_sensor(sensor, scenarios.data)
    env = EpisodeVectorEnv(
        6, EpisodeTask(scenarios=scenarios, recogniser=FakeRecogniser(), sensor=eye, controls=GridControls())
    )
    network = untrained_agent(persons=persons).network
    shown, _ = env.reset(seed=0)
    batch = env.episodes._batch  # the episodes that were drawn
    inputs, there, ways = AgentInputs(), [], [env.episodes.viewpoint]
    for _ in range(LENGTH - 1):
        there.append(inputs.see(shown))
        moves, _ = decide(network, there[-1])
        shown, *_ = env.step(moves)
        ways.append(env.episodes.viewpoint)
    agent, here = watched_agent(persons=persons)
    context = replace(tiny_context(episodes=6, length=LENGTH), frame_time=1 / scenarios.data.fps)
    record = rollout(agent, batch, FakeRecogniser(), eye, GridMotion(), context)
    assert len(here) == len(there) == LENGTH - 1
    for mine, theirs in zip(here, there, strict=True):
        for name in ENCODED:
            np.testing.assert_array_equal(mine[name], theirs[name])
    np.testing.assert_array_equal(record.viewpoints, np.stack(ways, axis=1))
    assert len(np.unique(PAPER.workspace.to_cells(record.viewpoints).reshape(-1, 3), axis=0)) > 6, "it moved"


OF_ENCODER = {
    "recognition": ("log_probs", "embedding"),
    "vision": ("joints_2d", "confidence"),
    "position": ("viewpoint",),
}


@pytest.mark.parametrize("changed", ENCODED)
@pytest.mark.parametrize("spec", ABLATED)
def test_only_what_is_encoded_decides_the_move(spec: str, changed: str) -> None:
    one, other = (random_observation(np.random.default_rng(seed), episodes=300) for seed in (0, 1))
    mixed = replace(one, **{name: getattr(other, name) for name in OF_ENCODER[changed]})
    moves, states = zip(*(move_of(untrained_agent(spec), seen) for seen in (one, mixed)), strict=True)
    if spec == f"il-no-{changed}":
        np.testing.assert_array_equal(states[0], states[1])
        np.testing.assert_array_equal(moves[0], moves[1])
    else:
        assert not np.isclose(states[0], states[1]).all(axis=1).any()
        assert (moves[0] != moves[1]).mean() > 0.02


def test_the_ratio_is_part_of_the_recognition() -> None:
    early = random_observation(np.random.default_rng(0), frame=0)
    late = replace(early, frame=8)
    for spec in ABLATED:
        states = [move_of(untrained_agent(spec), seen)[1] for seen in (early, late)]
        assert np.array_equal(*states) == (spec == "il-no-recognition")


def move_of(agent: Agent, observation: Observation) -> tuple[IntArray, FloatArray]:
    """Return moves (B,) and states (B, S) of a first frame; there is room for every move."""
    everywhere = Workspace(distance_min=1.0, distance_max=20.0, polar_max=3.0)
    agent.reset(replace(tiny_context(episodes=len(observation.viewpoint)), workspace=everywhere))
    steps = agent.act(observation)[:, None] - apply_moves(
        observation.viewpoint[:, None], np.arange(len(MOVES))[None], everywhere
    )
    return np.abs(steps).sum(axis=2).argmin(axis=1), agent.state


def test_the_workspace_is_that_of_the_context() -> None:
    observation = random_observation(np.random.default_rng(0))
    small = Workspace(distance_min=4.0, distance_max=30.0)
    expected = shown_to_agent(observation, tiny_context(episodes=5))["viewpoint"]
    shown = shown_to_agent(observation, replace(tiny_context(episodes=5), workspace=small))["viewpoint"]
    np.testing.assert_allclose(shown[:, 0], (observation.viewpoint[:, 0] - 4) / 26, rtol=1e-5)
    np.testing.assert_array_equal(shown[:, 1:], expected[:, 1:])


def test_a_vehicle_is_sent_on_in_the_direction_of_the_move() -> None:
    vehicle = VEHICLES["px4-max"]
    observation = random_observation(np.random.default_rng(0), episodes=300)
    middle = replace(observation, viewpoint=PAPER.workspace.from_cells(np.tile([50, 50, 12], (300, 1))))
    context = tiny_context(episodes=300)
    steps = []
    for chosen in (context, replace(context, track=vehicle.name, vehicle=vehicle)):
        agent = untrained_agent()
        agent.reset(chosen)
        steps.append(agent.act(middle) - middle.viewpoint)
    np.testing.assert_array_equal(np.sign(steps[0].round(9)), np.sign(steps[1].round(9)))
    moved = (steps[0].round(9) != 0).any(axis=1)
    assert moved.any()
    assert (np.abs(steps[1][moved]).max(axis=1) > 3 * np.abs(steps[0][moved]).max(axis=1)).all()


def test_nothing_is_learned_or_drawn_while_it_acts() -> None:
    agent, context = untrained_agent(), tiny_context(episodes=6, length=LENGTH)
    before = {name: weight.clone() for name, weight in agent.network.state_dict().items()}
    drawn = context.rng.bit_generator.state
    batch = tiny_batch(episodes=6, length=LENGTH)
    rollout(agent, batch, FakeRecogniser(), PerfectSensor(), GridMotion(), context)
    assert context.rng.bit_generator.state == drawn
    assert not agent.network.training
    for name, weight in agent.network.state_dict().items():
        assert torch.equal(weight, before[name])
        assert agent.network.get_parameter(name).grad is None


def test_a_copy_in_another_process_acts_the_same() -> None:
    agent, history = untrained_agent(), observations()
    copy = pickle.loads(pickle.dumps(agent))
    assert (copy.name, copy.sha256, copy.privileged) == ("il", "of il", False)
    for mine, theirs in zip(acted(agent, history), acted(copy, history), strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_a_network_in_training_acts_in_evaluation() -> None:
    network = untrained_network().train()
    assert not Agent(name="il", network=network).network.training
