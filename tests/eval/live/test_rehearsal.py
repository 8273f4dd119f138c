"""A rehearsal in real time: what was recognised is the benchmark's where nothing was lost."""

from pathlib import Path

import numpy as np
import pytest

from ehar.conditions import Conditions
from ehar.errors import DataError, EharError, UsageError
from eval.live import rehearsal
from eval.live.figures import Latencies
from eval.live.rehearsal import EQUAL, rehearse
from eval.live.start import live
from tests.helpers.live_worlds import save_live_world


def test_two_short_streams_one_of_which_loses_frames(tmp_path: Path) -> None:
    folder = save_live_world(tmp_path)
    told = Conditions(data=str(folder / "raising.npz"), models=folder / "models", track="px4-auto", length=30)
    notes: list[str] = []
    found = rehearse(
        told,
        planner="no-act",
        belief=None,
        sure=0.9,
        minutes=2 / 60,
        loss=0.2,
        outputs=lambda _: [],
        note=notes.append,
    )
    assert found.lossless.tolist() == [True, False]
    assert found.apart[0] <= EQUAL and found.same[0] == 1 and found.right[0] == found.right_there[0]
    assert 0.0 < found.figures.counts["frames"] < 60 and found.figures.counts["out of order"] > 0
    assert max(found.limits.values()) <= 1
    did, recognised = found.tables()
    assert did.rows[0][2] == str(found.figures.lines) and [row[0] for row in recognised.rows] == [
        "none lost",
        "some lost",
    ]
    assert notes[0].endswith("2 streams of 1 s, in real time")


def test_of_an_agent_with_several_trainings_the_first_is_rehearsed(tmp_path: Path) -> None:
    """That it recognises and flies as in the benchmark is tested where no clock runs."""
    folder = save_live_world(tmp_path)
    told = Conditions(data=str(folder / "raising.npz"), models=folder / "models", track="px4-auto", length=6)
    options = {"belief": None, "sure": 0.9, "minutes": 6 / 30 / 60, "loss": 0.0}
    found = rehearse(told, planner="il", **options, outputs=lambda _: [], note=lambda _: None)
    assert found.title.startswith("raising: il on px4-auto")
    assert 0 < found.figures.counts["frames"] <= 6 and "planner failed" not in found.figures.counts


def test_a_built_in_set_is_rehearsed_with_the_weights_that_ship() -> None:
    told = Conditions(data="solo-stream", track="px4-auto", length=6)
    options = {"belief": None, "sure": 0.9, "minutes": 6 / 60 / 60, "loss": 0.0}
    found = rehearse(told, planner="h-rotate", **options, outputs=lambda _: [], note=lambda _: None)
    assert found.title == "solo-stream: h-rotate on px4-auto, sensor estimator"
    assert 0 < found.figures.counts["frames"] <= 6


@pytest.mark.parametrize("minutes", [0.0, -1.0, float("nan"), float("inf")])
def test_how_long_is_a_number_above_0(minutes: float) -> None:
    with pytest.raises(UsageError, match="minutes: expected a number above 0"):
        live(models="", planner="no-act", rehearse="solo-stream", minutes=minutes)


def test_where_people_are_is_a_number() -> None:
    with pytest.raises(UsageError, match=r"origin: expected three finite numbers, got nan 0\.0 0\.0"):
        live(models="", origin=(float("nan"), 0.0, 0.0))
    with pytest.raises(UsageError, match="--models: expected a folder of weights, got none; a built-in set"):
        live(source="frames.jsonl")


@pytest.mark.parametrize(
    ("data", "error", "message"),
    [
        ("solo", UsageError, "expected streams, as `ehar data stitch` makes them, got trimmed sequences"),
        ("absent.npz", DataError, r"absent\.npz: no such file"),
    ],
)
def test_only_streams_that_are_there_are_rehearsed(data: str, error: type[EharError], message: str) -> None:
    with pytest.raises(error, match=message):
        rehearse(
            Conditions(data=data, track="px4-auto"),
            planner="no-act",
            belief=None,
            sure=0.9,
            minutes=1,
            loss=0,
            outputs=lambda _: [],
            note=print,
        )


def test_percentiles_of_latencies_and_memory() -> None:
    latencies = Latencies()
    assert latencies.percentile(95) == 0
    for milliseconds in np.random.default_rng(0).permutation(100):
        latencies.add(float(milliseconds) / 1000)
    latencies.add(60.0)
    assert latencies.percentile(50) == pytest.approx(0.0501)
    assert latencies.percentile(95) == pytest.approx(0.0951)
    assert latencies.percentile(100) == pytest.approx(2.0, abs=1e-3)
    before = rehearsal.peak_megabytes()
    assert np.ones(8 << 20).sum() > 0
    assert before > 50 and rehearsal.peak_megabytes() >= before
