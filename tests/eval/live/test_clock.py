"""Frames at any time become the recogniser's frames, and what is wrong with their times is said."""

import numpy as np
import pytest

from eval.live.clock import BEGAN_ANEW, DOUBLED, LATE_FRAME, OUT_OF_ORDER, FrameClock

FPS = 30.0


def due(*times: float) -> list[tuple[float, ...]]:
    clock = FrameClock(FPS)
    return [clock.take(time).shares for time in times]


def test_a_camera_of_the_same_rate_is_watched_frame_by_frame() -> None:
    assert due(*(12.3 + np.arange(300) / FPS)) == [(1.0,)] * 300


def test_a_clock_that_trembles_makes_no_difference() -> None:
    rng = np.random.default_rng(0)
    assert due(*(np.arange(300) / FPS + rng.uniform(-0.4, 0.4, 300) / 2 / FPS)) == [(1.0,)] * 300


def test_a_slow_camera_is_filled_in_between() -> None:
    first, *rest = due(0.0, 3 / FPS, 6 / FPS)
    assert first == (1.0,)
    for shares in rest:
        assert shares == pytest.approx((1 / 3, 2 / 3, 1.0))


def test_a_fast_camera_has_frames_for_which_nothing_is_due() -> None:
    counts = [len(shares) for shares in due(*(np.arange(121) / 120))]
    assert sum(counts) == 31 and set(counts) == {0, 1}


@pytest.mark.parametrize("fps", [7.0, 23.976, 29.97, 30.0, 59.94, 100.0])
def test_the_recogniser_sees_its_own_rate_whatever_the_camera_has(fps: float) -> None:
    shown = sum(map(len, due(*(np.arange(0, 20, 1 / fps)))))
    assert shown == pytest.approx(20 * FPS, abs=6)


@pytest.mark.parametrize("times", [2, 3, 4])
def test_of_a_camera_that_is_some_times_as_fast_every_so_many_frames_are_watched(times: int) -> None:
    """Its clock trembles by a millisecond."""
    rng = np.random.default_rng(0)
    clock = FrameClock(15.0)
    watched = [
        number
        for number in range(400)
        if clock.take(number / (15 * times) + (0.001 * rng.standard_normal() if number else 0.0)).shares
    ]
    assert set(np.diff(watched[1:])) == {times}


def test_doubled_and_late_order_are_refused_and_change_nothing() -> None:
    clock = FrameClock(FPS)
    clock.take(0.0), clock.take(2 / FPS)
    assert clock.take(2 / FPS).notes == (DOUBLED,)
    assert clock.take(1 / FPS).notes == (OUT_OF_ORDER,)
    assert clock.take(1 / FPS).refused
    assert clock.take(3 / FPS).shares == (1.0,)


def test_after_a_pause_everything_begins_anew() -> None:
    clock = FrameClock(FPS)
    clock.take(0.0)
    assert len(clock.take(1.0).shares) == 30  # not longer than the pause
    found = clock.take(2.5)
    assert found.anew and not found.refused and found.shares == (1.0,)
    assert clock.take(2.5 + 1 / FPS).notes == ()


def test_a_sender_that_starts_again_begins_anew() -> None:
    clock = FrameClock(FPS)
    clock.take(1000.0)
    assert clock.take(0.0).notes == (BEGAN_ANEW,)
    assert clock.take(1 / FPS).shares == (1.0,)


def test_a_frame_that_takes_longer_than_the_others_is_late_and_watched() -> None:
    clock = FrameClock(FPS)
    assert clock.take(0.0, 500.1).notes == ()
    assert clock.take(0.1, 500.1).notes == ()  # the fastest: nothing of delay is known from the outside
    late = clock.take(0.2, 500.6)
    assert late.notes == (LATE_FRAME,) and late.shares
    assert clock.take(0.3, 500.3).notes == ()


def test_clocks_that_drift_apart_make_nothing_late() -> None:
    clock = FrameClock(FPS)
    hour = np.arange(0, 3600, 0.5)
    assert not any(clock.take(time, 7 + time * 1.00005).notes for time in hour)
