"""Where people are thought to be is computed for the streams that are asked for, and the same whoever asks."""

import numpy as np
import pytest

from ehar.data.streams.followed import following_centre, thought_to_be
from ehar.flight.centre import centre_limits
from ehar.flight.vehicle import VEHICLES
from ehar.localisation import Localisation, smoothed
from tests.helpers.streams import raising_streams

TOLD, LIMITS = Localisation(noise=0.1), centre_limits(VEHICLES["px4-auto"])


def test_only_streams_that_are_asked_for_are_computed_and_as_all_together() -> None:
    data, again = raising_streams(people=3), raising_streams(people=3)
    second = slice(data.offsets[1], data.offsets[2])
    some = [thought_to_be(data, TOLD, np.array([1, 1])), *following_centre(data, TOLD, LIMITS, np.array([1]))]
    for part in some:
        known = np.isfinite(part).all(axis=1)
        assert known[second].all() and known.sum() == data.lengths[1]
        with pytest.raises(ValueError, match="read-only"):
            part[second] = 0.0
    every = [thought_to_be(again, TOLD), *following_centre(again, TOLD, LIMITS)]
    for part, whole in zip(some, every, strict=True):
        assert np.isfinite(whole).all()
        np.testing.assert_array_equal(part[second], whole[second])


def test_a_stream_is_followed_as_its_localisation_says() -> None:
    data = raising_streams(people=2)
    for stream, (begin, end) in enumerate(zip(data.offsets[:-1], data.offsets[1:], strict=True)):
        middles = data.positions[begin:end].mean(axis=(1, 2), dtype=np.float64)
        expected = TOLD.estimated(middles, data.fps, stream)[0]
        np.testing.assert_array_equal(thought_to_be(data, TOLD)[begin:end], expected)
        smooth = smoothed(*TOLD.estimated(middles, data.fps, stream), 1 / data.fps, LIMITS)
        for part, one in zip(following_centre(data, TOLD, LIMITS), smooth, strict=True):
            np.testing.assert_array_equal(part[begin:end], one)
