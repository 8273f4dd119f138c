"""Where planners went, for a recogniser that learns from there: what is taken of runs, and what is refused."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.conditions import Conditions
from ehar.data.any_source import load_recordings
from ehar.data.scenario import split_parts
from ehar.errors import UsageError
from eval.running.planned import planned_views
from eval.running.run import read_run
from eval.running.training import train_recogniser
from recognition.training import material
from recognition.training.config import TrainingConfig
from recognition.weight_files import recorded_run
from tests.helpers.fakes import tiny_data
from tests.helpers.stream_runs import forgetful, stream_run
from tests.helpers.tiny_benchmarks import run

DATA = tiny_data(sequences=40)
TOLD = Conditions(data=DATA, length=10)
pytestmark = pytest.mark.usefixtures("fake_weights")


def looked(out: Path, planners: tuple[str, ...] = ("h-rotate", "random"), **changes: Any) -> Path:
    run(planners, out=out, **{"part": "recogniser", "data": DATA, **changes})
    return out


def test_all_planners_of_all_runs_are_taken(tmp_path: Path) -> None:
    runs = [looked(tmp_path / "one"), looked(tmp_path / "two", ("towards",))]
    views = planned_views(runs, DATA, TOLD)
    episodes = [records for folder in runs for records in read_run(folder).records.values()]
    assert len(views.sequence) == sum(len(records) for records in episodes)
    names = np.array(DATA.sequence_names)[views.sequence]
    assert names.tolist() == [name for records in episodes for name in records.sequence]
    np.testing.assert_array_equal(views.viewpoints, np.concatenate([records.viewpoint for records in episodes]))
    np.testing.assert_array_equal(views.first, np.concatenate([records.first for records in episodes]))
    assert np.isin(views.sequence, split_parts(DATA).recogniser).all()


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"part": "test"}, "expected a run of --part recogniser, got one of the test part"),
        ({"planners": ("no-act", "oracle")}, "expected a run of planners without the truth, got one of oracle"),
        ({"world": "room"}, "expected a run in the world paper, got one in room"),
        ({"track": "tracking-drone"}, "expected a run on the ideal track, got one on tracking-drone"),
        ({"length": 6}, "expected a run of 10 frames an episode, got one of 6"),
        ({"length": 12}, "expected a run of 10 frames an episode, got one of 12"),
        ({"data": tiny_data(sequences=41)}, "expected a run of tiny (synthetic), got one of tiny (synthetic), or of"),
    ],
)
def test_other_runs_are_refused(changes: dict[str, Any], expected: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=re.escape(f"--planned: {tmp_path}/run: {expected}")):
        planned_views([looked(tmp_path / "run", **changes)], DATA, TOLD)


def test_streams_are_taken_of_one_length_that_windows_fit_into(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    forgetful(monkeypatch)
    for frames in (50, 60):
        stream_run(tmp_path, ("no-act",), part="recogniser", length=frames, out=tmp_path / str(frames))
    data = load_recordings(tmp_path / "raising.npz")
    told = Conditions(data=tmp_path / "raising.npz", length=40, fps=data.fps)
    assert planned_views([tmp_path / "60"], data, told).viewpoints.shape[1] == 60
    with pytest.raises(UsageError, match="expected a run of at least 55 frames an episode, got one of 50"):
        planned_views([tmp_path / "50"], data, replace(told, length=55))
    with pytest.raises(UsageError, match="expected episodes of one length, got 50, 60 frames"):
        planned_views([tmp_path / "50", tmp_path / "60"], data, told)


def test_a_training_says_what_it_saw(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(material, "VALIDATION_CLIPS", 8)
    folder = looked(tmp_path / "run")
    config = TrainingConfig(conditions=TOLD, out=tmp_path / "usual", clips=64, interval=32)
    usual = train_recogniser(config).paths[0]
    planned = train_recogniser(replace(config, out=tmp_path / "planned"), (folder,)).paths[0]
    assert "planned_sha256" not in recorded_run(usual)
    assert recorded_run(planned)["planned_sha256"] == planned_views([folder], DATA, TOLD).sha256
    assert usual.read_bytes() != planned.read_bytes()
