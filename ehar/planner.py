"""The contract of a planner: it sees an observation and says where it wants the camera to be."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from ehar.arrays import FloatArray, IntArray, in_brief
from ehar.data.skeleton import Skeleton
from ehar.flight.vehicle import Vehicle
from ehar.motion import Motion
from ehar.recogniser import Recogniser, Recognition
from ehar.sensors.sensor import Sensed
from ehar.viewpoint import Workspace
from ehar.world import PAPER, World


@dataclass(frozen=True, repr=False)
class Context:
    """The information that a planner gets before a batch of B episodes begins."""

    episodes: int  # B
    length: int | None  # L, frames in an episode; None in a stream, whose end nobody knows
    frame_time: float  # [s]
    class_names: tuple[str, ...]
    skeleton: Skeleton
    workspace: Workspace  # where the camera may be: the world's, or that of your own motion
    track: str  # "ideal": grid moves, or the name of a vehicle or of your own motion
    rng: np.random.Generator  # the planner's generator, the same for the same episodes
    vehicle: Vehicle | None = None  # what carries the camera; None on the ideal track, and of a motion without one
    world: World = PAPER  # the world, with the cameras' intrinsics
    follows: bool = False  # whether the motion follows paths, not only targets

    __repr__ = in_brief


@dataclass(frozen=True, repr=False)
class Truth:
    """The information for privileged planners only: the label, the future, and a recogniser to imagine with."""

    labels: IntArray  # (B,); in a stream those of the next frame
    recogniser: Recogniser
    state: Any  # the recogniser's state after the present frame
    sense: Callable[[int, FloatArray], Sensed]  # (frame, viewpoints (B, F, 3)) -> what would be sensed, (B, F, ...)
    frame_labels: IntArray  # (B, L), those of every frame
    fork_motion: Callable[[int], Motion] | None = None  # F -> B x F cameras that go on from here; not of every motion
    # (frame, viewpoints (B, F, 3)) -> as the recogniser is told them: away from what cameras look at; None: as they are
    seen_from: Callable[[int, FloatArray], FloatArray] | None = None

    __repr__ = in_brief

    @property
    def length(self) -> int:
        """L, the frames of the episode; in a stream too."""
        return int(self.frame_labels.shape[1])

    def imagine(self, state: Any, frame: int, viewpoint: FloatArray) -> tuple[Recognition, Any]:
        """Return what would be recognised after a frame, and the state then, just as if cameras had been there.

        Args:
            state: the recogniser's state before the frame: `state`, or one that follows from it, with F forks.
            frame: the frame.
            viewpoint: (B, F, 3).
        """
        told = viewpoint if self.seen_from is None else self.seen_from(frame, viewpoint)
        return self.recogniser.step(state, self.sense(frame, viewpoint), told)


@dataclass(frozen=True, repr=False)
class Observation:
    """The information that a planner gets in each frame. All arrays start with B."""

    frame: int  # 0 to L - 2, as nobody moves after the last one
    length: int | None  # L; None in a stream
    joints_2d: FloatArray  # (B, P, J, 2) [px]
    confidence: FloatArray  # (B, P, J) in [0, 1]
    viewpoint: FloatArray  # (B, 3): distance [m], azimuth [rad], polar angle [rad]
    log_probs: FloatArray  # (B, K), from the recogniser, after this frame
    embedding: FloatArray  # (B, D), from the recogniser, after this frame
    velocity: FloatArray  # (B, 3): rates of the viewpoint [m/s], [rad/s]; 0 on the ideal track
    acceleration: FloatArray  # (B, 3): derivatives of `velocity` [m/s^2], [rad/s^2]; 0 on the ideal track
    truth: Truth | None = field(default=None, repr=False)  # privileged planners only
    time: float = 0.0  # [s] since the first frame
    passers: FloatArray | None = None  # (B, W, 4): place [m] and velocity [m/s] of passers-by along x and y, as tracked
    centre: FloatArray | None = None  # (B, 3) [m]: where it is, from where it began; None if it stays or all is open
    gaze: FloatArray | None = None  # (B, 3) [m]: what cameras look at, from the centre; None where they look at it

    __repr__ = in_brief

    @property
    def ratio(self) -> float | None:
        """The share of the episode that has been observed, in (0, 1]; None in a stream."""
        return None if self.length is None else (self.frame + 1) / self.length


class Planner(Protocol):
    """Decides where to look from. Subclass it (or match it) and hand an instance to `eval.benchmark`.

    A planner never holds the environment, the 3D joints or the label. Only a planner that declares `privileged = True`
    gets `Observation.truth`, and every report marks it.
    """

    name: str
    privileged: bool = False

    def reset(self, context: Context) -> None:
        """Prepare for a new batch of episodes."""

    def act(self, observation: Observation) -> FloatArray:
        """Return target viewpoints (B, 3); the motion decides how far the camera gets in one frame.

        Where `Context.follows`, a planner may instead return paths (B, F, 3, 3): the states in which cameras should be
        after each of the next F frames, each a viewpoint, its velocity and its acceleration.
        """
        ...
