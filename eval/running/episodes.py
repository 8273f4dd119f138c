"""The episodes of a run: the same scenarios, start viewpoints and sensor noise for every planner."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ehar.arrays import FloatArray, IntArray, in_brief
from ehar.batch import Batch, noise_of
from ehar.data.copies import copied
from ehar.data.motion_data import MotionData
from ehar.data.scenario import Scenarios, localised, show_known, windows
from ehar.data.streams.data import NO_ACTIVITY, StreamData
from ehar.data.streams.scenario import StreamScenarios
from ehar.data.surroundings import surroundings_of
from ehar.errors import DataError
from ehar.world import PAPER, World
from eval.scores.streams.activities import activity_frames

# Episodes that run in lockstep; fixed, so that results do not depend on the number of workers. 128 are no faster,
# and an oracle that forks each of them 7 ways then needs three times the memory (2.7 GB a worker instead of 0.9).
CHUNK = 32
# Chunks that run in lockstep on a GPU, 512 episodes: enough to keep it busy. An oracle that forks them 7 ways holds
# about 5 GB of states of the small network there. Noise and planners stay those of each chunk.
CHUNKS_ON_DEVICE = 16

# The purposes of random numbers: every generator's seed begins with one of these and the run's seed.
_STARTS, _NOISE, _PLANNER = range(3)


@dataclass(frozen=True, eq=False, repr=False)
class Episodes:
    """N episodes, cut into chunks of `CHUNK`.

    Args:
        scenarios: the motions.
        scenario: (N,) index into `scenarios`.
        starts: (N, 3) start viewpoints.
        seed: seed of the sensor's noise and of the planners' generators.
        world: what stands and walks around people, and how well it is known where they are.
    """

    scenarios: Scenarios | StreamScenarios
    scenario: IntArray
    starts: FloatArray
    seed: int
    world: World = PAPER

    __repr__ = in_brief

    def __len__(self) -> int:
        """The number of episodes, N."""
        return len(self.scenario)

    @property
    def chunks(self) -> int:
        """The number of chunks."""
        return -(-len(self) // CHUNK)

    def chunk(self, index: int, count: int = 1) -> "Episodes":
        """Return the episodes of one chunk, or of `count` chunks from there on."""
        part = slice(index * CHUNK, (index + count) * CHUNK)
        return Episodes(self.scenarios, self.scenario[part], self.starts[part], self.seed, self.world)

    @property
    def sequence_names(self) -> tuple[str, ...]:
        """The name of each episode's sequence."""
        names = self.scenarios.data.sequence_names
        return tuple(names[index] for index in self.scenarios.sequence[self.scenario])

    @property
    def first(self) -> IntArray:
        """The first frame of each episode within its sequence, (N,)."""
        return self.scenarios.first[self.scenario]

    @property
    def labels(self) -> IntArray:
        """The true class of each episode, (N,); of streams (N, L), that of each frame."""
        return self.scenarios.labels[self.scenario]

    @property
    def subjects(self) -> IntArray:
        """Who performs in each episode, (N, P); -1 is unknown."""
        return self.scenarios.data.subjects[self.scenarios.sequence[self.scenario]]

    def batch(self, index: int) -> Batch:
        """Return one chunk, ready to run; its noise depends on the seed and the chunk only."""
        part = self.chunk(index)
        rng = np.random.default_rng([self.seed, _NOISE, index])
        scenarios = localised(self.scenarios, self.world)
        noise = noise_of(scenarios, len(part), rng)
        around = surroundings_of(scenarios, part.scenario, self.world, rng)
        return Batch.of(scenarios, part.scenario, part.starts, noise, around)

    def batches(self, chunks: Sequence[int]) -> Batch:
        """Return chunks that run in lockstep, with the noise that each has alone."""
        return self.batch(chunks[0]) if len(chunks) == 1 else Batch.joined([self.batch(chunk) for chunk in chunks])

    def pick(self, indices: Sequence[int]) -> Batch:
        """Return some episodes, with the start viewpoints and the noise that they have in their chunks."""
        chunks = {chunk: self.batch(chunk) for chunk in dict.fromkeys(index // CHUNK for index in indices)}
        rows = [(chunks[index // CHUNK], index % CHUNK) for index in indices]
        return Batch.joined([chunk.select(slice(row, row + 1)) for chunk, row in rows])

    def planner_rng(self, name: str, index: int) -> np.random.Generator:
        """Return a planner's generator for one chunk."""
        word = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")
        return np.random.default_rng([self.seed, _PLANNER, word, index])


def cut_scenarios(
    data: MotionData | StreamData, sequences: IntArray, length: int, note: Callable[[str], None]
) -> Scenarios | StreamScenarios:
    """Cut sequences into windows that do not overlap (Sec. 5.1: stride L); note the sequences that are too short.

    Raises:
        DataError: a class has no sequence among them, or no sequence has `length` frames.
    """
    known = int(show_known(data, sequences).sum())
    if known:
        shown = f"{known} of {len(sequences)} {'streams' if isinstance(data, StreamData) else 'sequences'}"
        note(f"warning: {shown} of {data.name} show people from whom its recogniser learns")
    if isinstance(data, StreamData):
        return _cut_streams(data, sequences, length, note)
    for label, name in enumerate(data.class_names):
        if not (data.labels[sequences] == label).any():
            raise DataError(f"{data.name}: expected a sequence of every class, class {name!r} has none")
    scenarios = windows(data, sequences, length, stride=length)
    if not len(scenarios):
        raise DataError(
            f"{data.name}: expected sequences of at least {length} frames, "
            f"the longest of {len(sequences)} has {data.lengths[sequences].max()}"
        )
    copies = int(copied(data, sequences).sum())
    if copies:
        note(f"warning: {copies} of {len(sequences)} sequences are copies of others of {data.name}, frame by frame")
    short = int((data.lengths[sequences] < length).sum())
    if short:
        note(f"{data.name}: {short} of {len(sequences)} sequences are shorter than {length} frames and left out")
    for label, name in enumerate(data.class_names):
        if label not in scenarios.labels:
            note(f"{data.name}: class {name!r} has no sequence of {length} frames left")
    return scenarios


def _cut_streams(data: StreamData, streams: IntArray, length: int, note: Callable[[str], None]) -> StreamScenarios:
    """Cut streams into windows that do not overlap; note what is left out.

    Raises:
        DataError: no stream has `length` frames.
    """
    for line in data.notes:
        note(f"warning: {data.name}: {line}")
    counts = data.lengths[streams] // length
    if not counts.any():
        raise DataError(
            f"{data.name}: expected streams of at least {length} frames ({length / data.fps:g} s), "
            f"the longest of {len(streams)} has {data.lengths[streams].max()}"
        )
    if (counts == 0).any():
        note(f"{data.name}: {(counts == 0).sum()} of {len(streams)} streams are shorter than {length} frames")
    first = np.concatenate([np.arange(count) * length for count in counts])
    scenarios = StreamScenarios(data, length, np.repeat(streams, counts), first)
    shown = np.unique(scenarios.labels)
    absent = [name for label, name in enumerate(data.class_names) if label not in shown]
    if absent:
        note(f"{data.name}: no stream shows {', '.join(absent)}")
    return scenarios


def check_scored(scenarios: Scenarios | StreamScenarios) -> None:
    """Raise a DataError if windows of streams hold no activity from begin to end: there is nothing to score."""
    if isinstance(scenarios, Scenarios):
        return
    data, length, labels = scenarios.data, scenarios.length, scenarios.labels
    if not len(activity_frames(np.where(labels == len(data.class_names), NO_ACTIVITY, labels))[0]):
        raise DataError(
            f"{data.name}: expected an activity that begins and ends within an episode of {length} frames "
            f"({length / data.fps:g} s), got none in {len(scenarios)} episodes: a longer --length has some"
        )


def random_starts(scenarios: Scenarios | StreamScenarios, starts: int, seed: int, world: World) -> Episodes:
    """Return episodes from `starts` start viewpoints a scenario, uniform over those of the world."""
    count = len(scenarios)
    scenario = np.tile(np.arange(count), starts)
    return Episodes(scenarios, scenario, draw_starts(starts * count, seed, world), seed, world)


def draw_starts(count: int, seed: int, world: World) -> FloatArray:
    """Return the start viewpoints of `count` episodes, (count, 3); they depend on count, seed and world only."""
    return world.sample_starts(np.random.default_rng([seed, _STARTS]), count)
