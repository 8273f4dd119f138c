"""What a training of everything will lack is told before it begins."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.data.motion_data import MotionData
from ehar.data.scenario import advised_length, split_parts
from ehar.errors import DataError
from eval.running.outlook import outlook
from tests.helpers.fakes import tiny_data
from tests.helpers.streams import raising_streams


def shortened(data: MotionData, sequences: np.ndarray, frames: int) -> MotionData:
    """Return data in which some sequences have fewer frames."""
    kept = [data.sequence(i)[: frames if i in sequences else None] for i in range(len(data.lengths))]
    return replace(data, positions=np.concatenate(kept), offsets=np.cumsum([0, *map(len, kept)]))


DATA = tiny_data(sequences=60)
PARTS = split_parts(DATA)


def test_nothing_to_say_of_whole_data() -> None:
    assert outlook(DATA, 20) == ()


def test_a_class_without_long_sequences_in_a_part() -> None:
    for part, result in (("recogniser", "will never name it"), ("policy", "not have met"), ("test", "no benchmark")):
        sequences = getattr(PARTS, part)
        (line, *others) = outlook(shortened(DATA, sequences[DATA.labels[sequences] == 1], 10), 20)
        assert " sequence of at least 20 frames of left: " in line and result in line, part
        assert len(others) == 1 and "are shorter than 20 frames and left out; --length 10 is advised" in others[0]


def test_validation_on_training_data() -> None:
    (line, *_) = outlook(shortened(DATA, PARTS.validation, 10), 20)
    assert line.startswith("warning: no validation sequence of at least 20 frames") and "own training" in line


def test_what_would_stop_a_training_is_an_error_at_once() -> None:
    with pytest.raises(DataError, match=r"tiny: the recogniser could not be trained: expected 1 training seq"):
        outlook(DATA, 21)
    stopped = shortened(DATA, PARTS.policy[1:], 10)
    with pytest.raises(DataError, match=r"the planners could not be trained: .* 2 policy .*, got 1; --length 10 is"):
        outlook(stopped, 20)


def test_an_advised_length_keeps_most_of_every_class() -> None:
    assert advised_length(DATA) == 20
    assert advised_length(tiny_data(frames=100)) == 60  # no longer than the paper's
    assert advised_length(tiny_data(frames=3)) == 8  # nor too short to watch
    one = shortened(DATA, np.flatnonzero(DATA.labels == 2)[:1], 9)
    assert advised_length(one) == 20  # of 20 sequences of this class, 19 remain
    ten = np.flatnonzero(DATA.labels == 2)[:10]
    few = replace(DATA, labels=np.where(DATA.labels == 2, 1, DATA.labels))
    few = replace(few, labels=np.where(np.isin(np.arange(len(few.labels)), ten), 2, few.labels))
    assert advised_length(shortened(few, ten[:1], 9)) == 20  # of 10 sequences 9 are nine tenths
    three = shortened(DATA, np.flatnonzero(DATA.labels == 2)[:3], 9)
    assert advised_length(three) == 9


def test_stages_on_streams_need_windows_of_other_lengths() -> None:
    streams = raising_streams(people=20, seconds=10)  # at 10 frames a second
    (benchmarks,) = outlook(streams, None)
    assert benchmarks == "warning: no test stream of at least 300 frames of nod, left, right: no benchmark will show it"
    assert outlook(streams, 50) == ()
    with pytest.raises(DataError, match=r"planners could not be trained: expected 2 policy streams of at least 160"):
        outlook(replace(streams, fps=20.0), None)
    with pytest.raises(DataError, match=r"recogniser could not be trained: expected 1 training stream of at least 160"):
        outlook(replace(streams, fps=40.0), None)
