"""Demonstrations: what the teachers say by hand, who acts, and that files in a folder change nothing."""

from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.batch import Batch
from ehar.envs.observations import shown as shown_in_gymnasium
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import VEHICLES
from ehar.motion import GridMotion
from ehar.planner import Planner
from ehar.processes import Processes
from ehar.rollout import Record, rollout
from ehar.runner import Runner
from ehar.sensors.perfect import PerfectSensor
from ehar.viewpoint import Workspace, apply_moves
from ehar.world import PAPER
from planners.agents import demonstrations
from planners.agents.agent import Agent
from planners.agents.config import LEAST_LOOKAHEAD
from planners.agents.demonstrations import (
    EVERY,
    HORIZON,
    WANDER,
    Demonstrations,
    DemonstrationTask,
    Demonstrator,
    collect,
    demonstrate,
    demonstrate_batch,
    join,
    read_batch,
)
from planners.agents.inputs import AgentInputs
from planners.oracle import Oracle
from tests.helpers.agent_worlds import steep_quality
from tests.helpers.agents import untrained_network
from tests.helpers.fakes import FakeRecogniser, tiny_batch, tiny_context, tiny_scenarios

EPISODES, LENGTH = 6, 24
ASKED = (2, 7, 12, 17)  # when the teacher that looks ahead is asked in it; from 22 there is but one move left


def run(planner: Planner, *, length: int = LENGTH, seed: int = 0) -> tuple[Batch, Record]:
    """Run a planner on the tiny data."""
    batch = tiny_batch(episodes=EPISODES, length=length, seed=seed)
    context = tiny_context(episodes=EPISODES, length=length, seed=seed)
    record = rollout(planner, batch, FakeRecogniser(quality=steep_quality), PerfectSensor(), GridMotion(), context)
    return batch, record


def judged(batch: Batch, path: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return log-probabilities (T, B, K) and embeddings (T, B, D) of cameras that went along (T, B, 3)."""
    recogniser = FakeRecogniser(quality=steep_quality)
    state: Any = recogniser.start(EPISODES)
    log_probs, embeddings = [], []
    for frame, viewpoint in enumerate(path):
        sensed = PerfectSensor().sense(batch.positions[:, frame], viewpoint, batch.noise.frame(frame))
        recognition, state = recogniser.step(state, sensed, viewpoint)
        log_probs.append(recognition.log_probs)
        embeddings.append(recognition.embedding)
    return np.stack(log_probs), np.stack(embeddings)


def extended(path: FloatArray, move: int, frames: int) -> FloatArray:
    """Return a path (T, B, 3) that a repeated move goes on with."""
    steps = list(path)
    for _ in range(frames):
        steps.append(apply_moves(steps[-1], np.full(EPISODES, move), Workspace()))
    return np.stack(steps)


def test_the_oracle_values_a_move_by_the_label_s_log_probability_after_it() -> None:
    demonstrator = Demonstrator(teacher="oracle", agent=None)
    batch, record = run(demonstrator)
    path = np.moveaxis(record.viewpoints, 1, 0)
    assert len(demonstrator.values) == LENGTH - 1
    for frame in (0, 1, 9, LENGTH - 2):
        for move in range(7):
            log_probs, _ = judged(batch, extended(path[: frame + 1], move, 1))
            expected = log_probs[-1][np.arange(EPISODES), batch.labels]
            np.testing.assert_allclose(demonstrator.values[frame][:, move], expected, atol=1e-5)


@pytest.mark.parametrize("rate", [2, 10, 60])
def test_in_flight_the_shortest_episode_that_is_taken_is_asked_about(rate: int) -> None:
    vehicle = VEHICLES["px4-auto"]
    context = replace(tiny_context(episodes=EPISODES, length=LEAST_LOOKAHEAD), frame_time=1 / rate, vehicle=vehicle)
    demonstrator = Demonstrator(teacher="oracle-lookahead", agent=None)
    batch = tiny_batch(episodes=EPISODES, length=LEAST_LOOKAHEAD)
    rollout(demonstrator, batch, FakeRecogniser(), PerfectSensor(), FlightMotion(vehicle=vehicle), context)
    assert demonstrator.values and demonstrator.values[0].shape == (EPISODES, 7)


def test_the_teacher_that_looks_ahead_values_what_repeating_a_move_leads_to() -> None:
    demonstrator = Demonstrator(teacher="oracle-lookahead", agent=None)
    batch, record = run(demonstrator)
    path = np.moveaxis(record.viewpoints, 1, 0)
    assert len(demonstrator.values) == len(ASKED)
    for frame, values in zip(ASKED, demonstrator.values, strict=True):
        ahead = min(HORIZON, LENGTH - 1 - frame)
        for move in range(7):
            log_probs = judged(batch, extended(path[: frame + 1], move, ahead))[0][frame + 1 :]
            probability = np.exp(log_probs)[:, np.arange(EPISODES), batch.labels]
            on_top = log_probs.argmax(axis=2) == batch.labels
            np.testing.assert_allclose(values[:, move], (probability + 0.5 * on_top).sum(axis=0), rtol=1e-4)


@pytest.mark.parametrize(("length", "frames"), [(5, 1), (9, 1), (10, 2), (60, 12)])
def test_how_often_it_looks_ahead(length: int, frames: int) -> None:
    demonstrator = Demonstrator(teacher="oracle-lookahead", agent=None)
    run(demonstrator, length=length)
    assert len(demonstrator.values) == frames
    assert EVERY == 5


@pytest.mark.parametrize(("teacher", "asked"), [("oracle", tuple(range(LENGTH - 1))), ("oracle-lookahead", ASKED)])
def test_streamed_inputs_are_those_that_are_recomputed(teacher: Any, asked: tuple[int, ...]) -> None:
    """From everything that was seen until then, and as the Gymnasium environments would show it."""
    demonstrator = Demonstrator(teacher=teacher, agent=None)
    batch, record = run(demonstrator)
    path = np.moveaxis(record.viewpoints, 1, 0)
    log_probs, embeddings = judged(batch, path)
    assert len(demonstrator.inputs) == len(asked)
    for frame, inputs in zip(asked, demonstrator.inputs, strict=True):
        again = AgentInputs()
        for earlier in range(frame + 1):
            sensed = PerfectSensor().sense(batch.positions[:, earlier], path[earlier], batch.noise.frame(earlier))
            expected = again.see(
                shown_in_gymnasium(
                    joints_2d=sensed.joints_2d,
                    confidence=sensed.confidence,
                    viewpoint=path[earlier],
                    log_probs=log_probs[earlier],
                    embedding=embeddings[earlier],
                    ratio=(earlier + 1) / LENGTH,
                    workspace=Workspace(),
                    camera=PerfectSensor().camera,
                )
            )
        assert inputs.keys() == expected.keys()
        for name, values in inputs.items():
            np.testing.assert_allclose(values, expected[name], atol=1e-5)
        mean = inputs["recognition"][:, 3:6]  # after the embedding, which has 3 numbers here
        np.testing.assert_allclose(mean, embeddings[: frame + 1].mean(axis=0), atol=1e-5)


def test_without_an_agent_the_oracle_acts_itself() -> None:
    record, expected = run(Demonstrator(teacher="oracle", agent=None))[1], run(Oracle())[1]
    np.testing.assert_array_equal(record.viewpoints, expected.viewpoints)


@pytest.mark.parametrize("teacher", ["oracle", "oracle-lookahead"])
def test_an_agent_acts_as_it_does_alone(teacher: Any) -> None:
    network = untrained_network()
    demonstrator = Demonstrator(teacher=teacher, agent=network)
    record, alone = run(demonstrator)[1], run(Agent(name="il", network=network))[1]
    np.testing.assert_array_equal(record.viewpoints, alone.viewpoints)
    assert len(demonstrator.values) == (LENGTH - 1 if teacher == "oracle" else len(ASKED))


def test_most_cameras_wander_and_the_others_stay() -> None:
    moved = []
    for seed in range(30):
        cells = PAPER.workspace.to_cells(
            run(Demonstrator(teacher="oracle-lookahead", agent=None), seed=seed)[1].viewpoints
        )
        moved.append((np.diff(cells, axis=1) != 0).any(axis=2).mean(axis=1))
    share = np.concatenate(moved)
    assert share[share > 0].mean() > 0.8  # those that wander rest near a goal only
    assert (share > 0).mean() == pytest.approx(WANDER, abs=0.1)  # 180 episodes: 3 standard errors


def task(**changes: Any) -> DemonstrationTask:
    scenarios = tiny_scenarios(length=LENGTH)
    whole = DemonstrationTask(
        runner=Runner(scenarios.data, FakeRecogniser(quality=steep_quality), PerfectSensor()),
        scenarios=scenarios,
        teacher="oracle-lookahead",
        agent=None,
        seed=(0, 0),
    )
    return replace(whole, **changes)


def same(one: Demonstrations, other: Demonstrations) -> None:
    for field in fields(Demonstrations):
        values, others = getattr(one, field.name), getattr(other, field.name)
        assert values.dtype == others.dtype
        np.testing.assert_array_equal(values, others)


def test_a_batch_is_frames_times_episodes_and_small() -> None:
    batch = demonstrate_batch(task(), 0)
    assert batch.values.shape == (32 * len(ASKED), 7)
    assert {len(values) for values in batch.inputs.values()} == {32 * len(ASKED)}
    assert {values.dtype for values in batch.inputs.values()} == {np.dtype(np.float16)}
    joined = join([batch, batch])
    np.testing.assert_array_equal(joined.vision[len(batch.vision) :], batch.vision)
    assert len(joined.values) == 2 * len(batch.values)


def test_a_batch_depends_on_the_seed_and_its_index_only() -> None:
    same(demonstrate_batch(task(), 1), demonstrate_batch(task(), 1))
    first = demonstrate_batch(task(), 0)
    for other in (demonstrate_batch(task(), 1), demonstrate_batch(task(seed=(0, 1)), 0)):
        assert not np.array_equal(first.position, other.position)


@pytest.mark.slow
def test_workers_decide_nothing() -> None:
    agent = untrained_network()
    here = dict(demonstrate(task(agent=agent), range(3)))
    there = dict(demonstrate(task(agent=agent), range(3), engine=Processes(2)))
    assert here.keys() == there.keys() == {0, 1, 2}
    for batch, piece in here.items():
        same(piece, there[batch])


@pytest.fixture
def ran(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """Return the batches that are run from now on."""
    batches: list[int] = []

    def watched(task: DemonstrationTask, index: int) -> Demonstrations:
        batches.append(index)
        return demonstrate_batch(task, index)

    monkeypatch.setattr(demonstrations, "demonstrate_batch", watched)
    return batches


def silent(what: str, done: int, whole: int) -> None:
    """Hear nothing."""


def test_a_folder_s_batches_are_not_run_again_and_more_are_added(tmp_path: Path, ran: list[int]) -> None:
    whole = collect(task, 3, tmp_path / "through", engine=Processes(), report=silent)
    ran.clear()
    heard: list[tuple[str, int, int]] = []
    first = collect(task, 1, tmp_path / "kept", engine=Processes(), report=silent)
    again = collect(task, 3, tmp_path / "kept", engine=Processes(), report=lambda *report: heard.append(report))
    assert ran == [0, 1, 2]
    assert heard == [("kept", 1, 3), ("kept", 2, 3), ("kept", 3, 3)]
    same(whole, again)
    same(first, demonstrate_batch(task(), 0))


@pytest.mark.parametrize("damage", ["cut", "empty", "nonsense", "others"])
def test_a_file_that_is_not_whole_is_written_anew(tmp_path: Path, ran: list[int], damage: str) -> None:
    before = collect(task, 2, tmp_path, engine=Processes(), report=silent)
    path = tmp_path / "1.safetensors"
    content = path.read_bytes()
    if damage == "others":
        path.write_bytes(demonstrations.save({"values": np.zeros((2, 7))}))
    else:
        path.write_bytes({"cut": content[:-40], "empty": b"", "nonsense": b"nonsense" * 9}[damage])
    assert read_batch(path) is None
    ran.clear()
    same(collect(task, 2, tmp_path, engine=Processes(), report=silent), before)
    assert ran == [1]
    assert path.read_bytes() == content
    assert sorted(kept.name for kept in tmp_path.iterdir()) == ["0.safetensors", "1.safetensors"]
