"""The situation in an episode, as numbers: the belief, the place of people, and the views so far."""

from dataclasses import dataclass

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.planner import Context, Observation
from planners.value.belief import Belief, BeliefModel
from planners.value.body_filter import BodyFilter
from planners.value.view_basis import BASIS_SIZE, DistanceRange, basis_at, turned

PARTS = ("ratio", "history", "belief", "embedding", "facing")  # parts of a situation that a gain field may use
STREAM_MEMORY = 1.0  # [s] that a view counts for in a stream, where evidence fades
STREAM_LOOKAHEAD = 2.0  # [s] that planners look ahead in a stream, whose end nobody knows
_HISTORY = (1, 2, 3, 4, 5, 6, 7, 8, 16)  # places in the basis: harmonics of degree 1 and 2, and the distance


@dataclass(frozen=True, eq=False)
class Situation:
    """What is known of B episodes after a frame.

    Args:
        ratio: (B,) observation ratio; 1 in a stream.
        belief: (B, K) probabilities; in a stream the recogniser's.
        embedding: (B, D), the recogniser's embedding.
        facing: (B, P) [rad], the azimuths that people face.
        facing_std: (B, P) [rad], their standard deviations.
        position: (B, P, 3) [m], the positions of people relative to the centre.
        seen: (B, 21), the mean of the view basis over the frames so far; in a stream late frames count more.
    """

    ratio: FloatArray
    belief: FloatArray
    embedding: FloatArray
    facing: FloatArray
    facing_std: FloatArray
    position: FloatArray
    seen: FloatArray

    @property
    def reference(self) -> FloatArray:
        """The azimuth that a gain field counts from, (B,) [rad].

        For one person, it is the azimuth that the person faces. For several, it is the direction from the first to the
        second. This direction says more about how they hide each other, and is better known from a distance.
        """
        if self.facing.shape[1] == 1:
            return self.facing[:, 0]
        way = self.position[:, 1] - self.position[:, 0]
        return np.arctan2(way[:, 1], way[:, 0])

    def features(self, facing: bool = True) -> dict[str, FloatArray]:
        """Return the numbers (B, size) that a gain field may depend on, for each of `PARTS`.

        Args:
            facing: whether azimuths of the history are counted from the reference, or as they are.
        """
        seen = turned(self.seen, self.reference) if facing else self.seen
        return {
            "ratio": self.ratio[:, None],
            "history": seen[:, _HISTORY],
            "belief": self.belief,
            "embedding": self.embedding,
            "facing": self._people(),
        }

    def _people(self) -> FloatArray:
        """Return where people are and face relative to the reference, and how sure their facing is, (B, 5 P)."""
        cosine, sine = np.cos(self.reference)[:, None], np.sin(self.reference)[:, None]
        east, north = self.position[..., 0], self.position[..., 1]
        turn = self.facing - self.reference[:, None]
        sure = np.exp(-(self.facing_std**2) / 2)  # the length of the mean direction of a normal angle
        ahead, aside = cosine * east + sine * north, cosine * north - sine * east
        return np.concatenate([ahead, aside, sure * np.cos(turn), sure * np.sin(turn), sure], axis=1)


class Tracker:
    """Tracks B episodes frame by frame: the belief, and where people are and face.

    Args:
        belief: the fitted parameters of the belief.
        pairs: (pairs, 2) of [left, right], the joints of the trunk.
    """

    def __init__(self, *, belief: BeliefModel, pairs: IntArray) -> None:
        """Create the tracker; `reset` it before the first frame."""
        self._belief = Belief(belief)
        self._pairs = pairs

    def reset(self, context: Context) -> None:
        """Forget everything."""
        self.context = context
        camera = context.world.camera
        self._body = BodyFilter(pairs=self._pairs, frame_time=context.frame_time, camera=camera)
        self._span = DistanceRange.of(context.world.workspace)
        self._belief.start(context.episodes, len(context.class_names))
        self._seen = np.zeros((context.episodes, BASIS_SIZE))
        self._keep = 1.0 if context.length is not None else float(np.exp(-context.frame_time / STREAM_MEMORY))

    def update(self, observation: Observation) -> None:
        """Take in one more frame."""
        if observation.frame == 0:
            self._body.start(*observation.joints_2d.shape[:2])
        self._body.update(observation.joints_2d, observation.confidence, observation.viewpoint)
        if observation.ratio is not None:
            self._belief.update(observation.log_probs, observation.viewpoint, observation.ratio, observation.frame)
        self._seen = self._keep * self._seen + basis_at(observation.viewpoint, self._span)
        self.observation = observation

    @property
    def situation(self) -> Situation:
        """The situation after the last frame."""
        observation = self.observation
        in_stream = observation.ratio is None
        return Situation(
            ratio=np.full(len(observation.viewpoint), 1.0 if in_stream else observation.ratio),
            belief=np.exp(observation.log_probs if in_stream else self._belief.log_probs),
            embedding=observation.embedding,
            facing=self._body.facing,
            facing_std=self._body.facing_std,
            position=self._body.position,
            seen=self._seen / (self._keep ** np.arange(observation.frame + 1)).sum(),
        )


def frame_gains(frame: int, length: int) -> FloatArray:
    r"""Return the weight of the view in each frame to come, (L - 1 - frame,); the weights sum to 1.

    The recognition after frame s averages the evidence of s frames. So the evidence of frame f enters every frame s
    from f on, with weight 1/s: :math:`\gamma_f \propto \sum_{s \ge f} 1/s`. Early views weigh most.
    """
    after = np.arange(frame + 2, length + 1)  # counted from 1, as s above
    gains = np.cumsum(1 / after[::-1])[::-1]
    share: FloatArray = gains / gains.sum()
    return share


def fading_gains(frames: int, memory: float) -> FloatArray:
    r"""Return the weight of the view in each of the frames to come in a stream, (frames,); the weights sum to 1.

    Evidence fades: in the recognition after frame s, frame f counts as :math:`a^{s - f}`, with :math:`a = e^{-1/m}`. So
    over the frames to come :math:`\gamma_f \propto \sum_{s \ge f} a^{s - f} \propto 1 - a^{n - f + 1}`.
    All count nearly alike, but the last ones.

    Args:
        frames: number n of frames to come; f counts them from 1.
        memory: frames m that a view counts for.
    """
    gains = -np.expm1(-np.arange(frames, 0, -1) / memory)
    share: FloatArray = gains / gains.sum()
    return share


def frames_to_come(context: Context) -> int:
    """Return the most frames that a planner looks ahead: to the end of an episode; of a stream, some seconds."""
    return round(STREAM_LOOKAHEAD / context.frame_time) if context.length is None else context.length - 1


def coming_gains(observation: Observation, context: Context) -> FloatArray:
    """Return the weight of the view in each frame to come, (R,); the weights sum to 1."""
    if observation.length is not None:
        return frame_gains(observation.frame, observation.length)
    return fading_gains(frames_to_come(context), STREAM_MEMORY / context.frame_time)
