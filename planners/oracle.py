"""Upper bounds: planners that know the label and the future, and try their moves before they make them.

`oracle` tries the moves of the grid on every track. A vehicle does not make such a move within a frame. So on a
vehicle's track it heads in the direction of the best move, and is no upper bound. `oracle-lookahead` tries what the
vehicle can fly.
"""

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.errors import EpisodeError, UsageError
from ehar.flight.vehicle import Vehicle
from ehar.motion import GridMotion
from ehar.planner import Context, Observation, Planner, Truth
from ehar.track import IDEAL
from ehar.viewpoint import MOVES
from planners.heading import axis_ways, carried, move_target

FLOWN_HORIZON = 3.0  # [s] that flights are imagined; a vehicle takes seconds to get anywhere
FLOWN_COMMIT = 0.5  # [s] from one choice of a flight to the next
DIRECTIONS = np.array([way for way in product((-1, 0, 1), repeat=3) if any(way)], dtype=np.float64)
WAYS = DIRECTIONS / np.linalg.norm(DIRECTIONS, axis=1)[:, None]  # (26, 3), along axes and between them


class Oracle(Planner):
    """The paper's oracle (Sec. 3): the move whose next frame gives the lowest cross-entropy of the true label."""

    name = "oracle"
    privileged = True

    def reset(self, context: Context) -> None:
        """Take the track."""
        self._context = context

    def act(self, observation: Observation) -> FloatArray:
        """Return the best of the 7 neighbouring viewpoints of each episode; a vehicle heads a second that way."""
        truth = truth_of(self, observation)
        frame = observation.frame + 1
        motion = grid_motion(truth, self._context, len(MOVES))
        _, _, best, _ = try_moves(truth, truth.state, frame, observation.viewpoint, self._context, motion)
        return move_target(self._context, observation.viewpoint, best)


class OracleLookahead(Planner):
    r"""The best of 8 paths over several frames: each of the 7 moves repeated, and the greedy oracle's path.

    The worth of a path of H frames is the mean of :math:`[\hat{y}_h = y] + p_h(y)` over its frames. It counts how
    often the true label y is on top, and how probable the label is. So a path that only comes near has some worth too.
    The greedy path is among the candidates, so the choice is never worse than greedy over the planned frames. A
    repeated move gets through viewpoints that are worse before they are better; a greedy path turns round there.

    With a vehicle the paths are flights of 3 s, chosen anew every half second: one stays, 26 go along the axes and
    between them. In streams the frames of a path may show several activities, and those that show none count as 0.

    Args:
        horizon: number H of frames that are imagined on the grid; fewer at the end of the episode.
        commit: number of frames of the best path there before the next plan. A step costs 14 `horizon` / `commit`
            recognised frames.
    """

    name = "oracle-lookahead"
    privileged = True

    def __init__(self, *, horizon: int = 20, commit: int = 15) -> None:
        """Create the planner."""
        if not 1 <= commit <= horizon:
            raise UsageError(f"oracle-lookahead: expected 1 <= commit <= horizon, got {commit} and {horizon}")
        self.horizon = horizon
        self.commit = commit

    def reset(self, context: Context) -> None:
        """Forget the path."""
        self._context = context
        self._path: FloatArray = np.empty((context.episodes, 0, 3))
        self._goal: FloatArray | None = None
        self._planned_at = 0

    def act(self, observation: Observation) -> FloatArray:
        """Return the next viewpoints of the best paths, in flight their ends; plan every `commit` frames."""
        truth = truth_of(self, observation)
        done = observation.frame - self._planned_at
        vehicle = self._context.vehicle
        if truth.fork_motion is not None and vehicle is not None:
            if self._goal is None or done >= flown_frames(FLOWN_COMMIT, self._context):
                ends = self._flight_ends(observation.viewpoint, vehicle)
                worth = worth_of_flights(truth, observation.frame, ends, self._context)
                self._goal, self._planned_at = ends[np.arange(len(ends)), worth.argmax(axis=1)], observation.frame
            return self._goal
        if done >= min(self.commit, self._path.shape[1]):
            self._path = self._plan(truth, observation)
            self._planned_at, done = observation.frame, 0
        return self._path[:, done if vehicle is None else -1]

    def _flight_ends(self, here: FloatArray, vehicle: Vehicle) -> FloatArray:
        """Return where flights from viewpoints (B, 3) may end, (B, 27, 3): here, and a second's way off."""
        ways = WAYS * axis_ways(vehicle, here)[:, None]
        stay = here[:, None]
        return self._context.workspace.clip(np.concatenate([stay, stay + ways], axis=1))

    def _worth(self, log_probs: FloatArray, truth: Truth, frame: int) -> FloatArray:
        return shown_worth(log_probs, truth, frame, self._context)

    def _plan(self, truth: Truth, observation: Observation) -> FloatArray:
        """Return the best path of each episode, (B, H, 3)."""
        horizon = min(self.horizon, truth.length - 1 - observation.frame)
        straight, straight_worth = self._repeat_moves(truth, observation, horizon)
        greedy, greedy_worth = self._follow_greedy(truth, observation, horizon)
        paths = np.concatenate([straight, greedy[:, None]], axis=1)
        best = np.argmax(np.concatenate([straight_worth, greedy_worth[:, None]], axis=1), axis=1)
        chosen: FloatArray = paths[np.arange(len(best)), best]
        return chosen

    def _repeat_moves(self, truth: Truth, observation: Observation, horizon: int) -> tuple[FloatArray, FloatArray]:
        """Return the paths of the 7 repeated moves, (B, 7, H, 3), and their worth, (B, 7)."""
        episodes = len(truth.labels)
        moves = np.broadcast_to(np.arange(len(MOVES)), (episodes, len(MOVES)))
        viewpoint = np.repeat(observation.viewpoint[:, None], len(MOVES), axis=1)
        motion, state = grid_motion(truth, self._context, len(MOVES)), truth.state.fork(len(MOVES))
        path = np.empty((episodes, len(MOVES), horizon, 3))
        worth = np.zeros((episodes, len(MOVES)))
        for step in range(horizon):
            frame = observation.frame + 1 + step
            viewpoint = carried(motion, self._context, viewpoint, moves)
            recognition, state = truth.imagine(state, frame, viewpoint)
            path[:, :, step] = viewpoint
            worth += self._worth(recognition.log_probs, truth, frame)
        return path, worth / horizon

    def _follow_greedy(self, truth: Truth, observation: Observation, horizon: int) -> tuple[FloatArray, FloatArray]:
        """Return the greedy oracle's path, (B, H, 3), and its worth, (B,)."""
        episodes = np.arange(len(truth.labels))
        viewpoint, state = observation.viewpoint, truth.state
        motion = grid_motion(truth, self._context, 1)
        path = np.empty((len(episodes), horizon, 3))
        worth = np.zeros(len(episodes))
        for step in range(horizon):
            frame = observation.frame + 1 + step
            shown = replace(truth, labels=truth.frame_labels[:, frame])  # in a stream another activity may have begun
            tried = None if motion is None else motion.forked(len(MOVES))
            candidates, log_probs, best, forked = try_moves(shown, state, frame, viewpoint, self._context, tried)
            viewpoint, state = candidates[episodes, best], forked.select(best)
            if motion is not None:
                motion.advance(viewpoint)
            path[:, step] = viewpoint
            worth += self._worth(log_probs, truth, frame)[episodes, best]
        return path, worth / horizon


def truth_of(planner: Planner, observation: Observation) -> Truth:
    """Return the truth, which only a privileged planner gets; raise an EpisodeError if it is missing."""
    if observation.truth is None:
        raise EpisodeError(f"planner {planner.name!r}, frame {observation.frame}: expected the truth, got None")
    return observation.truth


def grid_motion(truth: Truth, context: Context, paths: int) -> GridMotion | None:
    """Return B x `paths` cameras that go on from here on the grid; None where something else carries them."""
    if truth.fork_motion is None or context.track != IDEAL:
        return None
    motion = truth.fork_motion(paths)
    return motion if isinstance(motion, GridMotion) else None


def try_moves(
    truth: Truth,
    state: Any,
    frame: int,
    viewpoint: FloatArray,
    context: Context,
    motion: GridMotion | None,
) -> tuple[FloatArray, FloatArray, IntArray, Any]:
    """Try all moves from viewpoints (B, 3).

    Args:
        truth: the truth.
        state: the recogniser's state before the frame.
        frame: the frame that the moves lead to.
        viewpoint: (B, 3).
        context: the episodes' context.
        motion: the B x 7 cameras that make the moves, see `grid_motion`; None imagines that every move succeeds.

    Returns:
        the candidates (B, 7, 3), the log-probabilities after `frame` is seen from them (B, 7, K), the candidate with
        the lowest cross-entropy (B,), and the forked state.
    """
    here = np.repeat(viewpoint[:, None], len(MOVES), axis=1)
    candidates = carried(motion, context, here, np.broadcast_to(np.arange(len(MOVES)), here.shape[:2]))
    recognition, forked = truth.imagine(state.fork(len(MOVES)), frame, candidates)
    best = np.argmax(true_log_probs(recognition.log_probs, truth), axis=1)
    return candidates, recognition.log_probs, best, forked


def true_log_probs(log_probs: FloatArray, truth: Truth) -> FloatArray:
    """Return the log-probabilities of the true labels, (B, F), from those of all, (B, F, K)."""
    return np.take_along_axis(log_probs, truth.labels[:, None, None], axis=2)[..., 0]


def worth_of_flights(
    truth: Truth, frame: int, ends: FloatArray, context: Context, *, on_top: float = 1.0
) -> FloatArray:
    """Return what flights of 3 s to their ends are worth, the sum over the frames that they see.

    Args:
        truth: the truth, which forks the vehicles.
        frame: the last frame that was seen.
        ends: (B, F, 3), where the flights of each episode go.
        context: the episodes' context.
        on_top: the extra worth of a correct recognition.

    Returns:
        (B, F).
    """
    assert truth.fork_motion is not None
    motion, state = truth.fork_motion(ends.shape[1]), truth.state.fork(ends.shape[1])
    worth = np.zeros(ends.shape[:2])
    for later in range(frame + 1, min(frame + 1 + flown_frames(FLOWN_HORIZON, context), truth.length)):
        viewpoint = motion.advance(ends.reshape(-1, 3)).reshape(ends.shape)
        recognition, state = truth.imagine(state, later, viewpoint)
        worth += shown_worth(recognition.log_probs, truth, later, context, on_top=on_top)
    return worth


def flown_frames(seconds: float, context: Context) -> int:
    """Return how many frames a time of a flight has, at least one."""
    return max(round(seconds / context.frame_time), 1)


def shown_worth(
    log_probs: FloatArray, truth: Truth, frame: int, context: Context, *, on_top: float = 1.0
) -> FloatArray:
    """Return the worth (B, F) of one frame: the true label's probability, plus `on_top` if it is the most probable.

    A frame of a stream that shows no activity is worth 0.

    Args:
        log_probs: (B, F, K), after the frame.
        truth: the truth.
        frame: the frame.
        context: the episodes' context.
        on_top: the extra worth of a correct recognition.
    """
    shown = replace(truth, labels=truth.frame_labels[:, frame])
    correct = np.argmax(log_probs, axis=2) == shown.labels[:, None]
    worth: FloatArray = on_top * correct + np.exp(true_log_probs(log_probs, shown))
    if context.length is None:
        worth *= (shown.labels < len(context.class_names) - 1)[:, None]
    return worth
