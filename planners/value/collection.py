"""Rollouts on training scenarios that branch to many viewpoints, to learn what other views would have given."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.data.motion_data import MotionData
from ehar.data.scenario import draw_scenarios
from ehar.data.streams.data import StreamData
from ehar.errors import DataError, EpisodeError
from ehar.planner import Context, Observation, Planner, Truth
from ehar.processes import Engine, Processes
from ehar.runner import Runner
from ehar.viewpoint import Workspace
from planners.heading import known_obstacles
from planners.value.body_filter import BodyFilter
from planners.value.line_of_sight import seen_share
from planners.value.situation import USUAL_MEMORY, coming_gains, frames_to_come
from planners.value.view_basis import DistanceRange, basis_at
from recognition.torch_threads import one_torch_thread

EPISODES = 32  # episodes that run in lockstep
PATHS = 8  # paths from a fork, one of which stays where it is
FORK_SPANS = ((0.0, 0.12), (0.12, 0.35), (0.35, 0.7))  # shares of the episode, one fork each: early choices weigh most
STREAM_SPANS = ((0.1, 0.4), (0.4, 0.7), (0.7, 1.0))  # of a window less what planners look ahead: all choices are alike
WANDER = 0.6  # the share of episodes whose camera moves before it forks
NEW_GOAL = 0.04  # the probability in each frame that a wandering camera picks a new goal
NEW_FLOWN_GOAL = 0.01  # the same with a vehicle, which takes seconds to get anywhere


@dataclass(frozen=True, eq=False)
class Collection:
    """E episodes of L frames, and N forks in them with M paths each.

    Args:
        log_probs: (E, L, K), the recogniser's log-probabilities.
        viewpoints: (E, L, 3).
        labels: (E,), the true classes; in streams (E, L), those of each frame.
        sequences: (E,), the sequence of the data that each episode is cut from.
        episode: (N,), the episode of each fork.
        frame: (N,), the last frame before the paths part.
        frames: (N,), the frames along the paths.
        facing: (N, P) [rad], the azimuths that people face, as estimated at the fork.
        facing_std: (N, P) [rad], their standard deviations.
        position: (N, P, 3) [m], the positions of people, as estimated at the fork.
        embedding: (N, D), the recogniser's embedding at the fork.
        worth: (N, M), the mean probability of the true class along each path; frames without activity count as 0.
        path: (N, M, 21), the view basis along each path, weighted by `coming_gains`, and by the share of people that
            a planner expects to see.
    """

    log_probs: FloatArray
    viewpoints: FloatArray
    labels: IntArray
    sequences: IntArray
    episode: IntArray
    frame: IntArray
    frames: IntArray
    facing: FloatArray
    facing_std: FloatArray
    position: FloatArray
    embedding: FloatArray
    worth: FloatArray
    path: FloatArray


class Forker(Planner):
    """Stays, wanders or is led; at its forks it tries paths to random viewpoints until the end of the episode.

    In a stream, the paths are as long as planners look ahead.

    Args:
        pairs: pairs of joints of the trunk, for the body filter.
        length: frames of an episode; in a stream, of a window.
        memory: time that a view counts for in a stream [s].
        lead: a planner that cameras follow instead of wandering, so that they fork where it gets to. Those that stay
            without it stay with it too.
    """

    name = "forker"
    privileged = True

    def __init__(
        self, *, pairs: IntArray, length: int, memory: float = USUAL_MEMORY, lead: Planner | None = None
    ) -> None:
        """Create the planner."""
        self.pairs, self.length, self.memory, self.lead = pairs, length, memory, lead

    def reset(self, context: Context) -> None:
        """Draw when to fork, and who moves."""
        self._context = context
        self._body = BodyFilter.of(context, self.pairs)
        # There is no plan at the last frame, and a fork needs a frame after it.
        shares, last = FORK_SPANS, self.length - 2
        if context.length is None:
            shares, last = STREAM_SPANS, max(self.length - 1 - frames_to_come(context), 0)
        spans = [sorted(int(share * last) for share in span) for span in shares]
        # Spans share their ends, and two forks at one frame would be one: each begins behind the one before.
        ends = [-1, *(high for _, high in spans[:-1])]
        begins = [min(max(low, end + 1), high) for (low, high), end in zip(spans, ends, strict=True)]
        self._at = {int(context.rng.integers(low, high + 1)) for low, (_, high) in zip(begins, spans, strict=True)}
        self._moves = context.rng.random(context.episodes) < WANDER
        self._goal = random_viewpoints(context.rng, (context.episodes,), context.workspace)
        self.forks: list[dict[str, Any]] = []
        if self.lead is not None:
            self.lead.reset(context)

    def act(self, observation: Observation) -> FloatArray:
        """Track the people, fork if it is time, and wander on, follow on or stay."""
        self._body.observe(observation)
        if observation.frame in self._at:
            self.forks.append(self._fork(observation))
        if self.lead is not None:
            self._goal = self.lead.act(replace(observation, truth=None))
        else:
            self._goal = wandering(self._goal, self._context)
        return np.where(self._moves[:, None], self._goal, observation.viewpoint)

    def _fork(self, observation: Observation) -> dict[str, Any]:
        """Return the fields of a `Collection` for one fork in each episode."""
        if observation.truth is None:
            raise EpisodeError(f"planner {self.name!r}, frame {observation.frame}: expected the truth, got None")
        workspace, here = self._context.workspace, observation.viewpoint
        goals = random_viewpoints(self._context.rng, (len(here), PATHS), workspace)
        goals[:, 0] = here
        gains = coming_gains(observation, self._context, self.memory)
        gains = gains[: self.length - 1 - observation.frame]  # a short window of a stream ends before
        classes = len(self._context.class_names) - (self._context.length is None)  # without no activity
        worth, visited = follow_paths(observation.truth, observation, goals, frames=len(gains), classes=classes)
        span = DistanceRange.of(self._context.world.workspace)
        ahead = self._context.frame_time * np.arange(1, len(gains) + 1)
        obstacles, passers = known_obstacles(self._context, observation), observation.passers
        along = visited.swapaxes(1, 2)  # (B, R, M, 3)
        seen = seen_share(along, self._body.position, obstacles, passers, ahead, observation.centre)
        return {
            "episode": np.arange(len(here)),
            "frame": np.full(len(here), observation.frame),
            "frames": np.full(len(here), len(gains)),
            "facing": self._body.facing,
            "facing_std": self._body.facing_std,
            "position": self._body.position.copy(),
            "embedding": observation.embedding.astype(np.float64),
            "worth": worth,
            "path": np.einsum("bmhk,bhm,h->bmk", basis_at(visited, span), seen, gains),
        }


def follow_paths(
    truth: Truth, observation: Observation, goals: FloatArray, *, frames: int, classes: int
) -> tuple[FloatArray, FloatArray]:
    """Go to goals (B, M, 3) by grid moves or in flight and stay there, for some frames from the present state.

    Args:
        truth: the truth after the present frame, whose motion can be forked.
        observation: the observation of the present frame.
        goals: (B, M, 3).
        frames: number R of frames to come.
        classes: number K of activities; frames that show none count as 0, as no benchmark asks for them.

    Returns:
        the mean probability of the true class over the frames to come, (B, M), and the viewpoints (B, M, R, 3).
    """
    assert truth.fork_motion is not None
    motion, state = truth.fork_motion(goals.shape[1]), truth.state.fork(goals.shape[1])
    visited = np.empty((*goals.shape[:2], frames, 3))
    worth = np.zeros(goals.shape[:2])
    for step in range(frames):
        viewpoint = motion.advance(goals.reshape(-1, 3)).reshape(goals.shape)
        recognition, state = truth.imagine(state, observation.frame + 1 + step, viewpoint)
        visited[:, :, step] = viewpoint
        labels = truth.frame_labels[:, observation.frame + 1 + step]
        of_true = np.exp(np.take_along_axis(recognition.log_probs, labels[:, None, None], axis=2)[..., 0])
        worth += of_true * (labels < classes)[:, None]
    return worth / frames, visited


def random_viewpoints(rng: np.random.Generator, leading: tuple[int, ...], workspace: Workspace) -> FloatArray:
    """Return viewpoints (*leading, 3), uniform over the three coordinates of the workspace."""
    low = [workspace.distance_min, 0.0, workspace.polar_min]
    high = [workspace.distance_max, 2 * np.pi, workspace.polar_max]
    return rng.uniform(low, high, size=(*leading, 3))


def wandering(goal: FloatArray, context: Context) -> FloatArray:
    """Return the goals (B, 3) of wandering cameras, some of them drawn anew."""
    share = NEW_GOAL if context.vehicle is None else NEW_FLOWN_GOAL
    anew = context.rng.random(len(goal)) < share
    return np.where(anew[:, None], random_viewpoints(context.rng, anew.shape, context.workspace), goal)


@dataclass(frozen=True, eq=False)
class CollectionTask:
    """Everything needed to run batches of branching episodes.

    Args:
        runner: runs the episodes.
        sequences: the sequences of the policy part that are long enough.
        length: number L of frames of an episode.
        pairs: pairs of joints of the trunk.
        seed: seed of all random numbers.
        memory: time that a view counts for in a stream [s].
        lead: a planner to follow instead of wandering.
    """

    runner: Runner
    sequences: IntArray
    length: int
    pairs: IntArray
    seed: int
    memory: float = USUAL_MEMORY
    lead: Planner | None = None


def run_batches(
    task: CollectionTask, batches: Sequence[int], *, engine: Engine | None = None
) -> Iterator[tuple[int, Collection]]:
    """Run batches of branching episodes and yield each when it is done; results do not depend on the engine.

    Raises:
        DataError: no sequence has `length` frames.
    """
    if len(task.sequences) == 0:
        raise DataError(
            f"{task.runner.data.name}: expected policy sequences of at least {task.length} frames, got none"
        )
    yield from (engine or Processes()).each_batch(collect_batch, task, batches)


@one_torch_thread()
def collect_batch(task: CollectionTask, index: int) -> Collection:
    """Run one batch of episodes; its random numbers depend only on the seed, its index, and whether it is led."""
    led = () if task.lead is None else (1,)  # else led cameras would watch what was watched before
    rng = np.random.default_rng([task.seed, *led, index])
    data = task.runner.data
    assert isinstance(data, MotionData | StreamData)
    scenarios = draw_scenarios(data, task.sequences, task.length, rng, EPISODES)
    batch = task.runner.batch(scenarios, np.arange(EPISODES), task.runner.world.sample_starts(rng, EPISODES), rng)
    forker = Forker(pairs=task.pairs, length=task.length, memory=task.memory, lead=task.lead)
    record = task.runner.roll(forker, batch, rng)
    forks = {name: np.concatenate([fork[name] for fork in forker.forks]) for name in forker.forks[0]}
    return Collection(
        log_probs=record.log_probs,
        viewpoints=record.viewpoints,
        labels=batch.labels,
        sequences=scenarios.sequence,
        **forks,
    )


def join(pieces: Sequence[Collection]) -> Collection:
    """Join collections into one."""
    begins = np.cumsum([0, *(len(piece.labels) for piece in pieces)])
    joined = {
        field.name: np.concatenate([getattr(piece, field.name) for piece in pieces]) for field in fields(Collection)
    }
    joined["episode"] = np.concatenate(
        [piece.episode + begin for piece, begin in zip(pieces, begins[:-1], strict=True)]
    )
    return Collection(**joined)
