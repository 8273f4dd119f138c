"""Agents on streams: a memory that fades, no time, ends that are none, and weights that are not those of clips."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces

from ehar.arrays import FloatArray
from ehar.batch import Batch, noise_of
from ehar.conditions import Conditions
from ehar.data.scenario import windows
from ehar.envs.controls import GridControls
from ehar.envs.environment import EpisodeVectorEnv
from ehar.envs.task import EpisodeTask
from ehar.errors import ModelError, UsageError
from ehar.flight.centre import around_centre
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import VEHICLES, Vehicle
from ehar.motion import GridMotion, Motion
from ehar.planner import Observation
from ehar.rollout import Record, rollout
from ehar.runner import Runner
from ehar.sensors.perfect import PerfectSensor
from ehar.track import load_track
from ehar.viewpoint import DISTANCE, Workspace, apply_moves
from ehar.world import PAPER, ROOM
from planners.agents.agent import Agent
from planners.agents.config import AgentTrainingConfig, PPOSetting
from planners.agents.demonstrations import HORIZON, Demonstrator
from planners.agents.inputs import MEMORY, POSITION, RECOGNITION, AgentInputs, InputSizes, seen_by_agent
from planners.agents.network import AgentNetwork, AgentSpec
from planners.agents.ppo import PPOProgress, train_ppo
from planners.agents.storage import agent_path, agent_seeds, load_agent, save_agent
from planners.agents.vector_env import AgentVecEnv
from planners.agents.world import HeadingControls
from planners.heading import move_target
from tests.helpers.agents import random_observation, save_untrained, untrained_network
from tests.helpers.fakes import SKELETON, tiny_context, tiny_data
from tests.helpers.streams import StreamRecogniser, raising_streams

EPISODES, LENGTH = 4, 35
STREAMS = raising_streams()
CLASSES = len(STREAMS.recognised_names)  # three activities, and none


def stream_network(**chosen: Any) -> AgentNetwork:
    sizes = InputSizes.of(
        persons=1, joints=len(SKELETON.joint_names), classes=CLASSES, embedding=CLASSES - 1, streams=True
    )
    return AgentNetwork(AgentSpec(sizes, streams=True, **chosen), classes=CLASSES)


def stream_env(episodes: int, *, copies: int = 1) -> EpisodeVectorEnv:
    task = EpisodeTask(
        scenarios=windows(STREAMS, np.arange(6), LENGTH, 1),
        recogniser=StreamRecogniser(),
        sensor=PerfectSensor(),
        controls=GridControls(),
        copies=copies,
    )
    return EpisodeVectorEnv(episodes, task)


def shown(embedding: FloatArray) -> dict[str, FloatArray]:
    """Return what is shown of one frame of a stream, (B, D) embeddings and nobody to be seen."""
    episodes = len(embedding)
    return {
        "joints": np.zeros((episodes, 1, 2, 2), dtype=np.float32),
        "confidence": np.zeros((episodes, 1, 2), dtype=np.float32),
        "viewpoint": np.zeros((episodes, 4), dtype=np.float32),
        "probabilities": np.full((episodes, 2), 0.5, dtype=np.float32),
        "embedding": embedding.astype(np.float32),
        "time": np.zeros((episodes, 1), dtype=np.float32),
    }


def test_the_mean_of_embeddings_fades_and_nothing_tells_the_time() -> None:
    inputs, kept = AgentInputs(0.1), np.exp(-0.1 / MEMORY)
    for number in (1.0, 5.0):
        seen = inputs.see(shown(np.array([[number]])))[RECOGNITION]
    expected = [5, (kept * 1 + 5) / (kept + 1), np.log(0.5), np.log(0.5)]
    np.testing.assert_allclose(seen, [expected], rtol=1e-6)


def test_after_minutes_an_agent_sees_what_it_sees_after_half_a_minute() -> None:
    embeddings = np.random.default_rng(0).normal(size=(2_000, 3, 4))
    long, short = AgentInputs(0.1), AgentInputs(0.1)
    for frame, embedding in enumerate(embeddings):
        after = long.see(shown(embedding))[RECOGNITION]
        if frame >= 1_700:
            fresh = short.see(shown(embedding))[RECOGNITION]
    np.testing.assert_allclose(after, fresh, atol=1e-6)


def test_an_episode_is_cut_and_its_value_goes_on() -> None:
    env = AgentVecEnv(stream_env, num_envs=4, seed=0, hold=5)
    seen: Any = env.reset()
    assert {name: values.shape[1] for name, values in seen.items() if name in vars(stream_network().spec.sizes)} == (
        vars(stream_network().spec.sizes)
    )
    for step in range(7):
        _, _, dones, infos = env.step(np.zeros(4, dtype=np.int64))
        assert dones.all() == (step == 6)
    assert all(info["TimeLimit.truncated"] and RECOGNITION in info["terminal_observation"] for info in infos)


def test_ppo_learns_in_windows_of_streams() -> None:
    network = stream_network(hindsight=CLASSES + 2)
    before = [weight.clone() for weight in network.parameters()]
    setting = PPOSetting(frames=(LENGTH - 1) * 8, num_envs=8, copies=4)
    heard: list[PPOProgress] = []
    train_ppo(
        PPOProgress(network),
        partial(stream_env, copies=4),
        moves=LENGTH - 1,
        setting=setting,
        seed=0,
        fine_tune=False,
        keep=heard.append,
    )
    assert heard[0].rollouts == 1 and np.isfinite(heard[0].history[0]["return"])
    assert any((old != new).any() for old, new in zip(before, network.parameters(), strict=True))


def watched(
    planner: Any,
    *,
    recogniser: StreamRecogniser | None = None,
    motion: Motion | None = None,
    vehicle: Vehicle | None = None,
) -> tuple[Batch, Record]:
    rng = np.random.default_rng(3)
    scenarios = windows(STREAMS, np.arange(6), LENGTH, 1)
    starts = PAPER.sample_starts(rng, EPISODES)
    batch = Batch.of(scenarios, np.array([0, 40, 90, 130]), starts, noise_of(scenarios, EPISODES, rng))
    told = {"length": None, "frame_time": 0.1, "class_names": STREAMS.recognised_names, "vehicle": vehicle}
    context = replace(tiny_context(episodes=EPISODES), **told)  # type: ignore[arg-type]
    seen, body = recogniser or StreamRecogniser(), motion or GridMotion()
    return batch, rollout(planner, batch, seen, PerfectSensor(), body, context)


def test_labels_of_a_window_are_those_that_were_chosen() -> None:
    scenarios = windows(STREAMS, np.arange(6), LENGTH, 1)
    batch, _ = watched(Demonstrator(teacher="oracle", agent=None))
    np.testing.assert_array_equal(batch.labels, scenarios.labels[[0, 40, 90, 130]])


def test_a_move_is_worth_what_it_leads_to_in_frames_that_show_an_activity() -> None:
    demonstrator = Demonstrator(teacher="oracle-lookahead", agent=None)
    batch, record = watched(demonstrator)
    number, frame = 3, 17  # the fourth time that the teacher is asked
    shows = batch.labels[:, frame + 1 : frame + 1 + HORIZON] < CLASSES - 1
    assert shows.any() and not shows.all()  # there are both kinds of frames ahead
    for move in (0, 3, 4):
        path = list(np.moveaxis(record.viewpoints, 1, 0)[: frame + 1])
        recogniser, worth = StreamRecogniser(), np.zeros(EPISODES)
        state: Any = recogniser.start(EPISODES)
        for at in range(frame + 1 + HORIZON):
            if at > frame:
                path.append(apply_moves(path[-1], np.full(EPISODES, move), Workspace()))
            sensed = PerfectSensor().sense(batch.positions[:, at], path[at], batch.noise.frame(at))
            recognition, state = recogniser.step(state, sensed, path[at])
            label = batch.labels[:, at]
            right = recognition.log_probs.argmax(axis=1) == label
            if at > frame:
                probability = np.exp(recognition.log_probs[np.arange(EPISODES), label])
                worth += (label < CLASSES - 1) * (probability + 0.5 * right)
        np.testing.assert_allclose(demonstrator.values[number][:, move], worth, rtol=1e-4, atol=1e-6)


def test_in_flight_a_move_is_flown_as_the_agent_would_fly_it_and_watched_for_three_seconds() -> None:
    drone = VEHICLES["px4-auto"]
    heard: list[FloatArray] = []

    class Still(Demonstrator):
        def _wander(self, observation: Observation) -> FloatArray:
            return observation.viewpoint

    class Listener(StreamRecogniser):
        def step(self, state: Any, sensed: Any, viewpoint: FloatArray) -> Any:
            if viewpoint.ndim == 3:
                heard.append(viewpoint)
            return super().step(state, sensed, viewpoint)

    demonstrator = Still(teacher="oracle-lookahead", agent=None)
    batch, record = watched(demonstrator, recogniser=Listener(), vehicle=drone, motion=FlightMotion(vehicle=drone))
    asked = range(2, LENGTH - 2, 5)  # twice a second, at 10 frames/s
    assert len(demonstrator.values) == len(asked)
    assert len(heard) == sum(min(30, LENGTH - 1 - frame) for frame in asked)
    here, flown = record.viewpoints[:, asked[0]], np.stack(heard[:30], axis=2)  # (B, 7, 30, 3)
    context = replace(tiny_context(), length=None, frame_time=0.1, vehicle=drone)
    for move in range(7):
        end = move_target(context, here, np.full(EPISODES, move))
        assert (np.abs(flown[:, move, -1] - end) <= 0.5 * np.abs(end - here) + 1e-3).all()  # more than half the way
    speed = np.abs(np.diff(flown[:, :, :, DISTANCE], axis=2)) / 0.1
    assert speed[..., 0].max() < 0.2 * speed.max()  # it sets off from rest
    shown = batch.labels[:, asked[0] + 1 : asked[0] + 31] < CLASSES - 1
    assert (demonstrator.values[0] <= 1.5 * shown.sum(axis=1)[:, None] + 1e-6).all()


def test_an_agent_of_flights_sees_its_velocity_as_the_environment_shows_it() -> None:
    track, rng = load_track("px4-auto"), np.random.default_rng(0)
    runner = Runner(STREAMS, StreamRecogniser(), PerfectSensor(), track=track)
    controls = HeadingControls(runner)
    assert controls.motion.vehicle == around_centre(VEHICLES["px4-auto"])
    starts = PAPER.sample_starts(rng, 3)
    controls.motion.reset(starts, 0.1)
    for _ in range(4):
        here = controls.motion.advance(controls.targets(np.array([0, 2, 5]), starts, ""))
    shown_there = controls.observations()["velocity"]
    assert (np.abs(shown_there[[0, 1, 2], [0, 1, 2]]) > 0.05).all()
    observation = replace(
        random_observation(rng, episodes=3), length=None, viewpoint=here, velocity=controls.motion.velocity
    )
    context = runner.context(3, None, rng)
    seen = AgentInputs.of(context).see(seen_by_agent(observation, context, flown=True, distances=False))
    np.testing.assert_array_equal(seen[POSITION][:, 4:], shown_there)
    at_rest = AgentInputs.of(context).see(seen_by_agent(observation, context, flown=False, distances=False))
    np.testing.assert_array_equal(at_rest[POSITION], seen[POSITION][:, :4])


@pytest.mark.parametrize("track", ["ideal", "px4-auto"])
def test_an_agent_of_a_room_sees_how_far_it_may_go_as_the_environment_shows_it(track: str) -> None:
    runner = Runner(STREAMS, StreamRecogniser(), PerfectSensor(), track=load_track(track), world=ROOM)
    controls = HeadingControls(runner) if track != "ideal" else GridControls(world=ROOM, moving_centre=True)
    task = EpisodeTask(
        scenarios=runner.followed_everywhere(windows(STREAMS, np.arange(len(STREAMS.lengths)), 40, 1)),
        recogniser=runner.recogniser,
        sensor=runner.sensor,
        controls=controls,
        world=ROOM,
    )
    env = EpisodeVectorEnv(3, task)
    shown, _ = env.reset(seed=1)
    for _ in range(5):
        shown, *_ = env.step(np.array([0, 2, 5]))
    assert env.observation_space.contains(shown)
    assert shown["distances"].shape == (3, 6) and (shown["distances"] < 1).any()
    around = task._batch.surroundings
    assert around is not None and around.moved is not None
    rng, moved = np.random.default_rng(0), around.moved[:, task.frame]
    observation = replace(random_observation(rng, episodes=3), length=None, viewpoint=task.viewpoint, centre=moved)
    context, flown = runner.context(3, None, rng), track != "ideal"
    seen = AgentInputs.of(context).see(seen_by_agent(observation, context, flown=flown, distances=True))
    np.testing.assert_array_equal(seen[POSITION][:, -6:], shown["distances"])
    # An agent that was trained in the open sees none of it; one of a room that watches in the open may go anywhere.
    unaware = AgentInputs.of(context).see(seen_by_agent(observation, context, flown=flown, distances=False))
    np.testing.assert_array_equal(unaware[POSITION], seen[POSITION][:, :-6])
    opened = replace(context, world=PAPER)
    anywhere = AgentInputs.of(opened).see(seen_by_agent(observation, opened, flown=flown, distances=True))
    assert (anywhere[POSITION][:, -6:] == 1).all()
    space = AgentVecEnv(lambda episodes: EpisodeVectorEnv(episodes, task), num_envs=1, seed=0).observation_space
    sizes = InputSizes.of(persons=1, joints=1, classes=1, embedding=1, streams=True, flown=flown, distances=True)
    assert isinstance(space, spaces.Dict) and space[POSITION].shape == (sizes.position,)
    assert (sizes.flown, sizes.distances) == (flown, True)


def test_agents_of_clips_do_not_watch_streams_nor_the_other_way_round(tmp_path: Path) -> None:
    clips, streams = (Agent(name="il", network=network) for network in (untrained_network(), stream_network()))
    with pytest.raises(UsageError, match="planner 'il': got an agent of clips, expected one of streams"):
        clips.reset(replace(tiny_context(), length=None))
    with pytest.raises(UsageError, match="planner 'il': got an agent of streams, expected one of clips"):
        streams.reset(tiny_context())
    data = tiny_data()

    def load(trained_on: Any) -> Agent:
        return load_agent(
            Conditions(data=trained_on, models=tmp_path), trained_on, "il", recogniser_sha256="fake", seed=0
        )

    save_untrained(tmp_path, data, "il")
    with pytest.raises(ModelError, match=r"seed0\.safetensors: trained on clips, raising holds streams; train the ag"):
        load(STREAMS)
    path = agent_path(tmp_path, "il", Conditions(), 0)
    history = {"run": {"length": 80}}
    save_agent(path, streams.network, STREAMS, recogniser_sha256="fake", history=history)
    with pytest.raises(ModelError, match=r"seed0\.safetensors: trained on streams, tiny holds clips; train the agent"):
        load(data)
    found = load(STREAMS)
    assert found.network.spec.streams and found.length is None  # a window is no clip
    watched(found)


def test_in_flight_agents_are_those_of_the_track_or_else_of_the_grid(tmp_path: Path) -> None:
    def seeds(track: Any) -> tuple[int, ...]:
        return agent_seeds(Conditions(data=STREAMS, models=tmp_path, track=track), STREAMS, "il")

    def save(track: Any, seed: int) -> Path:
        path = agent_path(tmp_path, "il", Conditions(track=track), seed)
        save_agent(path, stream_network(), STREAMS, recogniser_sha256="fake", history={})
        return path

    assert save("ideal", 3).name == "agent-il-perfect-moving-seed3.safetensors"
    assert seeds("ideal") == seeds("px4-auto") == (3,)
    assert save("px4-auto", 7).name == "agent-il-perfect-moving-px4-auto-seed7.safetensors"
    assert save(tmp_path / "my kite.json", 8).name == "agent-il-perfect-moving-my-kite-seed8.safetensors"
    assert (seeds("ideal"), seeds("px4-auto"), seeds("my kite"), seeds("px4-max")) == ((3,), (7,), (8,), (3,))
    flying = Conditions(data=STREAMS, models=tmp_path, track="px4-auto")
    load_agent(flying, STREAMS, "il", recogniser_sha256="fake", seed=7)
    with pytest.raises(ModelError, match=r"px4-auto-seed3\.safetensors: no such file"):
        load_agent(flying, STREAMS, "il", recogniser_sha256="fake", seed=3)


def streaming(**changes: Any) -> AgentTrainingConfig:
    return AgentTrainingConfig(conditions=Conditions(data="solo-stream"), out=Path("m"), **changes)


def test_windows_of_streams_are_longer_than_clips_so_there_are_fewer() -> None:
    config = streaming()
    assert (config.imitation("il").episodes, config.imitation("dagger").episodes) == (384, 384)
    assert (config.ppo.frames, config.ppo.num_envs, config.variations_of_each) == (2_400_000, 128, 3)
    assert streaming(episodes=5, frames=6).imitation("il").episodes == 5


def test_in_flight_a_drawn_move_is_flown_for_a_second() -> None:
    flown = replace(streaming(), conditions=Conditions(data="solo-stream", track="px4-auto")).ppo
    assert [flown.at(fps).hold for fps in (60, 15, 0.1)] == [60, 15, 1]
    assert flown.at(60).hold_s is None and flown.learning_rate > streaming().ppo.learning_rate
    assert streaming().ppo.at(60).hold == 5
    clips = replace(streaming(), conditions=Conditions(data="solo", track="px4-auto")).ppo
    assert clips.hold_s is None


@pytest.mark.parametrize(
    ("config", "option"),
    [
        (partial(streaming, setting="paper"), "--setting paper"),
        (partial(streaming, without="time"), "--without time"),
    ],
)
def test_what_only_clips_have_is_refused(config: Callable[[], AgentTrainingConfig], option: str) -> None:
    changes = {"views": "paper", "form": "ctrgcn"} if option == "--setting paper" else {}
    told = config()
    with pytest.raises(UsageError, match=f"{option}: expected trimmed sequences, got streams"):
        replace(told, conditions=replace(told.conditions, **changes)).check()
