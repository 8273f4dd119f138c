"""Data and options that a benchmark cannot run with."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.data.motion_data import MotionData
from ehar.errors import DataError, EharError, UsageError
from eval.records.run_files import EPISODES
from tests.helpers.fakes import tiny_data
from tests.helpers.tiny_benchmarks import Log, file_hash, run

pytestmark = pytest.mark.usefixtures("fake_weights")


def with_lengths(lengths: list[int], labels: list[int]) -> MotionData:
    data = tiny_data(sequences=len(lengths), frames=max(lengths))
    keep = np.concatenate([np.arange(max(lengths)) < length for length in lengths])
    return replace(
        data,
        positions=data.positions[keep],
        offsets=np.cumsum([0, *lengths]),
        labels=np.array(labels),
        is_test=np.ones(len(lengths), dtype=bool),
    )


def test_shorter_sequences_are_left_out_and_counted_aloud() -> None:
    log = Log()
    summary = run(["no-act"], data=with_lengths([20, 9, 12, 8], [0, 1, 2, 0]), starts=1, reporter=log).summary
    assert summary.episodes == 3
    assert log.notes == [
        "tiny: 2 of 4 sequences are shorter than 10 frames and left out",
        "tiny: class 'left' has no sequence of 10 frames left",
    ]


def test_no_sequence_as_long_as_an_episode() -> None:
    with pytest.raises(DataError, match="tiny: expected sequences of at least 30 frames, the longest of 20 has 20"):
        run(length=30)


def test_a_class_without_test_sequence() -> None:
    with pytest.raises(DataError, match="class 'right' has none"):
        run(data=with_lengths([20, 20, 20], [0, 1, 0]))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"planners": ["no-act", "teleport"]}, "unknown planner 'teleport'.*no-act"),
        ({"planners": ["no-act", "no-act"]}, "'no-act' twice"),
        ({"planners": []}, "got none"),
        (
            {"planners": [object()]},
            "planner <object.*>: expected what .*Planner has, missing: name, privileged, reset, act",
        ),
        ({"data": "trio"}, "unknown data 'trio'.*duo, solo, duo-stream, solo-stream"),
        ({"part": "training"}, "unknown part .training.; expected one of: recogniser, policy, validation, test"),
        ({"track": "rail"}, "unknown track 'rail'; expected ideal, px4-auto, px4-max, tracking-drone"),
        ({"readout": "tarot"}, "unknown readout 'tarot'; expected recogniser or belief"),
        ({"ideal": "somewhere"}, "the track is ideal; expected a vehicle"),
        ({"sensor": "lidar"}, "unknown sensor 'lidar'"),
        ({"views": "birds"}, "unknown views 'birds'"),
        ({"form": "square"}, "unknown form 'square'"),
        ({"starts": 0}, "starts: expected a whole number of at least 1, got 0"),
        ({"workers": 0}, "workers: expected at least 1, got 0"),
        ({"seed": -1}, "seed: expected a whole number of at least 0, got -1"),
        ({"length": 0}, "length: expected a whole number of at least 1, got 0"),
    ],
)
def test_bad_options_end_in_one_line_and_leave_nothing(tmp_path: Path, options: dict[str, Any], message: str) -> None:
    with pytest.raises(EharError, match=message) as error:
        run(**options, out=tmp_path / "run")
    assert "\n" not in str(error.value)
    assert not (tmp_path / "run").exists()


def test_another_run_is_not_overwritten(tmp_path: Path) -> None:
    run(["no-act"], out=tmp_path)
    before = file_hash(tmp_path / EPISODES)
    with pytest.raises(UsageError, match="holds another run, which differs in planners"):
        run(["random"], out=tmp_path)
    assert file_hash(tmp_path / EPISODES) == before
