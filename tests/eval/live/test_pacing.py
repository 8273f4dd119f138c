"""Setpoints come at once where there are decisions, and on time where there are none."""

import numpy as np
import pytest

from eval.live.pacing import Pacer

TICK = 1 / 60


def made(decisions: np.ndarray, until: float, look: float = 0.001) -> np.ndarray:
    """Return when setpoints are made, for decisions at some times [s]."""
    pacer, found = Pacer(TICK), []
    left = list(decisions)
    for now in np.arange(0, until, look):
        decided = bool(left and left[0] <= now)
        if decided:
            left.pop(0)
        if pacer.due(now, decided=decided):
            found.append(now)
    return np.array(found)


def test_each_decision_at_the_rate_gets_a_setpoint_at_once() -> None:
    rng = np.random.default_rng(0)
    frames = 0.5 + np.arange(600) * TICK
    decisions = frames + rng.uniform(0.002, 0.009, 600)
    times = made(decisions, 10.6)
    after = times[np.searchsorted(times, decisions)]
    assert (after - decisions).max() < 0.002
    assert ((times >= 0.5) & (times < frames[-1] + 0.01)).sum() == pytest.approx(600, abs=2), "one for each, no more"


def test_without_decisions_the_stream_goes_on_at_its_rate() -> None:
    times = made(np.array([]), 3.0)
    assert np.diff(times)[1:].max() < 1.2 * TICK
    assert len(times) == pytest.approx(180, abs=3)


def test_a_burst_of_decisions_makes_no_burst_of_setpoints() -> None:
    times = made(np.full(20, 1.0), 1.5)
    assert len(times[(times >= 1.0) & (times < 1.0 + TICK)]) <= 3
    assert len(times[(times >= 1.0) & (times < 1.0 + 6 * TICK)]) <= 8


def test_what_is_missed_is_not_made_up_for() -> None:
    pacer = Pacer(TICK)
    pacer.due(0.0, decided=False)
    assert pacer.due(5.0, decided=False)
    assert not pacer.due(5.0, decided=False), "five seconds are not made up for in a burst"
    assert pacer.wait(5.0) == pytest.approx(1.5 * TICK)
