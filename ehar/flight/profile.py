"""Flights of piecewise constant jerk that end at rest: B at a time, each axis has its own phases."""

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.flight.kinematics import SphericalState

SAME_TIME = 1e-9  # [s]; times that differ by less are equal, so that rounding does not separate the axes
SAMPLES = 4  # of each piece, both ends included


class Phases(NamedTuple):
    """The phases of each axis: in each of N phases the jerk is constant."""

    durations: FloatArray  # (B, N, 3) [s], from 0
    jerks: FloatArray  # (B, N, 3)


class Samples(NamedTuple):
    """States at some times of the flights of a profile."""

    flight: IntArray  # (n,), which of the B flights
    state: SphericalState  # each (n, SAMPLES, 3)


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

    def select(self, flights: IntArray | BoolArray) -> "JerkProfile":
        """Return some of the flights."""
        return JerkProfile(*(getattr(self, field.name)[flights] for field in fields(self)))

    def replace(self, flights: IntArray, other: "JerkProfile") -> None:
        """Replace some flights by those of another profile."""
        for field in fields(self):
            getattr(self, field.name)[flights] = getattr(other, field.name)

    def at(self, times: FloatArray) -> SphericalState:
        """Return the states (B, S, 3) at times (B, S) [s]."""
        phase = (times[:, :, None, None] + SAME_TIME >= self.times[:, None]).sum(axis=2) - 1
        flight = np.arange(len(times))[:, None, None]
        return self._within(flight, phase, times[:, :, None])

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
        phase = ((begin + length / 2)[:, None, None] >= self.times[flight]).sum(axis=1) - 1
        times = begin[:, None] + length[:, None] * np.linspace(0, 1, SAMPLES)
        return Samples(flight, self._within(flight[:, None, None], phase[:, None], times[:, :, None]))

    def _within(self, flight: IntArray, phase: IntArray, times: FloatArray) -> SphericalState:
        """Return the states at times within phases, all of them (..., 3) when broadcast."""
        axis = np.arange(3)
        begin, q, v, a, j = (getattr(self, field.name)[flight, phase, axis] for field in fields(self))
        t = times - begin
        return SphericalState(
            q + t * (v + t * (a / 2 + t * j / 6)), v + t * (a + t * j / 2), a + t * j, np.broadcast_to(j, t.shape)
        )


def _running(start: FloatArray, changes: FloatArray) -> FloatArray:
    """Return starts (B, 3) after none, one, two, ... of the changes (B, N, 3): (B, N + 1, 3)."""
    return np.cumsum(np.concatenate([start[:, None], changes], axis=1), axis=1)
