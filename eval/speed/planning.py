"""The speed of planning: solves of the optimal control problem, Ruckig's flights, and PPO's training."""

import math
import time
from functools import partial

import numpy as np

from ehar.data.motion_data import MotionData
from ehar.data.scenario import split_parts, windows
from ehar.envs.controls import GridControls
from ehar.envs.environment import EpisodeVectorEnv
from ehar.envs.task import EpisodeTask
from ehar.flight.kinematics import SphericalState
from ehar.flight.proposals import limits_to_target
from ehar.flight.time_optimal import TimeOptimal
from ehar.flight.vehicle import VEHICLES
from ehar.planner import Context
from ehar.sensors.perfect import PerfectSensor
from ehar.world import PAPER, ROOM, World
from eval.speed.effort import WORKERS, Effort
from eval.speed.recognition import streaming_recogniser
from planners.agents.config import PPOSetting
from planners.agents.inputs import InputSizes
from planners.agents.network import AgentNetwork, AgentSpec
from planners.agents.ppo import PPOProgress, train_ppo
from planners.search.limits import camera_limits
from planners.search.next_best_view import CLIP_HORIZON, DEFAULT_HORIZON, EFFORT_WEIGHT
from planners.search.scene import Scene
from planners.search.solver import SolverStatistics, TrajectorySolver
from planners.search.task import TrajectoryLimits, TrajectoryTask
from planners.value.view_basis import BASIS_SIZE
from recognition.torch_threads import one_torch_thread

VEHICLE = VEHICLES["px4-auto"]
ENVIRONMENTS = 64  # in which the frames per second of PPO are measured
PACE = 0.1  # largest share of the vehicle's speed and acceleration on each axis at the start of a flight
FIELD_MEMORY = 0.97  # how much of a random gain field is left one node later; the rest is new


def time_solves(data: MotionData, effort: Effort) -> dict[str, float]:
    """Return how long solves take on the grid and in flight together, and the share of plans that fell back.

    In the open, and around one person in the room.
    """
    figures: dict[str, float] = {}
    for name, world in (("nbv", PAPER), ("nbv_room", ROOM)):
        solvers = _solvers_in(world, data, effort)
        statistics = [solver.statistics for solver in solvers]
        seconds = [second for each in statistics for second in each.solve_seconds]
        figures |= {
            f"{name}_solve_ms_median": 1000 * float(np.median(seconds)),
            f"{name}_solve_ms_p95": 1000 * float(np.percentile(seconds, 95)),
            f"{name}_fallback_share": sum(each.fallbacks for each in statistics)
            / sum(each.counts.total() for each in statistics),
            f"{name}_compiled": float(all(solver.compiled for solver in solvers)),
        }
    return figures


def _solvers_in(world: World, data: MotionData, effort: Effort) -> list[TrajectorySolver]:
    """Return what solved problems in a world, on the grid and in flight; their statistics are of those solves."""
    grid_node = math.ceil((effort.length - 1) / DEFAULT_HORIZON) / data.fps
    scene = None if world.is_open else Scene.of(np.zeros((1, 3)), world.obstacles, None)
    found = []
    for vehicle, node_time in ((None, grid_node), (VEHICLE, CLIP_HORIZON[1] / DEFAULT_HORIZON)):
        rng = np.random.default_rng(0)
        context = Context(
            episodes=1,
            length=effort.length,
            frame_time=1 / data.fps,
            class_names=data.class_names,
            skeleton=data.skeleton,
            workspace=PAPER.workspace,
            track="ideal" if vehicle is None else vehicle.name,
            rng=rng,
            vehicle=vehicle,
        )
        limits = camera_limits(context, PAPER.sample_starts(rng, 1)[0], node_time)
        in_a_row, size = min(15, effort.plans), None if scene is None else scene.size
        solver = TrajectorySolver(horizon=DEFAULT_HORIZON, flown=vehicle is not None, scene=size)
        if effort.compile:
            solver.compile()
        measure_solves(
            rng,
            solver,
            limits,
            node_time=node_time,
            episodes=effort.plans // in_a_row,
            plans=in_a_row,
            world=world,
            scene=scene,
        )
        found.append(solver)
    return found


def measure_solves(
    rng: np.random.Generator,
    solver: TrajectorySolver,
    limits: TrajectoryLimits,
    *,
    node_time: float,
    episodes: int,
    plans: int,
    world: World = PAPER,
    scene: Scene | None = None,
) -> SolverStatistics:
    """Return the statistics of `episodes * plans` solves, each warm-started from the one before it.

    They plan over random gain fields that change as they go. In each episode the camera starts at rest at one of the
    world's starts and follows every plan for one node.
    """
    solver.statistics = SolverStatistics()
    horizon = solver.horizon
    gain_weights = np.full(horizon, 1 / horizon)
    for start in world.sample_starts(rng, episodes):
        state, previous = (start, np.zeros(3), np.zeros(3)), None
        field = rng.normal(size=BASIS_SIZE)
        for _ in range(plans):
            weights = np.tile(field, (horizon, 1))
            task = TrajectoryTask(
                *state, weights, gain_weights, EFFORT_WEIGHT, node_time, limits, world.workspace, scene=scene
            )
            previous = solver.solve_best(task, world.sample_starts(rng, 16), previous, node_time)
            position, velocity, acceleration, _ = previous.trajectory
            state = (position[1], velocity[1], acceleration[1])
            change = np.sqrt(1 - FIELD_MEMORY**2)
            field = FIELD_MEMORY * field + change * rng.normal(size=BASIS_SIZE)
    return solver.statistics


def time_ruckig(effort: Effort) -> float:
    """Return the seconds of one of Ruckig's calculations, between states and limits as flights meet them; median."""
    rng, flights = np.random.default_rng(0), effort.flights
    viewpoint, target = PAPER.sample_starts(rng, flights), PAPER.sample_starts(rng, flights)
    per_axis = PACE * np.stack([np.ones(flights), 1 / viewpoint[:, 0], 1 / viewpoint[:, 0]], axis=1)
    velocity, acceleration = per_axis * rng.uniform(-1, 1, (2, flights, 3))
    state = SphericalState(
        viewpoint, VEHICLE.speed * velocity, VEHICLE.acceleration * acceleration, np.zeros((flights, 3))
    )
    limits = limits_to_target(VEHICLE, state, target - viewpoint).select(0)
    optimal, seconds = TimeOptimal(), np.empty(effort.repeats)
    for repeat in range(effort.repeats):
        begin = time.perf_counter()
        optimal.durations(state, target, limits)
        seconds[repeat] = time.perf_counter() - begin
    return float(np.median(seconds) / flights)


def time_ppo(data: MotionData, effort: Effort) -> float:
    """Return the environment frames per second of PPO at its default setting, with the recogniser in the loop.

    Its environments run in `WORKERS` processes, and its updates between them in one thread, as in training.
    """
    recogniser, _ = streaming_recogniser(data)
    scenarios = windows(data, split_parts(data).policy, effort.length, 1)
    classes, moves = len(data.class_names), effort.length - 1
    sizes = InputSizes.of(
        persons=data.persons,
        joints=len(data.skeleton.joint_names),
        classes=classes,
        embedding=recogniser.embedding_size,
    )
    frames = ENVIRONMENTS * moves
    setting = PPOSetting(
        frames=(effort.rollouts + 1) * frames,
        num_envs=ENVIRONMENTS,
        minibatches=max(1, PPOSetting.minibatches * ENVIRONMENTS // PPOSetting.num_envs),  # as large as in training
    )
    task = EpisodeTask(
        scenarios=scenarios,
        recogniser=recogniser,
        sensor=PerfectSensor(),
        controls=GridControls(),
        copies=setting.copies,
    )
    ends: list[float] = []
    with one_torch_thread():
        train_ppo(
            PPOProgress(AgentNetwork(AgentSpec(sizes, hindsight=classes + 2 if setting.hindsight else 0))),
            partial(EpisodeVectorEnv, episodes=task),
            moves=moves,
            setting=setting,
            seed=0,
            fine_tune=False,
            keep=lambda _: ends.append(time.perf_counter()),
            workers=WORKERS,
        )
    return effort.rollouts * frames / (ends[-1] - ends[0])
