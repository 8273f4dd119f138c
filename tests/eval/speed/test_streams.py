"""What `ehar bench` measures of streams, on few frames."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ehar.data.stitching.joins import DURATIONS
from ehar.data.streams.data import NO_ACTIVITY, StreamData
from ehar.data.synthetic.body import SKELETON
from ehar.runner import Runner
from ehar.sensors.registry import make_sensor
from eval.speed import streams
from eval.speed.bench import TARGETS
from eval.speed.effort import Effort
from eval.speed.recognition import untrained
from eval.speed.streams import SHOWN, changes, late_over_early, letting_go, time_streams
from tests.helpers.streams import raising_streams

BRIEF = Effort(repeats=1, streams=4, stream_frames=10, late_frame=80, dancers=1)


def like_solo() -> StreamData:
    """Return streams with what solo-stream has in common with those that are made."""
    return replace(raising_streams(), skeleton=SKELETON, class_names=tuple("abcdefghij"), fps=60.0)


@pytest.mark.parametrize("frames", [30, 300])
def test_a_dancer_changes_from_one_figure_to_another(frames: int) -> None:
    data = changes(like_solo(), frames, dancers=3)
    assert len(data.lengths) == 6 and set(data.lengths) == {frames + 90 + SHOWN}
    first, second = data.segments[::2], data.segments[1::2]
    np.testing.assert_array_equal(first[:, 1] - first[:, 0], frames)
    np.testing.assert_array_equal(second[:, 1] - second[:, 0], SHOWN)
    assert (first[:, 2] != second[:, 2]).all()
    joins = (second[:, 0] - first[:, 1] + 1) / 60
    assert min(DURATIONS) <= joins.min() and joins.max() <= max(DURATIONS)
    assert all(
        (data.labels[end:begin] == NO_ACTIVITY).all() for end, begin in zip(first[:, 1], second[:, 0], strict=True)
    )
    steps = np.linalg.norm(np.diff(data.positions.reshape(6, -1, 1, 16, 3), axis=1), axis=-1)
    assert steps.max() < 0.3  # nobody jumps where one piece ends and the next begins


def test_the_times_are_those_of_the_second_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    told = like_solo()
    runner = Runner(told, untrained(told, "causal", "small", 60), make_sensor("estimator", told))
    monkeypatch.setattr(streams, "load_setting", lambda conditions: SimpleNamespace(recordings=told, runner=runner))
    figures = letting_go("models", BRIEF)
    short, long, later = figures.values()
    assert list(figures) == ["recognised_s_after_30_frames", "recognised_s_after_300_frames", "letting_go_later_s"]
    assert later == pytest.approx(long - short)
    assert 0 <= short <= SHOWN / 60 and 0 <= long <= SHOWN / 60  # at most all that is shown of it


def test_a_late_frame_and_many_streams_are_timed() -> None:
    data = raising_streams()
    assert 0.2 < late_over_early(data, BRIEF) < 5
    assert time_streams(data, BRIEF) > 0


def test_the_recogniser_that_ships_lets_go() -> None:
    figures = letting_go(None, Effort())
    assert TARGETS["letting_go_later_s"].met(figures["letting_go_later_s"])
    assert not TARGETS["letting_go_later_s"].met(0.31)
    assert figures["recognised_s_after_300_frames"] < SHOWN / 120  # half of what is shown, which counts if it never is
