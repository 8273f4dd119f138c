"""Sets up and runs rollouts: the planner's context, the batch of episodes, and the motion."""

from dataclasses import dataclass, field, replace

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.batch import Batch, noise_of
from ehar.data.recordings import Recordings
from ehar.data.scenario import Scenarios, localised
from ehar.data.streams.data import StreamData
from ehar.data.streams.scenario import StreamScenarios
from ehar.data.surroundings import surroundings_of
from ehar.errors import UsageError
from ehar.flight.centre import around_centre, centre_limits
from ehar.motion import CarriedMotion, FollowingMotion, Motion
from ehar.onsets import Onset
from ehar.planner import Context, Planner
from ehar.recogniser import Recogniser
from ehar.rollout import Record, rollout
from ehar.sensors.sensor import Sensor
from ehar.track import Track
from ehar.viewpoint import Workspace
from ehar.world import PAPER, World

LOST = 0.5  # share of the nearest distance; people who are farther from the centre are not in the middle any more


@dataclass(frozen=True, eq=False, repr=False)
class Runner:
    """Rolls planners over episodes.

    Args:
        data: the recorded motion.
        recogniser: the recogniser that all planners share.
        sensor: the sensor that all planners share.
        track: how cameras move.
        world: where cameras may be, and where episodes begin.
        onset: whether the recogniser is told when an activity of a stream begins.
    """

    data: Recordings
    recogniser: Recogniser
    sensor: Sensor
    track: Track = field(default_factory=Track)
    world: World = PAPER
    onset: Onset = "unknown"

    def __repr__(self) -> str:
        """Return one line that names each part."""
        seen = f"{type(self.recogniser).__name__}, sensor {self.sensor.name}, track {self.track.name}"
        return f"Runner({self.data.title}, {seen}{'' if self.world == PAPER else f', world {self.world.name}'})"

    def new_motion(self) -> Motion:
        """Return a new motion of the track, in the world's workspace."""
        return self.track.new_motion(self.world.workspace, moving_centre=self._follows_people)

    def batch(
        self, scenarios: Scenarios | StreamScenarios, chosen: IntArray, starts: FloatArray, rng: np.random.Generator
    ) -> Batch:
        """Return episodes that run together.

        Args:
            scenarios: the motions.
            chosen: (B,) index into `scenarios`.
            starts: (B, 3) start viewpoints.
            rng: draws the sensor's noise, and passers-by.

        Raises:
            UsageError: people move too fast for the vehicle.
        """
        scenarios = self.followed(scenarios)
        self.check_followed(scenarios, chosen)
        noise = noise_of(scenarios, len(chosen), rng)
        return Batch.of(scenarios, chosen, starts, noise, surroundings_of(scenarios, chosen, self.world, rng))

    def followed(self, scenarios: Scenarios | StreamScenarios) -> Scenarios | StreamScenarios:
        """Return scenarios with the world's localisation; a centre that a vehicle follows keeps its limits."""
        scenarios = localised(scenarios, self.world)
        if isinstance(scenarios, StreamScenarios) and self._follows_people:
            assert self.track.vehicle is not None
            return replace(scenarios, limits=centre_limits(self.track.vehicle))
        return scenarios

    def context(
        self,
        episodes: int,
        length: int | None,
        rng: np.random.Generator,
        workspace: Workspace | None = None,
        *,
        follows: bool = False,
    ) -> Context:
        """Return what a planner is told before a batch begins.

        Args:
            episodes: B.
            length: L, frames in an episode; None in a stream.
            rng: the planner's generator.
            workspace: where the camera may be; None means all of the world's.
            follows: whether the motion follows paths.
        """
        vehicle = self.track.vehicle
        if vehicle is not None and self._follows_people:
            vehicle = around_centre(vehicle)
        return Context(
            episodes=episodes,
            length=length,
            frame_time=1 / self.data.fps,
            class_names=self.data.recognised_names,
            skeleton=self.data.skeleton,
            workspace=workspace or self.world.workspace,
            track=self.track.name,
            rng=rng,
            vehicle=vehicle,
            world=self.world,
            follows=follows,
        )

    def roll(self, planner: Planner, batch: Batch, rng: np.random.Generator, motion: Motion | None = None) -> Record:
        """Run a planner over a batch.

        Args:
            planner: decides where to look from.
            batch: the episodes.
            rng: the planner's generator.
            motion: carries the camera; None creates a new motion of the track.

        Raises:
            EpisodeError: see `ehar.rollout.rollout`.
        """
        body = self.new_motion() if motion is None else motion
        if isinstance(body, CarriedMotion):
            body.centre = batch.centre
        episodes, frames = batch.positions.shape[:2]
        length = None if batch.labels.ndim > 1 else frames
        context = self.context(episodes, length, rng, body.workspace, follows=isinstance(body, FollowingMotion))
        return rollout(planner, batch, self.recogniser, self.sensor, body, context, self.onset)

    @property
    def _follows_people(self) -> bool:
        """Whether a vehicle flies around a centre that moves; your own motion says nothing about how it follows."""
        return isinstance(self.data, StreamData) and self.track.vehicle is not None and self.track.own is None

    def followed_everywhere(self, scenarios: Scenarios | StreamScenarios) -> Scenarios | StreamScenarios:
        """Return scenarios as `followed` does, of which any may be drawn.

        Raises:
            UsageError: as `check_followed`, which looks at windows that overlap as little as they cover all frames.
        """
        last = np.append(np.diff(scenarios.sequence) != 0, True)[: len(scenarios)]
        self.check_followed(scenarios, np.flatnonzero((scenarios.first % scenarios.length == 0) | last))
        return self.followed(scenarios)

    def check_followed(self, scenarios: Scenarios | StreamScenarios, chosen: IntArray | None = None) -> None:
        """Raise a UsageError that names the stream if people get away from the vehicle that follows them.

        Args:
            scenarios: the motions.
            chosen: which of them; None means all.
        """
        scenarios = self.followed(scenarios)
        if not isinstance(scenarios, StreamScenarios) or scenarios.limits is None:
            return
        chosen = np.arange(len(scenarios)) if chosen is None else chosen
        if not len(chosen):
            return
        most = LOST * self.world.workspace.distance_min
        behind = np.linalg.norm(scenarios.centres(chosen) - replace(scenarios, limits=None).centres(chosen), axis=-1)
        if behind.max() > most:
            episode, frame = np.unravel_index(np.argmax(behind), behind.shape)
            name = scenarios.data.sequence_names[scenarios.sequence[chosen[episode]]]
            raise UsageError(
                f"track {self.track.name}: too slow for the people of {name!r}, frame "
                f"{scenarios.first[chosen[episode]] + frame}: expected to stay within {most:g} m of them, "
                f"got {behind.max():.1f} m"
            )
