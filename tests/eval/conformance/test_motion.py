"""The conformance kit of motions finds what is wrong, and nothing where nothing is."""

import threading

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.conditions import Conditions
from ehar.motion import GridMotion, Motion
from eval import check_motion
from eval.conformance.checks import Conformance
from tests.helpers.fakes import tiny_data

CONDITIONS = Conditions(data=tiny_data())
FIRST = "carries a batch of 7 to viewpoints (7, 3), with velocities and accelerations"
ROWS = "rows alone, beside others, and in another order, move the same"
STAY = "begins at rest at the start, and stays where it is told to stay"
COPY = "can be copied, and sent to a worker process"
LEFT = "leaves what it is handed as it is"


class Drifting(GridMotion):
    def advance(self, target: FloatArray) -> FloatArray:
        return super().advance(target + np.array([2.0, 0.0, 0.0]))


class Moving(GridMotion):
    @property
    def velocity(self) -> FloatArray:
        return np.ones(self._viewpoint.shape)


class Leaving(GridMotion):
    def advance(self, target: FloatArray) -> FloatArray:
        return super().advance(target) + np.array([20.0, 0.0, 0.0]) * (target[:, :1] > 10)


class Fleeing(GridMotion):
    def advance(self, target: FloatArray) -> FloatArray:
        here = self._viewpoint
        return super().advance(np.where(np.abs(target - here) < 1e-9, target, 2 * here - target))


class Tired(GridMotion):
    """Needs a rest after so many frames, and does not recover in reset."""

    frames = 0

    def advance(self, target: FloatArray) -> FloatArray:
        self.frames += 1
        return super().advance(target if self.frames <= 40 else self._viewpoint)


class Together(GridMotion):
    def advance(self, target: FloatArray) -> FloatArray:
        return super().advance(target + 0 * target if len(target) == 1 else np.broadcast_to(target[:1], target.shape))


class Scribbling(GridMotion):
    def reset(self, viewpoint: FloatArray, frame_time: float) -> None:
        super().reset(viewpoint, frame_time)
        viewpoint[:] = 0


class Sharing(GridMotion):
    """Keeps where it is in what copies share."""

    places: dict[int, FloatArray] = {}  # noqa: RUF012

    def reset(self, viewpoint: FloatArray, frame_time: float) -> None:
        super().reset(viewpoint, frame_time)
        self.places[0] = self._viewpoint

    def advance(self, target: FloatArray) -> FloatArray:
        self._viewpoint = self.places[0]
        self.places[0] = super().advance(target)
        return self.places[0]


class Locked(GridMotion):
    def reset(self, viewpoint: FloatArray, frame_time: float) -> None:
        super().reset(viewpoint, frame_time)
        self.lock = threading.Lock()


class Raising(GridMotion):
    def advance(self, target: FloatArray) -> FloatArray:
        raise RuntimeError("no\npower")


def checked(motion: Motion | str) -> Conformance:
    return check_motion(motion, CONDITIONS)


def failed(found: Conformance) -> list[str]:
    return [check.name for check in found.failed]


def test_nothing_is_wrong() -> None:
    for motion in ("ideal", GridMotion(), "px4-auto"):  # px4-auto's proposals tie: no row may decide for another
        found = checked(motion)
        assert len(found.checks) == 11
        assert all(check.passed for check in found.checks), str(found)


@pytest.mark.parametrize(
    ("motion", "name"),
    [
        (Drifting(), STAY),
        (Moving(), STAY),
        (Leaving(), "stays within its workspace"),
        (Fleeing(), "approaches a target that is held"),
        (Tired(), "forgets all in reset"),
        (Together(), ROWS),
        (Scribbling(), LEFT),
        (Sharing(), COPY),
        (Locked(), COPY),
        (Raising(), FIRST),
    ],
)
def test_what_is_wrong_is_found(motion: Motion, name: str) -> None:
    found = checked(motion)
    assert name in failed(found), str(found)


def test_what_raises_is_named_with_its_line() -> None:
    check = checked(Raising()).checks[0]
    assert check.got.startswith(f"advance, frame 0: RuntimeError: no power ({__file__}, line ")
