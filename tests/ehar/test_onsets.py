"""A recogniser that is told onsets equals one that begins anew at each of them."""

from dataclasses import replace

import numpy as np

from ehar.onsets import ToldOnsets, begins
from ehar.sensors.perfect import PerfectSensor
from ehar.sensors.sensor import Sensed
from tests.helpers.fakes import FakeRecogniser, tiny_batch

LABELS = np.array([[3, 3, 0, 0, 1, 1, 3, 3, 1, 1], [2, 2, 2, 2, 2, 2, 2, 3, 3, 2]])


def frames() -> list[Sensed]:
    batch = tiny_batch(episodes=2)
    return [
        PerfectSensor().sense(batch.positions[:, frame], batch.starts, batch.noise.frame(frame)) for frame in range(10)
    ]


def test_an_activity_begins_where_its_class_is_new_and_none_never_does() -> None:
    assert [np.flatnonzero(row).tolist() for row in begins(LABELS, 3)] == [[2, 4, 8], [9]]


def test_each_row_forgets_at_its_own_onsets() -> None:
    plain, starts = FakeRecogniser(), tiny_batch(episodes=2).starts
    told = ToldOnsets(plain, begins(LABELS, 3))
    state, fresh = told.start(2), [plain.start(1), plain.start(1)]
    for frame, sensed in enumerate(frames()):
        found, state = told.step(state, sensed, starts)
        for row in range(2):
            if begins(LABELS, 3)[row, frame]:
                fresh[row] = plain.start(1)
            one = Sensed(*(array[row : row + 1] for array in sensed))
            expected, fresh[row] = plain.step(fresh[row], one, starts[row : row + 1])
            np.testing.assert_array_equal(found.log_probs[row], expected.log_probs[0])


def test_what_is_imagined_of_the_next_frame_is_what_is_then_seen() -> None:
    starts = tiny_batch(episodes=2).starts
    told = ToldOnsets(FakeRecogniser(), begins(LABELS, 3))
    state = told.start(2)
    for sensed in frames():
        alternatives = Sensed(*(np.repeat(array[:, None], 3, axis=1) for array in sensed))
        imagined, forked = told.step(state.fork(3), alternatives, np.repeat(starts[:, None], 3, axis=1))
        found, after = told.step(state, sensed, starts)
        np.testing.assert_array_equal(imagined.log_probs, np.repeat(found.log_probs[:, None], 3, axis=1))
        state = replace(forked.select(np.zeros(2, dtype=np.int64)), imagined=False)
        np.testing.assert_array_equal(state.state.evidence, after.state.evidence)


def test_paths_that_are_imagined_forget_alike_whether_one_was_chosen_on_the_way_or_not() -> None:
    starts = tiny_batch(episodes=2).starts[:, None]
    told = ToldOnsets(FakeRecogniser(), begins(LABELS, 3))
    straight, chosen = told.start(2).fork(1), told.start(2)
    for sensed in frames():
        seen = Sensed(*(array[:, None] for array in sensed))
        one, straight = told.step(straight, seen, starts)
        other, after = told.step(chosen.fork(1), seen, starts)
        chosen = after.select(np.zeros(2, dtype=np.int64))
        np.testing.assert_array_equal(one.log_probs, other.log_probs)
