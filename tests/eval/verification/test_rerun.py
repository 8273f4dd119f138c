"""What is drawn for a replay, how a camera is kept on its way, and what counts as noise."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import VEHICLES
from ehar.motion import GridMotion, Motion
from ehar.rollout import Record, rollout
from ehar.sensors.perfect import PerfectSensor
from ehar.viewpoint import AZIMUTH
from eval.records.episodes import DIGITS
from eval.records.flights import FlightRecords
from eval.running.episodes import CHUNK
from eval.verification.checks import FAILED, OK, UNCHECKED
from eval.verification.followed_way import FollowedWay
from eval.verification.rerun import (
    Moves,
    check_moves,
    draw_jobs,
    flight_difference,
    mixed,
    tracking_difference,
)
from planners.heuristic import NoAct, Random, VRotate
from tests.helpers.fakes import tiny_batch, tiny_context
from tests.helpers.made_records import flown, make_records
from tests.helpers.tiny_benchmarks import HashedRecogniser

NAMES = ["a", "b", "c"]


@pytest.mark.parametrize("count", [1, 3, 7, 30])
def test_draws_are_even_over_planners(count: int) -> None:
    jobs = draw_jobs(NAMES, 100 * CHUNK, count, np.random.default_rng(0))
    shares = [sum(name == planner for name, _ in jobs) for planner in NAMES]
    # A few may fall into one chunk.
    assert max(shares) <= -(-count // 3) and sum(shares) <= count
    assert len(jobs) == len(set(jobs)) and {chunk for _, chunk in jobs} <= set(range(100))
    if count == 30:
        assert max(chunk for _, chunk in jobs) > 66 > 33 > min(chunk for _, chunk in jobs)


def test_draws_depend_on_the_seed_only_and_end_with_all() -> None:
    draws = [draw_jobs(NAMES, 100 * CHUNK, 5, np.random.default_rng(seed)) for seed in (0, 0, 1)]
    assert draws[0] == draws[1] != draws[2]
    everything = draw_jobs(NAMES, CHUNK + 1, 10**6, np.random.default_rng(0))
    assert everything == [(name, chunk) for name in NAMES for chunk in (0, 1)]


def test_episodes_are_seen_again_in_groups_that_were_no_chunk() -> None:
    jobs = [("a", 0), ("a", 3), ("b", 2), ("c", 100)]
    groups = mixed(jobs, 100 * CHUNK + 1, np.random.default_rng(0))
    rows = {name: [group for of, group in groups if of == name] for name in NAMES}
    assert sorted(np.concatenate(rows["a"]).tolist()) == [*range(CHUNK), *range(3 * CHUNK, 4 * CHUNK)]
    assert sorted(np.concatenate(rows["b"]).tolist()) == [*range(2 * CHUNK, 3 * CHUNK)]
    assert [group.tolist() for group in rows["c"]] == [[100 * CHUNK]]
    assert all(len(group) < CHUNK for _, group in groups)
    assert all(len(set(group // CHUNK)) == 2 for group in rows["a"])


def run(motion: Motion, planner: VRotate | Random | NoAct, length: int = 10) -> Record:
    context = tiny_context(length=length)
    return rollout(planner, tiny_batch(length=length), HashedRecogniser(), PerfectSensor(), motion, context)


def followed(motion: Motion, way: FloatArray) -> FollowedWay:
    return FollowedWay(motion, way, np.zeros_like(way))


@pytest.mark.parametrize("body", [GridMotion, lambda: FlightMotion(vehicle=VEHICLES["px4-max"])])
def test_a_planner_that_goes_its_own_way_is_not_disturbed(body: type[GridMotion]) -> None:
    first = run(body(), Random())
    motion = followed(body(), first.viewpoints.round(DIGITS))
    again = run(motion, Random())
    np.testing.assert_array_equal(again.viewpoints, first.viewpoints)  # to the last digit, not the recorded one
    np.testing.assert_array_equal(again.log_probs, first.log_probs)
    assert not motion.elsewhere.any()


def test_another_planner_is_kept_on_the_way_and_sees_what_was_seen() -> None:
    first = run(GridMotion(), Random())
    motion = followed(GridMotion(), first.viewpoints)
    again = run(motion, NoAct())
    np.testing.assert_allclose(again.viewpoints, first.viewpoints, atol=1e-9)
    np.testing.assert_allclose(again.log_probs, first.log_probs, atol=1e-5)
    moved = np.abs(np.diff(first.viewpoints, axis=1)).max(axis=2) > 1e-3
    np.testing.assert_array_equal(motion.elsewhere[:, 1:], moved)  # each step that no-act would not have made
    assert not motion.elsewhere[:, 0].any()


def test_half_a_millimetre_off_the_way_is_on_it_and_seen_from_where_it_was_recorded() -> None:
    way = run(GridMotion(), VRotate()).viewpoints
    way[:, 4:] += 5e-4
    motion = followed(GridMotion(), way)
    again = run(motion, VRotate())
    assert not motion.elsewhere.any()
    np.testing.assert_array_equal(again.viewpoints[:, 4:], way[:, 4:])


def test_a_camera_is_exactly_beside_its_way_where_it_is_told_to_be() -> None:
    way = run(GridMotion(), VRotate()).viewpoints.round(DIGITS)
    nudges = np.zeros_like(way)
    nudges[0, 3] = 1e-6, -1e-6, 1e-6
    motion = FollowedWay(GridMotion(), way, nudges)
    again = run(motion, NoAct())
    np.testing.assert_array_equal(again.viewpoints[0, 3], way[0, 3] + nudges[0, 3])
    np.testing.assert_array_equal(again.viewpoints[1:], run(followed(GridMotion(), way), NoAct()).viewpoints[1:])
    np.testing.assert_allclose(again.viewpoints, way, atol=2e-6)


def test_one_near_tie_is_one_step_elsewhere() -> None:
    way = run(GridMotion(), VRotate()).viewpoints
    way[:, 4:, AZIMUTH] += 2 * np.pi / 100  # one move of azimuth, which v-rotate would never make
    motion = followed(GridMotion(), way)
    run(motion, VRotate())
    assert motion.elsewhere.sum(axis=0).tolist() == [0, 0, 0, 0, len(way), 0, 0, 0, 0, 0]


def test_moves_are_held_to_a_share_of_frames_and_flights_are_not() -> None:
    on_grid, in_flight = make_records(0), flown(make_records(0))
    few, many = Moves(100, 5, (1, 2)), Moves(100, 6, (1, 2))
    records = {"a": on_grid, "b": on_grid, "c": in_flight}
    checks = check_moves(records, {"a": few, "b": many, "c": many}, {"d": "unknown"})
    assert [(check.result, check.what.partition(",")[0]) for check in checks] == [
        (OK, "95 of 100 frames of 1 planners"),
        (FAILED, "episodes.jsonl: b"),
        (UNCHECKED, "c: goes elsewhere in 6 of 100 frames; a flight that left its way cannot be brought back to it"),
        (UNCHECKED, "d: unknown"),
    ]
    assert "episode 1 ('séquence 0' from frame 1), frame 2: goes elsewhere in 6 of 100 frames" in checks[1].what
    # The first frame of an episode, which nobody chose, does not count.
    elsewhere = np.array([[False, False, False], [False, True, True]])
    counted = Moves().after(elsewhere, np.array([4, 5])).after(elsewhere, np.array([6, 7]))
    assert counted == Moves(8, 4, (5, 1))


def test_flights_that_left_their_way_are_not_compared() -> None:
    kept = flown(make_records(0))
    assert kept.flight is not None
    rows = np.arange(2, 6)
    again = FlightRecords(*(getattr(kept.flight, key)[rows] for key in FlightRecords.__dataclass_fields__))
    nowhere = np.zeros((4, 4), dtype=bool)
    assert flight_difference("nbv", kept, rows, again, nowhere) is None
    harder = replace(again, effort=again.effort + np.array([0, 0.005, 0.5, 0]))
    found = flight_difference("nbv", kept, rows, harder, nowhere)
    assert found is not None and found.startswith("episodes.jsonl: nbv, episode 4 (") and ": effort: got 0." in found
    left = nowhere.copy()
    left[2, 3] = True
    assert flight_difference("nbv", kept, rows, harder, left) is None
    old = replace(kept, flight=replace(kept.flight, distance=None, energy=None, noise=None))
    assert flight_difference("nbv", old, rows, again, nowhere) is None
    no_body = replace(again, energy=None, noise=None)
    assert "got energy, expected none for this vehicle" in str(flight_difference("nbv", kept, rows, no_body, nowhere))
    path = np.full((4, 4), 0.2)
    followed = replace(kept, tracking_error=np.full(kept.predicted.shape, 0.205))
    assert tracking_difference("nbv", kept, rows, path, nowhere) is None, "from before it was recorded"
    assert tracking_difference("nbv", followed, rows, path, nowhere) is None
    found = tracking_difference("nbv", followed, rows, path - 0.1 * left, nowhere)
    assert found is not None and ", frame 3: tracking_error: got 0.205, expected 0.1" in found
    assert tracking_difference("nbv", followed, rows, path - 0.1 * left, left) is None
    assert "expected none of a planner" in str(tracking_difference("nbv", followed, rows, None, nowhere))
    grounded = replace(kept, flight=None)
    assert "got no peak_speed, " in str(flight_difference("nbv", grounded, rows, again, nowhere))
