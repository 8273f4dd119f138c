"""The resamples that all planners of a run share, and the people that its intervals rest on."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.data.recordings import UNKNOWN_SUBJECT
from eval.scores.resampling.statistics import (
    BOOTSTRAP_SEED,
    RESAMPLES,
    ROUNDING,
    Simultaneous,
    Variance,
    Widening,
    interval,
    resample_counts,
    resampled_means,
    simultaneous,
    two_stage_counts,
    widening,
)

FEW = 5  # with fewer people or groups, a table warns
ALONE = 2_000  # resamples that draw one kind of unit alone, to measure its variance


@dataclass(frozen=True)
class Basis:
    """The people and sequences that the intervals of a run rest on.

    Args:
        sequences: number of sequences.
        groups: number of different sets of people who perform together; None if the data do not name them.
        people: number of different people; None if the data do not name them.
        together: number of people in the largest set; None if the data do not name them.
        mixed: whether some people perform in several groups.
    """

    sequences: int
    groups: int | None = None
    people: int | None = None
    together: int | None = None
    mixed: bool = False

    @property
    def of_people(self) -> bool:
        """Whether people are resampled, and not only sequences."""
        return self.groups is not None and self.groups > 1

    @property
    def few(self) -> bool:
        """Whether there are fewer than `FEW` people or groups, or the data do not say how many."""
        return self.groups is None or self.people is None or min(self.groups, self.people) < FEW

    @property
    def text(self) -> str:
        """What intervals rest on, as a noun phrase."""
        if self.groups is None:
            return f"{_count(self.sequences, 'sequence')} of people whom the data do not name"
        if self.groups == 1:
            who = "one person" if self.together == 1 else "one couple" if self.together == 2 else "one group of people"
            return f"{_count(self.sequences, 'sequence')} of {who}"
        if self.together == 1:
            return f"{self.groups} people"
        couples = f"{self.groups} {'couples' if self.together == 2 else 'groups of people'}"
        return f"{couples}, formed by {self.people} people" if self.mixed else couples

    @property
    def sentence(self) -> str:
        """What intervals rest on, and what that means for other people."""
        if not self.of_people:
            return f"Intervals rest on {self.text}: they do not cover other people."
        if self.few:
            return f"Intervals rest on only {self.text}, who say little about other people."
        if self.mixed:
            return f"Intervals rest on {self.text}: they are a little too narrow, as the same people are in several."
        return f"Intervals rest on {self.text} and their {_count(self.sequences, 'sequence')}."


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' * (number != 1)}"


@dataclass(frozen=True, eq=False)
class Alone:
    """Rows of `Resamples.counts` in which one kind of unit is drawn alone.

    Args:
        rows: the rows.
        units: number of units that are drawn.
    """

    rows: slice
    units: int


@dataclass(frozen=True, eq=False)
class Resamples:
    """R full resamples of S sequences, which all planners share; R is 0 if there can be no intervals.

    Further rows draw one kind of unit alone. They tell how much of a statistic's variance lies between such units, of
    which there may be few. A statistic is computed in all rows at once.

    Args:
        clusters: (N,), the sequence of each episode, 0 to S - 1.
        counts: (rows, S), how often each sequence is drawn; the first R rows are full resamples.
        alone: the further rows.
        basis: the people and sequences that are drawn.
        why_none: why R is 0, or None.
        trainings: (rows, T) of each family of trainings, how often each of its T trainings is drawn.
    """

    clusters: IntArray
    counts: IntArray
    alone: tuple[Alone, ...]
    basis: Basis
    why_none: str | None
    trainings: Mapping[str, IntArray] = field(default_factory=dict)

    @property
    def full(self) -> int:
        """R, the number of full resamples."""
        return self.alone[0].rows.start if self.alone else len(self.counts)

    def means(self, values: FloatArray) -> FloatArray:
        """Return the mean over episodes in every row, (..., rows) from (..., N)."""
        return resampled_means(values, self.clusters, self.counts)

    def widening(self, resampled: FloatArray) -> Widening:
        """Return how much wider than the bootstrap's an interval has to be, (...) from (..., rows)."""
        parts = [Variance(resampled[..., part.rows].var(axis=-1), part.units) for part in self.alone]
        return widening(resampled[..., : self.full].var(axis=-1), parts)

    def interval(
        self,
        estimate: FloatArray | float,
        resampled: FloatArray,
        *,
        linear: FloatArray | None = None,
        bounds: tuple[float, float] = (-np.inf, np.inf),
    ) -> FloatArray:
        """Return the 95 % interval of a statistic, (..., 2): the percentile interval, wider where people are few.

        Args:
            estimate: (...), the statistic.
            resampled: (..., rows), the statistic in every row; NaN where it does not exist.
            linear: (..., rows), a statistic that varies as this one does and always exists, for one that is a ratio.
            bounds: the least and greatest value that the statistic can have.
        """
        ends = interval(resampled[..., : self.full])
        if not self.alone:
            return ends
        by = self.widening(resampled if linear is None else linear).of_interval
        middle = np.asarray(estimate, dtype=np.float64)[..., None]
        return np.clip(middle + by[..., None] * (ends - middle), *bounds)

    def together(self, estimates: FloatArray, resampled: FloatArray) -> Simultaneous:
        """Return intervals and p-values of m differences that one table shows.

        The share of their variance that lies between few units is taken as the mean over the differences that these
        units are a part of: two or three people are too few to measure it for each.

        Args:
            estimates: (m,) differences.
            resampled: (m, rows), the same in every row.
        """
        full = resampled[:, : self.full]
        total = full.var(axis=1)
        varies = total > 0
        parts = []
        for part in self.alone:
            share = resampled[:, part.rows].var(axis=1) / np.where(varies, total, 1)
            concerned = varies & (share > ROUNDING)
            if concerned.any():
                parts.append(Variance(np.where(concerned, share[concerned].mean(), 0) * total, part.units))
        return simultaneous(estimates, full, widening(total, parts))

    def with_trainings(self, families: Mapping[str, int]) -> "Resamples":
        """Return these resamples with draws of the trainings of some families, and for each rows that draw only these.

        The draws of two families are independent, and do not depend on which others there are.

        Args:
            families: how many trainings each has, at least 2.
        """
        extra = ALONE if self.full else 0
        counts = np.concatenate([self.counts, np.ones((extra * len(families), self.counts.shape[1]), dtype=np.int64)])
        trainings, alone = {}, list(self.alone)
        for number, (family, units) in enumerate(families.items()):
            begin = len(self.counts) + extra * number
            rows = slice(begin, begin + extra)
            drawn = resample_counts(np.random.default_rng([BOOTSTRAP_SEED, *family.encode()]), units, self.full + extra)
            trainings[family] = np.ones((len(counts), units), dtype=np.int64)
            trainings[family][: self.full], trainings[family][rows] = np.split(drawn, [self.full])
            alone += [Alone(rows, units)] if extra else []
        return replace(self, counts=counts, alone=tuple(alone), trainings=trainings)


def resample_episodes(
    sequence: np.ndarray, subjects: IntArray, *, why_none: str | None = None, rng: np.random.Generator | None = None
) -> Resamples:
    """Draw the resamples of N episodes: sets of people first, and sequences of each set.

    Two sequences belong to the same set if the same people perform in them. If the data do not name everybody, or
    there is only one set, sequences are drawn regardless of people.

    Args:
        sequence: (N,) names of the sequences.
        subjects: (N, P), who performs; -1 is unknown.
        why_none: why there can be no intervals, or None.
        rng: generator of the draws; None means the one of all summaries.
    """
    names, first, clusters = np.unique(sequence, return_index=True, return_inverse=True)
    groups, basis = _groups(subjects[first])
    rng = np.random.default_rng(BOOTSTRAP_SEED) if rng is None else rng
    full = RESAMPLES if why_none is None else 0
    if not basis.of_people or not full:
        return Resamples(clusters, resample_counts(rng, len(names), full), (), basis, why_none)
    count = int(groups.max()) + 1
    counts = np.concatenate([two_stage_counts(rng, groups, full), resample_counts(rng, count, ALONE)[:, groups]])
    return Resamples(clusters, counts, (Alone(slice(full, full + ALONE), count),), basis, None)


def _groups(subjects: IntArray) -> tuple[IntArray, Basis]:
    """Return the set of people of each sequence, (S,) from (S, P), and what they are."""
    unknown: BoolArray = subjects == UNKNOWN_SUBJECT
    if unknown.any():
        return np.zeros(len(subjects), dtype=np.int64), Basis(len(subjects))
    sets = [tuple(sorted(set(row))) for row in subjects.tolist()]
    numbers = {members: number for number, members in enumerate(sorted(set(sets)))}
    people = {one for members in numbers for one in members}
    basis = Basis(
        sequences=len(sets),
        groups=len(numbers),
        people=len(people),
        together=max(map(len, numbers)),
        mixed=len(people) < sum(map(len, numbers)),
    )
    return np.array([numbers[members] for members in sets]), basis
