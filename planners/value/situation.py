"""The situation in an episode, as numbers: the belief, the place of people, and the views so far."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.errors import UsageError
from ehar.planner import Context, Observation
from planners.value.belief.chain import coming_shares
from planners.value.belief.clips import Belief, BeliefModel
from planners.value.belief.filters import StreamBelief
from planners.value.belief.streams import StreamBeliefModel
from planners.value.body_filter import BodyFilter
from planners.value.view_basis import BASIS_SIZE, DistanceRange, basis_at, turned

PARTS = ("ratio", "history", "belief", "embedding", "facing")  # parts of a situation that a gain field may use
STREAM_PARTS = PARTS[1:]  # those that exist in a stream, whose end nobody knows
USUAL_MEMORY = 0.5  # [s] that a view counts for in a stream, where the recogniser does not say
STREAM_LOOKAHEAD = 2.0  # [s] that planners look ahead in a stream, whose end nobody knows
FLIGHT_LOOKAHEAD = 3.0  # [s], with a vehicle, which takes longer to get anywhere; people turn, so not much longer
STREAM_WINDOW = 8.0  # [s] of a stream, the usual length of an episode from which planners learn
FLIGHT_WINDOW = STREAM_WINDOW - STREAM_LOOKAHEAD + FLIGHT_LOOKAHEAD  # [s], from which fields learn in flight
_HISTORY = (1, 2, 3, 4, 5, 6, 7, 8, 16)  # places in the basis: harmonics of degree 1 and 2, and the distance


@dataclass(frozen=True, eq=False)
class Situation:
    """What is known of B episodes after a frame.

    Args:
        ratio: (B,) observation ratio; None in a stream.
        belief: (B, K) probabilities; in a stream the expected share of each class, and last of no activity, in the
            coming seconds that the field was learned to look ahead, (B, K + 1).
        embedding: (B, D), the recogniser's embedding.
        facing: (B, P) [rad], the azimuths that people face.
        facing_std: (B, P) [rad], their standard deviations.
        position: (B, P, 3) [m], the positions of people relative to the centre.
        seen: (B, 21), the mean of the view basis over the frames so far; in a stream late frames count more.
    """

    ratio: FloatArray | None
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
        """Return the numbers (B, size) that a gain field may depend on, for each of `PARTS` that there is.

        Args:
            facing: whether azimuths of the history are counted from the reference, or as they are.
        """
        seen = turned(self.seen, self.reference) if facing else self.seen
        return {
            **({} if self.ratio is None else {"ratio": self.ratio[:, None]}),
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
        belief: the fitted parameters of the belief, in clips or in streams.
        pairs: (pairs, 2) of [left, right], the joints of the trunk.
        memory: time that a view counts for in a stream [s].
        lookahead: time over which the shares of activities are expected in a stream [s]; of no use in clips.
    """

    def __init__(
        self,
        *,
        belief: BeliefModel | StreamBeliefModel,
        pairs: IntArray,
        memory: float = USUAL_MEMORY,
        lookahead: float = STREAM_LOOKAHEAD,
    ) -> None:
        """Create the tracker; `reset` it before the first frame."""
        self._model = belief
        self._pairs = pairs
        self._memory = memory
        self._lookahead = lookahead

    def reset(self, context: Context) -> None:
        """Forget everything.

        Raises:
            UsageError: the belief is for clips and these are streams, or the other way round.
        """
        self.context = context
        if isinstance(self._model, StreamBeliefModel) != (context.length is None):
            kinds = ("clips", "streams") if context.length is None else ("streams", "clips")
            raise UsageError(f"gain model: got one that was trained on {kinds[0]}, expected one for {kinds[1]}")
        self._body = BodyFilter.of(context, self._pairs)
        self._span = DistanceRange.of(context.world.workspace)
        self._belief: Belief | StreamBelief
        if isinstance(self._model, StreamBeliefModel):
            self._belief = StreamBelief(self._model, fps=1 / context.frame_time)
            self._belief.start(context.episodes)
            self._shares: dict[tuple[int, ...], FloatArray] = {}
        else:
            self._belief = Belief(self._model)
            self._belief.start(context.episodes, len(context.class_names))
        self._seen = np.zeros((context.episodes, BASIS_SIZE))
        self._keep = 1.0 if context.length is not None else float(np.exp(-context.frame_time / self._memory))

    def update(self, observation: Observation) -> None:
        """Take in one more frame."""
        self._body.observe(observation)
        if isinstance(self._belief, StreamBelief):
            self._belief.update(observation.log_probs, observation.viewpoint)
        else:
            assert observation.ratio is not None
            self._belief.update(observation.log_probs, observation.viewpoint, observation.ratio, observation.frame)
        self._seen = self._keep * self._seen + basis_at(observation.viewpoint, self._span)
        self.observation = observation
        self.__dict__.pop("situation", None)  # that of the frame before

    def beliefs(self, ends: Sequence[int]) -> FloatArray:
        """Return what is believed of each part of the time to come, (E, B, K) or (E, B, K + 1), see `Situation.belief`.

        In a clip it is the same for all. In a stream activities end, and others follow.

        Args:
            ends: the last frame of each part, counted from 1 and rising.
        """
        if not isinstance(self._belief, StreamBelief):
            return np.repeat(np.exp(self._belief.log_probs)[None], len(ends), axis=0)
        parts = tuple(ends)
        if parts not in self._shares:
            self._shares[parts] = coming_shares(self._belief.model, fps=1 / self.context.frame_time, ends=parts)
        return self._belief.expected(self._shares[parts])

    @cached_property
    def situation(self) -> Situation:
        """The situation after the last frame."""
        observation = self.observation
        (believed,) = self.beliefs([frames_ahead(self.context.frame_time, self._lookahead)])
        return Situation(
            ratio=None if observation.ratio is None else np.full(len(observation.viewpoint), observation.ratio),
            belief=believed,
            embedding=observation.embedding,
            facing=self._body.facing,
            facing_std=self._body.facing_std,
            position=self._body.position,
            seen=self._seen / views_counted(self._keep, observation.frame + 1),
        )


def views_counted(keep: float, frames: IntArray | int) -> FloatArray:
    """Return how much the views of so many frames count together, where a frame keeps the share `keep` of those before.

    Args:
        keep: in (0, 1]; 1 in clips, where nothing fades.
        frames: number of frames, of any shape.
    """
    count = np.asarray(frames, dtype=np.float64)
    together: FloatArray = count if keep == 1 else (1 - keep**count) / (1 - keep)
    return together


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
    if context.length is not None:
        return context.length - 1
    return frames_ahead(context.frame_time, STREAM_LOOKAHEAD if context.vehicle is None else FLIGHT_LOOKAHEAD)


def frames_ahead(frame_time: float, lookahead: float) -> int:
    """Return the number of frames in the time that is looked ahead [s], at least 1."""
    return max(round(lookahead / frame_time), 1)


def coming_gains(observation: Observation, context: Context, memory: float) -> FloatArray:
    """Return the weight of the view in each frame to come, (R,); the weights sum to 1.

    Args:
        observation: the observation of the present frame.
        context: the context of the episodes.
        memory: time that a view counts for in a stream [s].
    """
    if observation.length is not None:
        return frame_gains(observation.frame, observation.length)
    return fading_gains(frames_to_come(context), memory / context.frame_time)
