"""The centre that a camera keeps in its middle while people walk about: a causal filter of where they are."""

from bisect import bisect_left
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le

from ehar.arrays import BoolArray, FloatArray
from ehar.errors import UsageError

_SEED = 0  # the error of a localisation is a property of the stream, so all planners meet the same
_PACE = 1.0  # [1/s]; how fast the centre that a vehicle follows gets to where people are thought to be
_BETWEEN = 0.99  # share of the speed limit for frames, so that the speed keeps it between them too
HELD = 1.0  # [s] for which people are thought to go on as they went, if nobody says where they are; then they stay
_SETTLED = 1e-12  # relative change of the gain from which on it counts as constant
MOST_NOISE = 10.0  # [m]; with more, cameras would look anywhere
MOST_DELAY = 10.0  # [s]; nobody predicts farther
MOST_AGILITY = 100.0  # [m/s^2]; people have a tenth of it


class CentreMotion(NamedTuple):
    """The motion of a centre, each (..., T, 3); the jerk is constant within a frame."""

    position: FloatArray  # [m]
    velocity: FloatArray  # [m/s]
    acceleration: FloatArray  # [m/s^2]
    jerk: FloatArray  # [m/s^3], until the next frame


@dataclass(frozen=True, kw_only=True)
class CentreLimits:
    """The limits of a centre's motion.

    Args:
        speed: greatest speed [m/s].
        vertical_speed: greatest speed upwards or downwards [m/s].
        acceleration: greatest acceleration [m/s^2].
        jerk: greatest jerk [m/s^3].
    """

    speed: float
    vertical_speed: float
    acceleration: float
    jerk: float


@dataclass(frozen=True, kw_only=True)
class Localisation:
    """How well, and how soon, it is known where people are.

    Args:
        noise: standard deviation of an axis of each frame's position [m].
        delay: age of the position that arrives in a frame [s]; it counts in whole frames.
        agility: standard deviation of people's acceleration that the filter expects [m/s^2].

    Raises:
        UsageError: a number is not finite, is below 0 or, for agility, 0, or is too large to be meant.
    """

    noise: Annotated[float, Ge(0), Le(MOST_NOISE)] = 0.05
    delay: Annotated[float, Ge(0), Le(MOST_DELAY)] = 0.1
    agility: Annotated[float, Gt(0), Le(MOST_AGILITY)] = 2.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, most in (("noise", MOST_NOISE), ("delay", MOST_DELAY), ("agility", MOST_AGILITY)):
            value = getattr(self, name)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not (number and 0 <= value <= most) or (name == "agility" and value == 0):
                least = "above 0, and at most" if name == "agility" else "from 0 to"
                raise UsageError(f"localisation: {name}: expected a number {least} {most:g}, got {value!r:.80}")

    def __str__(self) -> str:
        """Return the numbers with their names and units."""
        return f"noise {self.noise:g} m, delay {self.delay:g} s, agility {self.agility:g} m/s^2"

    @property
    def numbers(self) -> tuple[float, ...]:
        """All numbers."""
        return (self.noise, self.delay, self.agility)

    def estimated(
        self, middles: FloatArray, fps: float, stream: int, missing: BoolArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return where people are thought to be in each frame [m], and the filter's velocities [m/s], (T, 3) each.

        A Kalman filter of constant velocity takes the positions that arrive, and predicts over their delay. What it
        says at frame t rests on frames up to t minus the delay. From a frame that is missing no position arrives, so
        the filter only predicts, for `HELD` seconds. Then it stays at what it says for the time of arrival, without the
        way ahead over the delay: nobody walks on as he did for the ten seconds that a tracker may take to find him.
        Before the first position arrives, it is where people are in the first frame that is not missing: someone put
        the camera there.

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
        held, unknown = round(HELD * fps), 0  # frames
        state = np.stack([begin, np.zeros(3)])  # position and velocity of the three axes
        centres = np.repeat(begin[None].astype(np.float64), len(middles), axis=0)
        velocities = np.zeros(centres.shape)
        for frame in range(1, len(middles)):
            if frame > late:
                state = transition @ state
                unknown = 0 if known[frame - late] else unknown + 1
                if unknown > held:
                    state[1] = 0.0
                if not unknown:
                    state += gains[frame - late - 1][:, None] * (measured[frame - late] - state[0])
                centres[frame], velocities[frame] = ahead @ state, state[1]
        return centres, velocities


USUAL_LOCALISATION = Localisation()


def smoothed(wanted: FloatArray, velocity: FloatArray, frame_time: float, limits: CentreLimits) -> CentreMotion:
    """Return the motion of a centre that goes after positions [m] and velocities [m/s], (T, 3) each, and keeps limits.

    What a filter says jumps with every position that arrives, and no vehicle can do that. The jerk that leads on from
    frame t rests on what is said up to frame t.
    """
    centre = SmoothCentre(wanted[0], frame_time, limits)
    return CentreMotion(*np.stack([centre.lead_on(*after) for after in zip(wanted, velocity, strict=True)], axis=1))


class SmoothCentre:
    """A centre that goes after positions and velocities, a frame at a time, and keeps limits.

    A cascade as in flight controllers: the error of the position asks for a velocity, that of the velocity for an
    acceleration, that of the acceleration for a jerk. Each is cut at its limit. With nothing to cut, three poles lie at
    -`_PACE`. The acceleration is a mean of the last one and the one asked for, so it keeps its limit too. If the speed
    would not, even were the acceleration to end as soon as it may, the acceleration ends so.

    Heights are scaled such that their speed has the limit of the speed, and lengths then count in all directions.

    Args:
        begin: (3,) where it rests at first [m].
        frame_time: time of one frame [s].
        limits: the limits of its motion.
    """

    def __init__(self, begin: FloatArray, frame_time: float, limits: CentreLimits) -> None:
        """Create the centre at rest."""
        self._scale = np.array([1.0, 1.0, max(limits.speed / limits.vertical_speed, 1.0)])
        self._frame_time, self._limits = frame_time, limits
        self._here, self._velocity, self._acceleration = begin * self._scale, np.zeros(3), np.zeros(3)

    @property
    def place(self) -> FloatArray:
        """Where the centre is now, (3,) [m]."""
        place: FloatArray = self._here / self._scale
        return place

    def lead_on(self, wanted: FloatArray, velocity: FloatArray) -> FloatArray:
        """Return the state now, (4, 3): position, velocity, acceleration and the jerk that leads on; go on a frame.

        Args:
            wanted: (3,) where the centre should be now [m].
            velocity: (3,) how fast that moves [m/s].
        """
        limits, frame_time = self._limits, self._frame_time
        top, most = _BETWEEN * limits.speed, limits.jerk * frame_time
        here, v, a = self._here, self._velocity, self._acceleration
        faster = _cut(velocity * self._scale + _PACE / 3 * (wanted * self._scale - here), top)
        harder = _cut(_PACE * (faster - v), limits.acceleration)
        change = _cut(min(3 * _PACE * frame_time, 1.0) * (harder - a), most)
        after = v + frame_time * (a + change / 2)
        if max(_length(after), _length(after + frame_time / 2 * _frames_to_end(a + change, most) * (a + change))) > top:
            change = -a / max(_frames_to_end(a, most), 1)
            after = v + frame_time * (a + change / 2)
        self._here = here + frame_time * (v + frame_time * (a / 2 + change / 6))
        self._velocity, self._acceleration = after, a + change
        state: FloatArray = np.stack([here, v, a, change / frame_time]) / self._scale
        return state


class FollowedCentre:
    """A centre that goes after people whose place is told now and then, at any times; as `smoothed`.

    A Kalman filter of constant velocity takes the places, and predicts on from when it was told the last one, for
    `HELD` seconds. Then nobody knows where people are, and the centre comes to rest. The age of a place is not made up
    for: the place counts as of when it is told, and its time says only how long it is after the one before.

    Args:
        place: (3,) where people are first said to be [m].
        time: when [s].
        frame_time: time from one state to the next [s].
        limits: the limits of its motion.
        localisation: how well places are known; its delay is not used.
    """

    def __init__(
        self,
        place: FloatArray,
        time: float,
        frame_time: float,
        limits: CentreLimits,
        localisation: Localisation = USUAL_LOCALISATION,
    ) -> None:
        """Create the centre, at rest where people are."""
        self._told, self._frame_time = localisation, frame_time
        self._begin(place, time)
        self._smooth = SmoothCentre(place, frame_time, limits)
        self.motion = CentreMotion(*self._smooth.lead_on(place, np.zeros(3)))

    def _begin(self, place: FloatArray, time: float) -> None:
        """Begin the filter where people are; nothing is known of how they move."""
        from filterpy.kalman import KalmanFilter  # imported here: it brings scipy, too slow for `ehar --help`

        self._filter = KalmanFilter(dim_x=6, dim_z=3)
        self._filter.x = np.concatenate([place, np.zeros(3)])[:, None]
        self._filter.H = np.eye(3, 6)
        self._filter.R = max(self._told.noise, 1e-6) ** 2 * np.eye(3)
        self._filter.P = np.diag([self._told.noise**2] * 3 + [1.0] * 3)
        self._time, self._since = time, 0.0

    def tell(self, place: FloatArray, time: float) -> None:
        """Say where people are, (3,) [m]; what is a little older than what was said before is left out.

        After a pause, and when the clock goes back by as much, the filter begins anew.
        """
        from filterpy.common import Q_discrete_white_noise  # imported here: too slow for `ehar --help`

        elapsed = time - self._time
        if abs(elapsed) > HELD:
            self._begin(place, time)
            return
        if elapsed <= 0:
            return
        noise = Q_discrete_white_noise(dim=2, dt=elapsed, var=self._told.agility**2)
        self._filter.F = np.eye(6) + elapsed * np.eye(6, k=3)
        self._filter.predict(Q=np.kron(noise, np.eye(3)))
        self._filter.update(place[:, None])
        self._time, self._since = time, 0.0

    def next(self) -> CentreMotion:
        """Return the motion one frame later, each (3,)."""
        self._since += self._frame_time
        place, velocity = self._filter.x[:3, 0], self._filter.x[3:, 0]
        if self._since > HELD:
            place, velocity = self._smooth.place, np.zeros(3)
        else:
            place = place + self._since * velocity
        self.motion = CentreMotion(*self._smooth.lead_on(place, velocity))
        return self.motion


def _frames_to_end(acceleration: FloatArray, most: float) -> int:
    """Return the frames that an acceleration (3,) takes to end, if each changes it by `most` at most."""
    return int(np.ceil(_length(acceleration) / most - 1e-9))


def _cut(vector: FloatArray, longest: float) -> FloatArray:
    """Return a vector (3,), shortened to a length if it is longer."""
    length = _length(vector)
    return vector if length <= longest else vector * (longest / length)


def _length(vector: FloatArray) -> float:
    return float(np.sqrt(vector @ vector))


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
