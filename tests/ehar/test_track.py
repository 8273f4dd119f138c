"""Which bodies the names of tracks, vehicles, and motions of a user's own mean."""

import json
from pathlib import Path

import numpy as np
import pytest

from ehar.errors import UsageError
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import VEHICLES
from ehar.motion import GridMotion
from ehar.track import IDEAL, Track, load_track
from ehar.viewpoint import Workspace
from ehar.world import PAPER
from tests.helpers.vehicle_files import FILE_KEYS


def test_a_track_is_ideal_or_a_vehicle() -> None:
    assert load_track(IDEAL) == Track() == Track("ideal", None, None)
    assert type(Track().new_motion(PAPER.workspace)) is GridMotion
    for name, vehicle in VEHICLES.items():
        assert load_track(name) == load_track(vehicle) == Track(name, vehicle)
        motion = load_track(name).new_motion(PAPER.workspace)
        assert isinstance(motion, FlightMotion)
        assert motion.vehicle == vehicle


def test_a_motion_of_a_user_s_own_is_copied_for_every_roll() -> None:
    own = GridMotion(workspace=Workspace(distance_max=12.0))
    track = load_track(own)
    assert (track.name, track.vehicle) == ("GridMotion", None)
    first, second = track.new_motion(PAPER.workspace), track.new_motion(PAPER.workspace)
    assert len({id(motion) for motion in (own, first, second)}) == 3
    assert first.workspace == second.workspace == own.workspace
    first.reset(np.array([[10.0, 1.0, 1.0]]), 0.04)
    assert second.velocity.shape == own.velocity.shape == (0, 3)


@pytest.mark.parametrize("kind", [str, Path])
def test_a_vehicle_file_is_a_track_by_its_name(tmp_path: Path, kind: type) -> None:
    path = tmp_path / "slow.json"
    path.write_text(json.dumps(dict.fromkeys(FILE_KEYS, 2.0)))
    track = load_track(kind(path))
    assert track.name == "slow"
    assert track.vehicle is not None
    assert (track.vehicle.name, track.vehicle.speed) == ("slow", 2.0)
    path.write_text(json.dumps({**dict.fromkeys(FILE_KEYS, 2.0), "jerk": 0}))
    with pytest.raises(UsageError, match=r"slow\.json: jerk: expected at least 0.01, got 0"):
        load_track(kind(path))


def test_a_vehicle_is_not_mistaken_for_the_grid(tmp_path: Path) -> None:
    path = tmp_path / "ideal.json"
    path.write_text(json.dumps(dict.fromkeys(FILE_KEYS, 2.0)))
    with pytest.raises(UsageError, match="expected another name of a vehicle file"):
        load_track(str(path))


@pytest.mark.parametrize("name", ["rail", "", "px4", "vehicle.yaml"])
def test_an_unknown_track_lists_the_known_ones(name: str) -> None:
    with pytest.raises(
        UsageError, match="expected ideal, px4-auto, px4-max, tracking-drone, ground-robot, or a vehicle file"
    ):
        load_track(name)
