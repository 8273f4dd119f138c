"""Demonstrations: the agent's inputs, and the worth of its 7 moves according to a teacher who knows the label.

They are kept in a folder, batch by batch, so a training that was stopped does not run them again.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load_file, save

from ehar.arrays import FloatArray, IntArray
from ehar.data.scenario import Scenarios
from ehar.data.streams.scenario import StreamScenarios
from ehar.files import write_bytes
from ehar.planner import Context, Observation, Planner, Truth
from ehar.processes import Engine, Processes
from ehar.runner import Runner
from ehar.viewpoint import HOVER, MOVES
from planners.agents.agent import decide
from planners.agents.config import Teacher
from planners.agents.inputs import POSITION, RECOGNITION, VISION, AgentInputs, Inputs, seen_by_agent
from planners.agents.network import AgentNetwork
from planners.heading import carried, move_target
from planners.oracle import (
    FLOWN_COMMIT,
    flown_frames,
    grid_motion,
    shown_worth,
    true_log_probs,
    truth_of,
    try_moves,
    worth_of_flights,
)
from planners.value.collection import random_viewpoints, wandering
from recognition.torch_threads import one_torch_thread

EPISODES = 32  # episodes that run in lockstep
HORIZON = 15  # frames for which the look-ahead teacher repeats a move on the grid
EVERY = 5  # frames from one look ahead to the next: its result changes slowly, and costs 7 HORIZON recognised frames
ON_TOP = 0.5  # the extra worth of a correct recognition, for the look-ahead teacher
WANDER = 0.8  # the share of the wanderer's episodes whose camera moves: the agent will get everywhere


@dataclass(frozen=True, eq=False)
class Demonstrations:
    """N demonstrated frames.

    Args:
        recognition: (N, ...) float16, the inputs of f^A.
        vision: (N, ...) float16, the inputs of f^V.
        position: (N, 4) float16, in flight (N, 7), the inputs of f^P; 6 more where something is in the way.
        values: (N, 7), the worth of each move. For the oracle, it is the log-probability of the true label after the
            move [nat]. For the look-ahead teacher, it is a sum over frames of the true label's probability, plus
            `ON_TOP` for each frame where this label is on top.
    """

    recognition: FloatArray
    vision: FloatArray
    position: FloatArray
    values: FloatArray

    @property
    def inputs(self) -> Inputs:
        """The inputs of the network."""
        return {RECOGNITION: self.recognition, VISION: self.vision, POSITION: self.position}


class Demonstrator(Planner):
    """Asks the teacher, keeps its answers, and acts like the agent, or without an agent like the teacher.

    Args:
        teacher: the teacher to ask.
        agent: the agent that acts (DAgger, Ross et al. 2011); None lets the teacher act. The look-ahead teacher only
            judges moves, so a wanderer acts in its place.
    """

    name = "demonstrator"
    privileged = True

    def __init__(self, *, teacher: Teacher, agent: AgentNetwork | None) -> None:
        """Create the planner."""
        self.teacher = teacher
        self.agent = agent

    def reset(self, context: Context) -> None:
        """Forget everything, and draw who wanders."""
        self._context = context
        self._every = EVERY if context.vehicle is None else flown_frames(FLOWN_COMMIT, context)
        self._asked_at = min(EVERY // 2, self._every - 1)  # early, so that short episodes are asked about too
        self._inputs = AgentInputs.of(context)
        self._wanders = context.rng.random(context.episodes) < WANDER
        self._goal = random_viewpoints(context.rng, (context.episodes,), context.workspace)
        self.inputs: list[Inputs] = []
        self.values: list[FloatArray] = []

    def act(self, observation: Observation) -> FloatArray:
        """Ask the teacher, keep its answer, and act."""
        flown, distances = self._context.vehicle is not None, bool(self._context.world.obstacles)
        inputs = self._inputs.see(seen_by_agent(observation, self._context, flown=flown, distances=distances))
        best = self._ask(observation, inputs)
        if self.agent is not None:
            best, _ = decide(self.agent, inputs)
        elif self.teacher == "oracle-lookahead":
            return self._wander(observation)
        return move_target(self._context, observation.viewpoint, best)

    def _ask(self, observation: Observation, inputs: Inputs) -> IntArray:
        """Return the teacher's best moves (B,), and keep its answer; on frames without one, return hover."""
        truth = truth_of(self, observation)
        if self.teacher == "oracle":
            frame = observation.frame + 1
            motion = grid_motion(truth, self._context, len(MOVES))
            _, log_probs, best, _ = try_moves(truth, truth.state, frame, observation.viewpoint, self._context, motion)
            values = true_log_probs(log_probs, truth)
        elif observation.frame % self._every == self._asked_at and observation.frame < truth.length - 2:
            values = look_ahead(truth, observation, self._context)
            best = values.argmax(axis=1)
        else:
            return np.full(len(observation.viewpoint), HOVER)
        self.inputs.append(inputs)
        self.values.append(values)
        return best

    def _wander(self, observation: Observation) -> FloatArray:
        self._goal = wandering(self._goal, self._context)
        return np.where(self._wanders[:, None], self._goal, observation.viewpoint)


def look_ahead(truth: Truth, observation: Observation, context: Context) -> FloatArray:
    """Return the worth (B, 7) of repeating each move for `HORIZON` frames or to the end, a sum over frames.

    A vehicle heads for where the move leads in a second, as the agent's moves do, and is followed for 3 s. In a stream,
    frames that show no activity are worth 0, as no benchmark asks for them.
    """
    moves = np.broadcast_to(np.arange(len(MOVES)), (len(truth.labels), len(MOVES)))
    viewpoint = np.repeat(observation.viewpoint[:, None], len(MOVES), axis=1)
    if context.vehicle is not None:
        ends = move_target(context, viewpoint, moves)
        return worth_of_flights(truth, observation.frame, ends, context, on_top=ON_TOP)
    motion, state = grid_motion(truth, context, len(MOVES)), truth.state.fork(len(MOVES))
    values = np.zeros(moves.shape)
    for frame in range(observation.frame + 1, min(observation.frame + 1 + HORIZON, truth.length)):
        viewpoint = carried(motion, context, viewpoint, moves)
        recognition, state = truth.imagine(state, frame, viewpoint)
        values += shown_worth(recognition.log_probs, truth, frame, context, on_top=ON_TOP)
    return values


@dataclass(frozen=True, eq=False)
class DemonstrationTask:
    """Everything needed to run batches of demonstrated episodes.

    Args:
        runner: runs the episodes.
        scenarios: the scenarios that episodes are drawn from.
        teacher: the teacher to ask.
        agent: the agent that acts; None lets the teacher act.
        seed: seed of all random numbers.
    """

    runner: Runner
    scenarios: Scenarios | StreamScenarios
    teacher: Teacher
    agent: AgentNetwork | None
    seed: tuple[int, ...]


def demonstrate(
    task: DemonstrationTask, batches: Sequence[int], *, engine: Engine | None = None
) -> Iterator[tuple[int, Demonstrations]]:
    """Run batches of episodes and yield each when it is done; results do not depend on the engine."""
    yield from (engine or Processes()).each_batch(demonstrate_batch, task, batches)


@one_torch_thread()
def demonstrate_batch(task: DemonstrationTask, index: int) -> Demonstrations:
    """Run one batch of episodes; its random numbers depend only on the seed and its index."""
    rng = np.random.default_rng([*task.seed, index])
    chosen = rng.integers(len(task.scenarios), size=EPISODES)
    batch = task.runner.batch(task.scenarios, chosen, task.runner.world.sample_starts(rng, EPISODES), rng)
    demonstrator = Demonstrator(teacher=task.teacher, agent=task.agent)
    task.runner.roll(demonstrator, batch, rng)
    inputs = {name: np.concatenate([seen[name] for seen in demonstrator.inputs]) for name in demonstrator.inputs[0]}
    kept = {name: values.astype(np.float16) for name, values in inputs.items()}  # 10,000 episodes are half a gigabyte
    return Demonstrations(**kept, values=np.concatenate(demonstrator.values))


def join(pieces: Sequence[Demonstrations]) -> Demonstrations:
    """Join demonstrations into one."""
    return Demonstrations(
        **{
            name.name: np.concatenate([getattr(piece, name.name) for piece in pieces])
            for name in fields(Demonstrations)
        }
    )


def collect(
    task: Callable[[], DemonstrationTask],
    batches: int,
    folder: Path,
    *,
    engine: Engine,
    report: Callable[[str, int, int], None],
) -> Demonstrations:
    """Return the demonstrations of all batches; those in the folder are read, and the missing ones are run.

    A file that was cut short, or is not ours, counts as missing and is written anew.

    Args:
        task: returns the task; called only if a batch is missing, as it takes time to clone the agent that acts.
        batches: number of batches.
        folder: the folder of this task.
        engine: runs the batches.
        report: called with progress.
    """
    pieces = {batch: piece for batch in range(batches) if (piece := read_batch(folder / f"{batch}.safetensors"))}
    missing = [batch for batch in range(batches) if batch not in pieces]
    report(folder.name, len(pieces), batches)
    for batch, piece in demonstrate(task(), missing, engine=engine) if missing else ():
        pieces[batch] = piece
        tensors = {field.name: np.ascontiguousarray(getattr(piece, field.name)) for field in fields(Demonstrations)}
        write_bytes(folder / f"{batch}.safetensors", save(tensors))
        report(folder.name, len(pieces), batches)
    return join([pieces[batch] for batch in range(batches)])


def read_batch(path: Path) -> Demonstrations | None:
    """Return a batch that was kept; None if it is missing or not whole."""
    try:
        return Demonstrations(**load_file(path))
    except (OSError, SafetensorError, TypeError, ValueError):
        return None
