"""Episodes that run together: the motion of people, where cameras begin, and all that chance draws beforehand."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ehar.arrays import FloatArray, IntArray, in_brief, read_only
from ehar.data.scenario import Scenarios
from ehar.data.streams.scenario import StreamScenarios
from ehar.data.window import Windows
from ehar.localisation import CentreMotion
from ehar.obstacles.surroundings import Surroundings
from ehar.sensors.sensing import sense
from ehar.sensors.sensor import Sensed, Sensor, SensorNoise, draw_noise
from ehar.viewpoint import away_from, cartesian, turned


@dataclass(frozen=True, eq=False, repr=False)
class Batch:
    """B episodes that run together.

    Args:
        positions: (B, L, P, J, 3) [m], relative to what cameras look at: each scenario's centre, or `gaze`.
        labels: (B,) true classes; of streams (B, L), those of each frame.
        starts: (B, 3) start viewpoints.
        noise: (B, L, ...) random draws of the sensor.
        names: names of the episodes in error messages.
        surroundings: what stands and walks around people; None in an open world.
        centre: the motion of the centre that a vehicle follows, each (B, L, 3); None where the centre rests, or cameras
            follow it at once.
        gaze: (B, L, 3) where cameras look, from that centre [m]; None where they look at the centre.
    """

    positions: FloatArray
    labels: IntArray
    starts: FloatArray
    noise: SensorNoise
    names: tuple[str, ...]
    surroundings: Surroundings | None = None
    centre: CentreMotion | None = None
    gaze: FloatArray | None = None

    __repr__ = in_brief

    @staticmethod
    def of(
        scenarios: Scenarios | StreamScenarios,
        chosen: IntArray,
        starts: FloatArray,
        noise: SensorNoise,
        surroundings: Surroundings | None = None,
    ) -> "Batch":
        """Return episodes of scenarios chosen by index (B,)."""
        sequence, first = scenarios.sequence[chosen], scenarios.first[chosen]
        begins = zip((scenarios.data.sequence_names[index] for index in sequence), first, strict=True)
        return Batch(
            positions=scenarios.positions(chosen),
            # The labels of all windows of streams would fill the memory: those that are not chosen are left out first.
            labels=replace(scenarios, sequence=sequence, first=first).labels,
            starts=starts,
            noise=noise,
            names=tuple(f"{name} from frame {first}" for name, first in begins),
            surroundings=surroundings,
            centre=scenarios.centre_motion(chosen) if isinstance(scenarios, StreamScenarios) else None,
            gaze=scenarios.gaze(chosen) if isinstance(scenarios, StreamScenarios) else None,
        )

    @staticmethod
    def joined(pieces: Sequence["Batch"]) -> "Batch":
        """Return the episodes of several batches, one after another."""
        return Batch(
            positions=np.concatenate([piece.positions for piece in pieces]),
            labels=np.concatenate([piece.labels for piece in pieces]),
            starts=np.concatenate([piece.starts for piece in pieces]),
            noise=SensorNoise(
                *(np.concatenate(draws) for draws in zip(*(piece.noise for piece in pieces), strict=True))
            ),
            names=tuple(name for piece in pieces for name in piece.names),
            surroundings=Surroundings.joined([piece.surroundings for piece in pieces]),
            centre=_joined([piece.centre for piece in pieces if piece.centre is not None]),
            gaze=None if pieces[0].gaze is None else np.concatenate([piece.gaze for piece in pieces]),
        )

    def select(self, rows: IntArray | slice, frames: int | None = None) -> "Batch":
        """Return some of the episodes, cut to their first `frames` frames; None keeps all frames."""
        return Batch(
            positions=self.positions[rows, :frames],
            labels=self.labels[rows] if self.labels.ndim == 1 else self.labels[rows, :frames],
            starts=self.starts[rows],
            noise=SensorNoise(*(draws[rows, :frames] for draws in self.noise)),
            names=tuple(np.array(self.names, dtype=object)[rows]),
            surroundings=None if self.surroundings is None else self.surroundings.select(rows, frames),
            centre=None if self.centre is None else CentreMotion(*(part[rows, :frames] for part in self.centre)),
            gaze=None if self.gaze is None else self.gaze[rows, :frames],
        )

    @property
    def frame_labels(self) -> IntArray:
        """The true classes in each frame, (B, L)."""
        every = self.labels if self.labels.ndim == 2 else self.labels[:, None]
        return np.broadcast_to(every, self.positions.shape[:2])

    def protected(self) -> "Batch":
        """Return a copy that nobody can write into."""
        return replace(
            self,
            positions=read_only(self.positions),
            labels=read_only(self.labels),
            starts=read_only(self.starts),
            noise=SensorNoise(*(read_only(draws) for draws in self.noise)),
            surroundings=None if self.surroundings is None else self.surroundings.protected(),
            centre=None if self.centre is None else CentreMotion(*(read_only(part) for part in self.centre)),
            gaze=None if self.gaze is None else read_only(self.gaze),
        )

    @property
    def around_centre(self) -> FloatArray:
        """The joints relative to the centre that cameras are around, (B, L, P, J, 3) [m]."""
        return self.positions if self.gaze is None else self.positions + self.gaze[:, :, None, None]

    def seen_from(self, frame: int, viewpoint: FloatArray) -> FloatArray:
        """Return viewpoints with cameras' distance from what they look at in a frame, in the shape of `viewpoint`.

        Args:
            frame: the frame.
            viewpoint: around the centre, (B, 3), or of forks (B, F, 3).
        """
        return viewpoint if self.gaze is None else away_from(viewpoint, self._gaze(frame, viewpoint))

    def sense(self, sensor: Sensor, frame: int, viewpoint: FloatArray, where: str = "") -> Sensed:
        """Return what a sensor sees in a frame; see `ehar.sensors.sensing.sense`.

        A camera that looks beside the centre is turned there on the shortest way, so its image does not roll, not even
        straight above people. For the sensor people are turned instead.

        Args:
            sensor: the sensor.
            frame: the frame.
            viewpoint: around the centre, (B, 3), or of forks (B, F, 3).
            where: name of the frame in errors.
        """
        joints, noise = self.positions[:, frame], self.noise.frame(frame)
        if viewpoint.ndim == 3:
            joints, noise = joints[:, None], noise.forked()
        gaze = None if self.gaze is None else self._gaze(frame, viewpoint)
        hidden = None
        if self.surroundings is not None:
            joints, hidden = self.surroundings.show(viewpoint, joints, frame, gaze)
        if gaze is not None:
            place = cartesian(viewpoint)
            joints = turned(joints, place - gaze, place).astype(np.float32)
        return sense(sensor, joints, self.seen_from(frame, viewpoint), noise, where, hidden)

    def _gaze(self, frame: int, viewpoint: FloatArray) -> FloatArray:
        """Return where cameras look in a frame, (B, 3), or (B, 1, 3) for viewpoints of forks (B, F, 3) [m]."""
        assert self.gaze is not None
        gaze = self.gaze[:, frame]
        return gaze if viewpoint.ndim == 2 else gaze[:, None]

    def first_change(self, before: "Batch") -> str | None:
        """Return the name of the first part that is not what it was; None if there is none."""
        now, then = self._arrays, before._arrays
        return next(
            (name for name, array in now.items() if not np.array_equal(array, then[name], equal_nan=True)), None
        )

    @property
    def _arrays(self) -> dict[str, npt.NDArray[np.generic]]:
        """All arrays, by name."""
        held = {"positions": self.positions, "labels": self.labels, "starts": self.starts, **self.noise._asdict()}
        if self.surroundings is not None:
            held |= self.surroundings.arrays
        if self.centre is not None:
            held |= {f"centre's {name}": part for name, part in self.centre._asdict().items()}
        if self.gaze is not None:
            held["gaze"] = self.gaze
        return held


def _joined(centres: Sequence[CentreMotion]) -> CentreMotion | None:
    return CentreMotion(*(np.concatenate(parts) for parts in zip(*centres, strict=True))) if centres else None


def noise_of(scenarios: Windows, episodes: int, rng: np.random.Generator) -> SensorNoise:
    """Draw the sensor's noise for a number of episodes, (B, L, ...)."""
    data = scenarios.data
    return draw_noise(rng, (episodes, scenarios.length), data.persons, len(data.skeleton.joint_names))
