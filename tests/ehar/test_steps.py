"""Every step of our motions is one that they can make; a step that they cannot make is named with its limit."""

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import VEHICLES
from ehar.motion import GridMotion, Motion
from ehar.steps import LEAD, StepLimits, from_rest
from ehar.world import PAPER

DIGITS = 6  # of recorded viewpoints


def motion_of(name: str) -> Motion:
    return GridMotion() if name == "ideal" else FlightMotion(vehicle=VEHICLES[name])


def flown(motion: Motion, *, fps: float, frames: int = 40) -> FloatArray:
    """Return ways (8, frames + 1, 3) to random targets, some of which are held."""
    rng = np.random.default_rng(0)
    target = PAPER.sample_starts(rng, 8)
    target[:3, 2] = 0.0  # from straight above
    motion.reset(target.copy(), 1 / fps)
    way = [target]
    for _ in range(frames):
        target = PAPER.sample_starts(rng, 8) if rng.random() < 0.3 else target
        way.append(motion.advance(target.copy()).copy())
    return np.stack(way, axis=1)


@pytest.mark.parametrize("name", ["ideal", *VEHICLES])
@pytest.mark.parametrize("fps", [5.0, 25.0, 60.0])
def test_our_motions_keep_their_limits(name: str, fps: float) -> None:
    motion = motion_of(name)
    limits = StepLimits.of(motion, 1 / fps)
    assert limits is not None
    way = flown(motion, fps=fps)
    assert limits.first_broken(from_rest(way), 1e-9) is None
    assert limits.first_broken(from_rest(way.round(DIGITS)), 0.51 * 10**-DIGITS) is None
    for frame in range(LEAD + 2, way.shape[1]):
        assert limits.first_broken(way[:, frame - LEAD - 2 : frame], 1e-9) is None


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("ideal", [0.1, 0, 0.0628318530717958], "expected a move of the grid within 5 to 15 m"),
        ("ideal", [0.05, 0, 0], "expected a move of the grid"),
        ("px4-auto", [0.5, 0, 0], "with speed 12.5, expected at most 5 of 'px4-auto'"),
        ("px4-auto", [0.01, 0, 0], "with acceleration 6.25, expected at most 3 of 'px4-auto'"),
        ("px4-auto", [0.002, 0, 0], "with jerk 31.25, expected at most 4 of 'px4-auto'"),
    ],
)
def test_a_step_beyond_a_limit_is_named(name: str, change: list[float], said: str) -> None:
    limits = StepLimits.of(motion_of(name), 1 / 25)
    assert limits is not None
    way = np.repeat(np.array([[[8.0, 0.0, np.radians(36)]]]), 6, axis=1).repeat(2, axis=0)
    assert limits.first_broken(from_rest(way), 1e-9) is None
    way[1, 4:] += change
    broken = limits.first_broken(from_rest(way), 1e-9)
    assert broken is not None
    assert (broken.episode, broken.step) == (1, 3)
    assert said in broken.what
    assert broken.what.startswith(f"got from {way[1, 3].tolist()} to {way[1, 4].tolist()}")


@pytest.mark.parametrize(
    ("rates", "said"),
    [
        ([0.0, 5.0, 0.0], "with yaw_rate 5, expected at most 1.74533"),
        ([7.0, 0.0, 0.0], "with climb_speed 7, expected at most 6"),
        ([-7.0, 0.0, 0.0], "with descent_speed 7, expected at most 6"),
        ([5.0, 1.0, 0.0], None),
    ],
)
def test_climbs_descents_and_turns_have_limits_too(rates: list[float], said: str | None) -> None:
    limits = StepLimits.of(motion_of("tracking-drone"), 1 / 25)
    assert limits is not None
    time = np.arange(-LEAD, 10) / 25
    way = np.array([10.0, 3.0, 0.0]) + time[:, None] * rates  # straight above, where turning moves nothing
    broken = limits.first_broken(way[None], 1e-9)
    assert (broken is None) == (said is None)
    assert broken is None or said is None or said in broken.what


def test_nobody_knows_the_limits_of_your_own_motion() -> None:
    class Mine(GridMotion):
        pass

    class Drone(FlightMotion):
        pass

    assert StepLimits.of(Mine(), 0.04) is None
    assert StepLimits.of(Drone(vehicle=VEHICLES["px4-max"]), 0.04) is None
