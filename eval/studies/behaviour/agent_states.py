"""The states s_t that a learned planner acts from (Fig. 7e): collected in the episodes of a run, and mapped by class.

Records do not hold these states, so the planner runs its episodes again. It has to go where it went in the run.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.data.scenario import part_of
from ehar.errors import DataError, UsageError
from ehar.planner import Observation, Planner
from ehar.processes import Processes
from eval.running.choice import ModelPlace
from eval.running.progress import Reporter
from eval.running.recorder import Recorder
from eval.running.run import Run
from planners.registry import is_learned
from recognition.setting import load_setting

EVERY = 5  # frames: one state in 5 is kept, because consecutive states differ little
MOST = 3000  # points in the picture
NEIGHBOURS = 10
PERPLEXITY = 30.0  # the default of scikit-learn; van der Maaten and Hinton, 2008, advise 5 to 50

AgentLoader = Callable[[Run, str], Planner]  # as `load_agent`


@dataclass(frozen=True, eq=False)
class AgentStates:
    """States s_t of M frames of a run.

    Args:
        state: (M, S) states.
        label: (M,) true class of the episode.
        sequence: (M,) name of the episode's sequence.
        frame: (M,) frame after which the state was taken, from 0.
    """

    state: FloatArray
    label: IntArray
    sequence: np.ndarray[tuple[int], np.dtype[np.str_]]
    frame: IntArray

    def sample(self, rng: np.random.Generator, most: int) -> "AgentStates":
        """Return at most `most` of the states, drawn without replacement, in their order."""
        if len(self.label) <= most:
            return self
        kept = np.sort(rng.choice(len(self.label), most, replace=False))
        return AgentStates(self.state[kept], self.label[kept], self.sequence[kept], self.frame[kept])


class Purity(NamedTuple):
    """The share of a state's nearest neighbours that have its class, and the share that chance would give.

    Only states of other sequences count as neighbours. States of one sequence are alike, even if the agent has not
    recognised its activity.

    Args:
        purity: mean share of the nearest neighbours that have the same class.
        chance: mean share of all states of other sequences that have the same class.
        neighbours: number of nearest neighbours.
    """

    purity: float
    chance: float
    neighbours: int


class StateKeeper:
    """Keeps the states of a planner, batch by batch.

    Args:
        planner: a planner that has `state` (B, S) after each `act`.
        every: distance between two frames that are kept.
    """

    def __init__(self, planner: Planner, *, every: int) -> None:
        """Keep nothing yet."""
        self._planner = planner
        self._every = every
        self._batches: list[list[FloatArray]] = []

    def keep(self, observation: Observation) -> None:
        """Keep the state after an observation, if its frame is to be kept.

        Raises:
            UsageError: the planner has no states.
        """
        state = getattr(self._planner, "state", None)
        if state is None:
            name = self._planner.name
            raise UsageError(f"planner {name!r}: expected a learned one, with a state after each frame; has none")
        if observation.frame == 0:
            self._batches.append([])
        if observation.frame % self._every == 0:
            self._batches[-1].append(np.array(state))

    @property
    def states(self) -> FloatArray:
        """The states that were kept, of all batches: (N, T, S)."""
        return np.concatenate([np.stack(batch, axis=1) for batch in self._batches])


def load_agent(run: Run, name: str) -> Planner:
    """Return the learned planner that a run lists under a record name such as `il-ppo/0`.

    Raises:
        UsageError: no learned planner has this name.
        DataError: the data cannot be read.
        ModelError: there is no such agent or no recogniser, or the agent belongs to another data set or recogniser.
    """
    if not is_learned(name):
        raise UsageError(f"planner {name!r}: expected a learned one, such as il-ppo/0, whose states can be kept")
    return ModelPlace.of(load_setting(run.conditions)).load_agent(name)


def agent_states(run: Run, name: str, planner: Planner, *, reporter: Reporter, every: int = EVERY) -> AgentStates:
    """Run a planner on the episodes of a run again, and return its states.

    Args:
        run: a run on the ideal track.
        name: name of the planner in the run, `il-ppo/0`.
        planner: the same planner; it has an attribute `state`, (B, S), after each `act`.
        reporter: receives progress.
        every: distance between two frames that are kept; the first frame is kept.

    Raises:
        UsageError: the run has no such planner, or the planner has no states.
        DataError: the run had other data or another recogniser, it was a flight, or the planner went elsewhere.
        ModelError: there is no recogniser.
    """
    from eval.running.episodes import cut_scenarios, random_starts  # imported here: too slow for `ehar --help`
    from eval.running.jobs import Workload, run_planners

    conditions = run.conditions
    if name not in run.records:
        raise UsageError(f"{run.directory}: no planner {name!r}; expected one of: {', '.join(run.records)}")
    if run.flown:
        raise DataError(f"{run.directory}: states: expected a run on the ideal track, got {conditions.track}")
    setting = load_setting(conditions)
    for what, held, wanted in (
        ("data", setting.data.sha256, run.config.data_sha256),
        ("recogniser", setting.recogniser_sha256, run.config.recogniser_sha256),
    ):
        if held != wanted:
            raise DataError(f"{run.directory}: expected the {what} of the run, sha256 {wanted}, got {held}")
    scenarios = cut_scenarios(setting.data, part_of(setting.data, conditions.part), conditions.frames, reporter.note)
    episodes = random_starts(scenarios, conditions.starts, conditions.seed, setting.world)
    keeper = StateKeeper(planner, every=every)
    recorder = Recorder(planner, name=name, answered=keeper.keep)
    # One worker: the states are collected in this process.
    workload = Workload(setting.runner, episodes)
    again = run_planners(workload, [recorder], engine=Processes(), reporter=reporter)[name].records
    recorded = run.records[name]
    if not recorded.same_episodes(again):
        raise DataError(f"{run.directory}: expected to make its episodes once more, got others")
    elsewhere = (again.viewpoint != recorded.viewpoint).any(axis=(1, 2))
    if elsewhere.any():
        first = int(elsewhere.argmax())
        raise DataError(
            f"{run.directory}: expected {name} to go where it went, in {int(elsewhere.sum())} of {len(elsewhere)} "
            f"episodes it does not, the first {recorded.sequence[first]!r} from frame {recorded.first[first]}"
        )
    states = keeper.states
    count, frames, size = states.shape
    return AgentStates(
        state=states.reshape(count * frames, size),
        label=np.repeat(recorded.label, frames),
        sequence=np.repeat(np.array(recorded.sequence), frames),
        frame=np.tile(every * np.arange(frames), count),
    )


def neighbour_purity(states: AgentStates, neighbours: int = NEIGHBOURS) -> Purity:
    """Return how well classes are told apart, in the space of the states.

    Raises:
        DataError: the states are all of one sequence.
    """
    state = states.state.astype(np.float64)
    _, sequence = np.unique(states.sequence, return_inverse=True)
    other: BoolArray = sequence[:, None] != sequence
    if not other.any():
        raise DataError("states: expected those of at least two sequences, for neighbours in another one")
    same: BoolArray = states.label[:, None] == states.label
    square = (state**2).sum(axis=1)
    distance = np.where(other, square[:, None] + square - 2 * state @ state.T, np.inf)
    count = min(neighbours, int(other.sum(axis=1).min()))
    nearest = np.argpartition(distance, count - 1, axis=1)[:, :count]
    return Purity(
        purity=float(np.take_along_axis(same, nearest, axis=1).mean()),
        chance=float(((same & other).sum(axis=1) / other.sum(axis=1)).mean()),
        neighbours=count,
    )


def map_states(state: FloatArray, seed: int = 0) -> FloatArray:
    """Return states in the plane, (M, 2) from (M, S): t-SNE (van der Maaten and Hinton, 2008) from the PCA."""
    from sklearn.manifold import TSNE  # imported here: it takes seconds

    perplexity = min(PERPLEXITY, (len(state) - 1) / 3)
    embedding = TSNE(n_components=2, init="pca", perplexity=perplexity, random_state=seed).fit_transform(state)
    mapped: FloatArray = np.asarray(embedding, dtype=np.float64)
    return mapped
