"""The centre that a camera keeps in its middle while people walk about: a causal filter of where they are."""

from bisect import bisect_left
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from ehar.arrays import BoolArray, FloatArray

_SEED = 0  # the error of a localisation is a property of the stream, so all planners meet the same
_SETTLED = 1e-12  # relative change of the gain from which on it counts as constant


@dataclass(frozen=True, kw_only=True)
class Localisation:
    """How well, and how soon, it is known where people are.

    Args:
        noise: standard deviation of an axis of each frame's position [m].
        delay: age of the position that arrives in a frame [s]; it counts in whole frames.
        agility: standard deviation of people's acceleration that the filter expects [m/s^2].
    """

    noise: Annotated[float, Ge(0)] = 0.05
    delay: Annotated[float, Ge(0)] = 0.1
    agility: Annotated[float, Gt(0)] = 2.0

    def followed(self, middles: FloatArray, fps: float, stream: int, missing: BoolArray | None = None) -> FloatArray:
        """Return where people are thought to be in each frame, (T, 3) [m].

        A Kalman filter of constant velocity takes the positions that arrive, and predicts over their delay. What it
        says at frame t rests on frames up to t minus the delay. From a frame that is missing no position arrives, so
        the filter only predicts. Before the first position arrives, it is where people are in the first frame that is
        not missing: someone put the camera there.

        Args:
            middles: (T, 3) the people's middle [m]; in missing frames it is not read.
            fps: frames per second.
            stream: number of the stream, which decides the error.
            missing: (T,) frames in which nobody knows where people are; None means there are none.
        """
        rng = np.random.default_rng((_SEED, stream))
        measured = middles + self.noise * rng.standard_normal(middles.shape)
        late = round(self.delay * fps)
        known = np.ones(len(middles), dtype=bool) if missing is None else ~missing
        gains, transition = _gains(1 / fps, known[1:], max(self.noise, 1e-6), self.agility)
        ahead = np.linalg.matrix_power(transition, late)[0]
        begin = middles[known.argmax()]
        state = np.stack([begin, np.zeros(3)])  # position and velocity of the three axes
        centres = np.repeat(begin[None].astype(np.float64), len(middles), axis=0)
        for frame in range(1, len(middles)):
            if frame > late:
                state = transition @ state
                if known[frame - late]:
                    state += gains[frame - late - 1][:, None] * (measured[frame - late] - state[0])
                centres[frame] = ahead @ state
        return centres


def _gains(frame_time: float, known: BoolArray, noise: float, agility: float) -> tuple[FloatArray, FloatArray]:
    """Return the gains (T, 2) of the filter of one axis, 0 in frames that are not `known` (T,); and its transition.

    Gains do not depend on what is measured, and are the same for the three axes. So filterpy runs once, and only while
    they change: at the beginning and after each gap.
    """
    from filterpy.common import Q_discrete_white_noise  # imported here: it brings scipy, too slow for `ehar --help`
    from filterpy.kalman import KalmanFilter

    kalman = KalmanFilter(dim_x=2, dim_z=1)
    kalman.F = np.array([[1.0, frame_time], [0.0, 1.0]])
    kalman.H = np.array([[1.0, 0.0]])
    kalman.R = np.array([[noise**2]])
    kalman.Q = Q_discrete_white_noise(dim=2, dt=frame_time, var=agility**2)
    kalman.P = np.diag([noise**2, 1.0])
    gains = np.zeros((len(known), 2))
    gaps = [*np.flatnonzero(~known).tolist(), len(known)]  # and the end
    frame = 0
    while frame < len(known):
        kalman.predict()
        if not known[frame]:
            frame += 1
            continue
        kalman.update(np.zeros(1))
        gains[frame] = kalman.K[:, 0]
        if frame and np.abs(gains[frame] - gains[frame - 1]).max() < _SETTLED * np.abs(gains[frame]).max():
            gap = gaps[bisect_left(gaps, frame)]
            gains[frame:gap] = gains[frame]
            frame = gap
        else:
            frame += 1
    return gains, kalman.F
