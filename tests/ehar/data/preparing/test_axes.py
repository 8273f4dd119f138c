"""Units and axes of files: nothing is ever mirrored."""

from typing import get_args

import numpy as np
import pytest

from ehar.data.preparing.axes import Up, metres, up_rotation, upright
from ehar.errors import UsageError


@pytest.mark.parametrize("up", get_args(Up))
def test_the_axis_up_becomes_z_and_handedness_stays(up: Up) -> None:
    rotation = up_rotation(up)
    assert np.linalg.det(rotation) == pytest.approx(1)
    pointing = np.eye(3)["xyz".index(up[-1])] * (-1 if up.startswith("-") else 1)
    np.testing.assert_array_equal(upright(pointing, unit="m", up=up), [0, 0, 1])


@pytest.mark.parametrize(("unit", "length"), [("m", 1), ("cm", 0.01), ("mm", 0.001), ("0.0254", 0.0254), (2.0, 2)])
def test_units(unit: str | float, length: float) -> None:
    assert metres(unit) == pytest.approx(length)


@pytest.mark.parametrize("unit", ["inch", "0", "-1", "nan", "inf", ""])
def test_what_is_no_unit(unit: str) -> None:
    with pytest.raises(UsageError, match=r"^unit: got .*, expected m, cm, mm, or a number"):
        metres(unit)


def test_what_is_no_axis() -> None:
    with pytest.raises(UsageError, match=r"^up: got 'x', expected one of z, y, -y, -z"):
        up_rotation("x")  # type: ignore[arg-type]


def test_the_frame_of_images_is_turned_upright_alone() -> None:
    right_down_away = np.eye(3)
    ours = upright(right_down_away, unit="m", up="-y", of_camera=True)
    np.testing.assert_array_equal(ours, [[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    np.testing.assert_array_equal(ours, upright(right_down_away, unit="m", up="-y"))


def test_a_kinects_frame() -> None:
    left_up_ahead = np.eye(3)  # of the camera
    ours = upright(left_up_ahead, unit="m", up="y", of_camera=True)
    np.testing.assert_array_equal(ours, [[-1, 0, 0], [0, 0, 1], [0, 1, 0]])
    np.testing.assert_array_equal(upright(ours, unit="m", up="z", of_camera=True), ours)
