import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.data.motion_file import save_motion
from ehar.errors import DataError, ModelError, UsageError
from ehar.planner import Observation
from eval.records.config import CONFIG
from eval.running.run import read_run
from eval.studies.behaviour.agent_states import AgentStates, agent_states, load_agent, map_states, neighbour_purity
from planners.agents.network import STATE
from tests.helpers.agents import save_untrained
from tests.helpers.fakes import tiny_data
from tests.helpers.seeing import Seeing
from tests.helpers.tiny_benchmarks import Log
from tests.helpers.tiny_benchmarks import run as run_tiny


class Stateless(Seeing):
    def act(self, observation: Observation) -> FloatArray:
        target = super().act(observation)
        del self.state
        return target


pytestmark = pytest.mark.usefixtures("fake_weights")


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    """Return a run of 60 episodes, two chunks."""
    save_motion(tmp_path / "tiny.npz", tiny_data(sequences=30))
    planners = ["no-act", Seeing()]
    run_tiny(planners, data=tmp_path / "tiny.npz", starts=2, out=tmp_path / "run")
    return tmp_path / "run"


def change(directory: Path, **values: Any) -> None:
    held = json.loads((directory / CONFIG).read_text())
    (directory / CONFIG).write_text(json.dumps({**held, **values}))


def test_states_are_those_of_the_runs_own_episodes(directory: Path) -> None:
    run = read_run(directory)
    recorded = run.records["seeing"]
    states = agent_states(run, "seeing", Seeing(), reporter=Log(), every=4)
    assert len(recorded) > 32  # more than one chunk
    frames = [0, 4, 8]  # of 9 that are planned upon
    assert states.frame.tolist() == frames * len(recorded)
    assert states.sequence[::3].tolist() == list(recorded.sequence)
    np.testing.assert_array_equal(states.label[::3], recorded.label)
    seen = states.state.reshape(len(recorded), 3, -1)
    np.testing.assert_allclose(seen[..., 3:6], recorded.viewpoint[:, frames], atol=1e-6)
    np.testing.assert_array_equal(seen[..., 6], np.tile(frames, (len(recorded), 1)))
    np.testing.assert_array_equal(seen[..., :3].argmax(axis=-1), recorded.predicted[:, frames])


def test_a_planner_that_goes_elsewhere_is_refused(directory: Path) -> None:
    with pytest.raises(DataError, match=r"expected seeing to go where it went, in 60 of 60 episodes"):
        agent_states(read_run(directory), "seeing", Seeing(step=0.0), reporter=Log())


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({"data_sha256": "other"}, "expected the data of the run, sha256 other"),
        ({"recogniser_sha256": "other"}, "expected the recogniser of the run"),
        ({"track": "px4-max"}, "expected a run on the ideal track"),
        ({"seed": 1}, "expected to make its episodes once more"),
    ],
)
def test_another_run_is_refused(directory: Path, changed: dict[str, Any], expected: str) -> None:
    change(directory, **changed)
    with pytest.raises(DataError, match=expected):
        agent_states(read_run(directory), "seeing", Seeing(), reporter=Log())


def test_a_planner_without_states_or_of_another_name_is_refused(directory: Path) -> None:
    run = read_run(directory)
    with pytest.raises(UsageError, match="with a state after each frame"):
        agent_states(run, "seeing", Stateless(), reporter=Log())
    with pytest.raises(UsageError, match="no planner 'seen'; expected one of: no-act, seeing"):
        agent_states(run, "seen", Seeing(), reporter=Log())
    with pytest.raises(UsageError, match="planner 'seeing': expected a learned one, such as il-ppo/0"):
        load_agent(run, "seeing")


@pytest.fixture
def learned(tmp_path: Path) -> Path:
    """Return a run of two trainings of an agent."""
    data, models = tiny_data(sequences=30), tmp_path / "models"
    save_motion(tmp_path / "tiny.npz", data)
    for seed in (0, 1):
        save_untrained(models, data, "il-ppo", seed=seed)
    source = tmp_path / "tiny.npz"
    run_tiny(["no-act", "il-ppo"], starts=1, data=source, models=models, out=tmp_path / "run")
    return tmp_path / "run"


def test_the_agent_of_a_run_is_loaded_by_its_record_name(learned: Path) -> None:
    run = read_run(learned)
    found = {}
    for name in ("il-ppo/0", "il-ppo/1"):
        agent = load_agent(run, name)
        assert agent.name == name
        states = agent_states(run, name, agent, reporter=Log())
        assert states.state.shape == (2 * len(run.records[name]), STATE)  # frames 0 and 5 of 9
        found[name] = states.state
    assert not np.isclose(*found.values()).all(axis=1).any()
    with pytest.raises(DataError, match="expected il-ppo/1 to go where it went"):
        agent_states(run, "il-ppo/1", load_agent(run, "il-ppo/0"), reporter=Log())


def test_an_agent_that_is_gone_or_of_another_recogniser_is_named(learned: Path) -> None:
    run = read_run(learned)
    with pytest.raises(ModelError, match=r"agent-il-ppo-perfect-moving-seed2\.safetensors: no such file"):
        load_agent(run, "il-ppo/2")
    save_untrained(learned.parent / "models", tiny_data(sequences=30), "il-ppo", recogniser="another")
    with pytest.raises(ModelError, match="trained for another recogniser"):
        load_agent(run, "il-ppo/0")
    save_motion(learned.parent / "tiny.npz", tiny_data(sequences=24))
    with pytest.raises(ModelError, match="trained for another data set"):
        load_agent(run, "il-ppo/1")


def states_of(positions: list[float], labels: list[int], sequences: list[str]) -> AgentStates:
    state = np.array(positions)[:, None]
    return AgentStates(state, np.array(labels), np.array(sequences), np.zeros(len(labels), dtype=int))


def test_neighbours_of_the_same_sequence_do_not_count() -> None:
    # The nearest of 0, 1, 10, 11 in another sequence: 1, 0, 11, 10; of 0.1, which shares a sequence with 0, it is 1.
    states = states_of([0, 0.1, 1, 10, 11], [0, 0, 1, 1, 1], ["a", "a", "b", "c", "d"])
    purity = neighbour_purity(states, 1)
    # 0 and 0.1 find 1 (wrong), 1 finds 0.1 (wrong), 10 and 11 find each other.
    assert purity.purity == pytest.approx(2 / 5)
    # Others: of 0, 0.1: 3 states, none of their class; of 1, 10, 11: 4 states, 2 of theirs.
    assert purity.chance == pytest.approx((0 + 0 + 3 * 2 / 4) / 5)
    with pytest.raises(DataError, match="two sequences"):
        neighbour_purity(states_of([0, 1], [0, 0], ["a", "a"]))


def test_classes_apart_are_pure_and_noise_is_as_chance() -> None:
    rng = np.random.default_rng(0)
    labels = np.repeat(np.arange(3), 200)
    names = np.array([f"s{index}" for index in range(600)])
    noise = rng.normal(size=(600, 4))
    apart = neighbour_purity(AgentStates(noise + 50 * np.eye(4)[labels], labels, names, labels))
    mixed = neighbour_purity(AgentStates(noise, labels, names, labels))
    assert apart.purity == 1 and apart.neighbours == 10
    assert mixed.purity == pytest.approx(mixed.chance, abs=0.03) == pytest.approx(1 / 3, abs=0.03)


def test_a_sample_keeps_rows_together() -> None:
    states = states_of(list(range(50)), list(range(50)), [str(index) for index in range(50)])
    sample = states.sample(np.random.default_rng(0), 20)
    assert len(set(sample.label.tolist())) == 20
    assert sample.state[:, 0].tolist() == sample.label.tolist() == [int(name) for name in sample.sequence]
    assert states.sample(np.random.default_rng(0), 50) is states


def test_the_map_is_the_same_each_time_and_keeps_classes_apart() -> None:
    state = np.random.default_rng(0).normal(size=(60, 5)) + 20 * np.eye(5)[np.repeat([0, 1], 30)]
    mapped = map_states(state)
    np.testing.assert_array_equal(mapped, map_states(state))
    one, other = mapped[:30], mapped[30:]
    within = np.linalg.norm(one - one.mean(axis=0), axis=1).max()
    assert np.linalg.norm(one.mean(axis=0) - other.mean(axis=0)) > within
