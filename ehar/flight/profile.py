"""Flights of piecewise constant jerk that end at rest: B at a time, each axis has its own phases."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.flight.kinematics import SphericalState

SAME_TIME = 1e-9  # [s]; times that differ by less are equal, so that rounding does not separate the axes
SAME_JERK = 1e-6  # [m/s^3], [rad/s^3]
SAMPLES = 4  # of each piece, both ends included
PIECES = 3  # of equal length in `phases_between` and `phases_to_rest`; as many as position, velocity, acceleration
# What the jerk of each piece adds to acceleration, velocity and position at the end, for pieces of length 1.
_EFFECTS = np.array([[1, 1, 1], [5 / 2, 3 / 2, 1 / 2], [19 / 6, 7 / 6, 1 / 6]])


class Phases(NamedTuple):
    """The phases of each axis: in each of N phases the jerk is constant."""

    durations: FloatArray  # (B, N, 3) [s], from 0
    jerks: FloatArray  # (B, N, 3)

    def select(self, flights: IntArray) -> "Phases":
        """Return the phases of some flights."""
        return Phases(*(part[flights] for part in self))

    @staticmethod
    def joined(parts: Sequence["Phases"]) -> "Phases":
        """Return the phases of all parts, one part after another."""
        return Phases(*(np.concatenate(arrays, axis=1) for arrays in zip(*parts, strict=True)))


class Samples(NamedTuple):
    """States at some times of the flights of a profile."""

    flight: IntArray  # (n,), which of the B flights
    state: SphericalState  # each (n, SAMPLES, 3)


def phases_between(start: SphericalState, end: SphericalState, time: float) -> Phases:
    """Return phases from states (B, 3) to states (B, 3), all in the same time [s]: (B, `PIECES`, 3).

    Each axis has pieces of equal length. If a constant jerk leads from one state to the other, all have that jerk.
    """
    step = time / PIECES
    missing = np.stack(
        [
            (end.acceleration - start.acceleration) / step,
            (end.velocity - start.velocity - time * start.acceleration) / step**2,
            (end.viewpoint - start.viewpoint - time * (start.velocity + time / 2 * start.acceleration)) / step**3,
        ],
        axis=1,
    )
    jerks = np.linalg.inv(_EFFECTS) @ missing
    return Phases(np.full(jerks.shape, step), jerks)


def phases_along(acceleration: FloatArray, time: float) -> Phases:
    """Return the phases between states that are `time` [s] apart, from their accelerations (B, F, 3).

    Phases in which no jerk changes are joined.
    """
    jerks = np.diff(acceleration, axis=1) / time
    changes = (np.abs(np.diff(jerks, axis=1)) > SAME_JERK).any(axis=(0, 2))
    begins = np.concatenate([[0], np.flatnonzero(changes) + 1]) if jerks.shape[1] else np.zeros(0, dtype=np.int64)
    frames = np.diff(begins, append=jerks.shape[1])
    jerks = np.diff(acceleration[:, np.append(begins, jerks.shape[1])], axis=1) / (frames * time)[:, None]
    return Phases(np.broadcast_to((frames * time)[:, None], jerks.shape), jerks)


def rates_after(start: SphericalState, phases: Phases) -> tuple[FloatArray, FloatArray]:
    """Return the velocity and the acceleration of states (B, 3) at the end of phases, both (B, 3)."""
    step, jerk = phases
    acceleration = _running(start.acceleration, step * jerk)
    velocity = start.velocity + (step * (acceleration[:, :-1] + step * jerk / 2)).sum(axis=1)
    return velocity, acceleration[:, -1]


def coasted(state: SphericalState, time: float) -> SphericalState:
    """Return states (..., 3) after some time [s] at constant acceleration."""
    viewpoint, velocity, acceleration, _ = state
    return state._replace(
        viewpoint=viewpoint + time * (velocity + time / 2 * acceleration), velocity=velocity + time * acceleration
    )


def phases_to_rest(start: SphericalState, time: FloatArray) -> Phases:
    """Return the smoothest phases from states (B, 3) to rest in times (B,) [s], wherever that is: (B, `PIECES`, 3).

    Each axis has pieces of equal length. Of all jerks that end velocity and acceleration, they have the least sum of
    squares, so all axes stop together and the camera hardly changes its direction.
    """
    step = time[:, None] / PIECES
    missing = np.stack(
        [-start.acceleration / step, -(start.velocity + time[:, None] * start.acceleration) / step**2], axis=1
    )
    jerks = np.linalg.pinv(_EFFECTS[:2]) @ missing
    return Phases(np.broadcast_to(step[:, None], jerks.shape), jerks)


@dataclass(frozen=True, eq=False)
class JerkProfile:
    """The time and the state at the start of each phase; the last phase is rest and has no end.

    Args:
        times: (B, N, 3) [s], from 0.
        viewpoint: (B, N, 3), when the phase begins; the azimuth is not wrapped.
        velocity: (B, N, 3), when the phase begins.
        acceleration: (B, N, 3), when the phase begins.
        jerk: (B, N, 3), throughout the phase.
    """

    times: FloatArray
    viewpoint: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray

    @classmethod
    def from_phases(cls, start: SphericalState, phases: Phases) -> "JerkProfile":
        """Return the flights from starts (B, 3) through phases to rest; at the end the velocity is exactly 0."""
        step, jerk = phases
        acceleration = _running(start.acceleration, step * jerk)
        before = acceleration[:, :-1]
        velocity = _running(start.velocity, step * (before + step * jerk / 2))
        before_velocity = velocity[:, :-1]
        viewpoint = _running(start.viewpoint, step * (before_velocity + step * (before / 2 + step * jerk / 6)))
        times = _running(np.zeros_like(start.viewpoint), step)
        velocity[:, -1] = acceleration[:, -1] = 0
        return cls(times, viewpoint, velocity, acceleration, np.concatenate([jerk, np.zeros_like(jerk[:, :1])], axis=1))

    @property
    def end(self) -> SphericalState:
        """The states (B, 3) in which the last phase begins."""
        return SphericalState(*(getattr(self, part)[:, -1] for part in SphericalState._fields))

    @property
    def duration(self) -> FloatArray:
        """The time at which the last phase begins on the slowest axis, (B,) [s]."""
        duration: FloatArray = self.times[:, -1].max(axis=1)
        return duration

    def extremes(self) -> tuple[FloatArray, FloatArray]:
        """Return the least and the greatest value of each coordinate, both (B, 3): exact, not sampled."""
        v, a, j = self.velocity[:, :-1], self.acceleration[:, :-1], self.jerk[:, :-1]
        # A coordinate turns where v + a t + j t^2 / 2 = 0; this form of the roots does not cancel, j = 0 included.
        half = -(a + np.copysign(np.sqrt(np.maximum(a**2 - 2 * j * v, 0)), a))
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            roots = np.nan_to_num(np.stack([half / j, 2 * v / half]))
        t = np.clip(roots, 0, np.diff(self.times, axis=1))
        turned = self.viewpoint[:, :-1] + t * (v + t * (a / 2 + t * j / 6))
        every = np.concatenate([self.viewpoint, turned[0], turned[1]], axis=1)
        return every.min(axis=1), every.max(axis=1)

    def fastest(self) -> FloatArray:
        """Return the greatest rate of each coordinate, in either direction, (B, 3): exact, not sampled."""
        v, a, j = self.velocity[:, :-1], self.acceleration[:, :-1], self.jerk[:, :-1]
        t = np.divide(-a, j, out=np.zeros_like(a), where=j != 0)  # when the acceleration is 0
        t = np.clip(t, 0, np.diff(self.times, axis=1))
        rates = np.concatenate([self.velocity, v + t * (a + t * j / 2)], axis=1)
        fastest: FloatArray = np.abs(rates).max(axis=1)
        return fastest

    def select(self, flights: IntArray | BoolArray) -> "JerkProfile":
        """Return some of the flights."""
        return JerkProfile(*(getattr(self, field.name)[flights] for field in fields(self)))

    def padded(self, phases: int) -> "JerkProfile":
        """Return the same flights with so many phases: those that are added begin, like the last one, at rest."""
        more = phases - self.times.shape[1]
        if more == 0:
            return self
        return JerkProfile(
            *(
                np.concatenate([part, np.repeat(part[:, -1:], more, axis=1)], axis=1)
                for part in (getattr(self, field.name) for field in fields(self))
            )
        )

    def replace(self, flights: IntArray, other: "JerkProfile") -> None:
        """Replace some flights by those of another profile."""
        for field in fields(self):
            getattr(self, field.name)[flights] = getattr(other, field.name)

    def at(self, times: FloatArray) -> SphericalState:
        """Return the states (B, S, 3) at times (B, S) [s]."""
        phase = _counted(times + SAME_TIME >= self.times.T[..., None]) - 1
        states = self._within(np.arange(len(times))[:, None], phase, times)
        return SphericalState(*(np.moveaxis(part, 0, -1) for part in states))

    def samples(self, longest: float) -> Samples:
        """Return states at least every `longest` / (`SAMPLES` - 1) [s], until the last phase begins.

        The jerk steps when any axis changes its phase. Between two such times there is at least one piece, which is
        sampled at both ends; if `longest` is infinite, there is exactly one.
        """
        changes = np.sort(self.times.reshape(len(self.times), -1), axis=1)
        gaps = np.diff(changes, axis=1)
        flight, change = np.nonzero(gaps > SAME_TIME)
        begin, gap = changes[flight, change], gaps[flight, change]
        count = np.maximum(np.ceil(gap / longest), 1).astype(np.int64)
        rank = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        flight, length = np.repeat(flight, count), np.repeat(gap / count, count)
        begin = np.repeat(begin, count) + rank * length
        phase = _counted(begin + length / 2 >= self.times.T[:, :, flight]) - 1
        times = begin + length * np.linspace(0, 1, SAMPLES)[:, None]
        return Samples(flight, SphericalState(*(part.T for part in self._within(flight, phase[:, None], times))))

    def _within(self, flight: IntArray, phase: IntArray, times: FloatArray) -> SphericalState:
        """Return the states (3, ...) of flights at times within phases (3, ...), all of them broadcast.

        Axes come first: numpy takes several times as long where the last axis has only three.
        """
        entry = (flight * self.times.shape[1] + phase) * 3 + np.arange(3)[:, None, None]
        begin, q, v, a, j = (np.take(getattr(self, field.name), entry) for field in fields(self))
        t = times - begin
        return SphericalState(
            q + t * (v + t * (a / 2 + t * j / 6)), v + t * (a + t * j / 2), a + t * j, np.broadcast_to(j, t.shape)
        )


def _counted(begun: BoolArray) -> IntArray:
    """Return how many of the phases (3, N, ...) have begun, (3, ...); bytes are added up faster than booleans."""
    counts: IntArray = begun.view(np.uint8).sum(axis=1, dtype=np.uint8 if begun.shape[1] < 256 else np.int64)
    return counts.astype(np.int64)


def _running(start: FloatArray, changes: FloatArray) -> FloatArray:
    """Return starts (B, 3) after none, one, two, ... of the changes (B, N, 3): (B, N + 1, 3)."""
    return np.cumsum(np.concatenate([start[:, None], changes], axis=1), axis=1)
