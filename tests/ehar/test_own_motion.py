"""Motions of a user as tracks: by file, or as an object; what is wrong with them is said in one line."""

import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.errors import EpisodeError, UsageError
from ehar.motion import GridMotion
from ehar.runner import Runner
from ehar.sensors.perfect import PerfectSensor
from ehar.track import Track, load_track
from ehar.world import PAPER
from planners.heuristic import HRotate
from tests.helpers.fakes import FakeRecogniser, tiny_batch, tiny_data
from tests.helpers.own_world import OWN

pytestmark = pytest.mark.usefixtures("own_modules")


@pytest.fixture
def own(tmp_path: Path) -> Path:
    path = tmp_path / "mine.py"
    path.write_text(OWN)
    return path


def roll(track: Track) -> Any:
    runner = Runner(tiny_data(), FakeRecogniser(), PerfectSensor(), track)
    return runner.roll(HRotate(), tiny_batch(), np.random.default_rng(0))


def test_a_class_of_a_file_is_made_anew_each_time(own: Path) -> None:
    track = load_track(f"{own}:Slow(every='3')")
    assert (track.name, track.named, track.vehicle) == ("Slow", f"{own}:Slow(every='3')", None)
    one, other = track.new_motion(PAPER.workspace), track.new_motion(PAPER.workspace)
    assert one is not other
    assert one.every == other.every == 3  # type: ignore[attr-defined]
    assert None is not track.sha256 != load_track(f"{own}:Slow").sha256
    assert load_track(f"{own}:Drone").name == "drone"


def test_an_own_motion_carries_the_camera(own: Path) -> None:
    grid, slow = roll(Track()).viewpoints, roll(load_track(f"{own}:Slow")).viewpoints
    np.testing.assert_array_equal(slow[:, 2], grid[:, 1])
    np.testing.assert_array_equal(slow[:, 2], slow[:, 3])


def test_rates_may_be_one_number(own: Path) -> None:
    record = roll(load_track(f"{own}:Hovering"))
    np.testing.assert_array_equal(record.viewpoints, roll(load_track(f"{own}:Slow")).viewpoints)


def test_an_object_is_copied_each_time() -> None:
    mine = GridMotion()
    track = load_track(mine)
    made = track.new_motion(PAPER.workspace)
    assert isinstance(made, GridMotion)
    assert made is not mine
    assert (track.name, track.named) == ("GridMotion", "GridMotion")
    assert track.sha256 is not None
    mine.lock = threading.Lock()  # type: ignore[attr-defined]
    with pytest.raises(
        UsageError, match=r"^motion ehar.motion.GridMotion: expected an object that can be copied: Type"
    ):
        load_track(mine)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Still", "expected what ehar.motion.Motion has, missing: advance"),
        ("Rateless", "expected what ehar.motion.Motion has, missing: velocity, acceleration"),
        ("Boundless", "workspace: expected an ehar.viewpoint.Workspace, got str"),
        ("Ideal", "name: expected another than 'ideal', which is a track of ehar"),
        ("Nameless", "name: expected a line of text, got ' '"),
        ("Single", "its constructor raised RuntimeError: one is enough ({own}, line "),
        ("Slow(every='often')", "every: expected int, got 'often'"),
        ("Unborn", "its constructor raised RuntimeError: no battery ({own}, line "),
    ],
)
def test_what_is_wrong_is_said_in_one_line(own: Path, name: str, message: str) -> None:
    with pytest.raises(UsageError) as error:
        load_track(f"{own}:{name}")
    assert str(error.value).startswith(f"motion {own}:{name.partition('(')[0]}: {message.format(own=own)}")
    assert "\n" not in str(error.value)


def test_what_is_no_motion() -> None:
    with pytest.raises(UsageError, match=r"^motion file absent.py: no such file; expected "):
        load_track("absent.py:Mine")
    with pytest.raises(UsageError, match=r"^motion .*: expected a motion, got a class; make one: GridMotion\(...\)$"):
        load_track(GridMotion)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match=r"expected arguments as \(radius=5, turn='left'\)"):
        load_track("mine.py:Slow(3)")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Stalling", r"RuntimeError: no power \({own}, line \d+\)$"),
        ("Flat", r"viewpoints: expected finite numbers of shape \(6, 3\), got \(6, 2\)$"),
        ("Lost", r"viewpoints: expected finite numbers of shape \(6, 3\), got NaN or infinity$"),
        ("Ragged", r"viewpoints: expected an array of shape \(6, 3\), got list$"),
        ("Rushing", r"velocity: expected finite numbers of shape \(6, 3\), got \(3,\)$"),
    ],
)
def test_what_goes_wrong_in_a_frame_is_one_line(own: Path, name: str, message: str) -> None:
    with pytest.raises(EpisodeError, match=f"^motion {name}, frame 0: " + message.format(own=own)):
        roll(load_track(f"{own}:{name}"))
