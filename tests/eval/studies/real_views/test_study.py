"""The command trains, tests and measures, and leaves its tables and its recognisers behind."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from ehar.data.motion_file import save_motion
from ehar.errors import DataError, UsageError
from eval.cli.main import main
from eval.studies.real_views.study import real_views
from recognition.training import material
from tests.helpers.fakes import tiny_data
from tests.helpers.recordings import recorded_solo


def test_the_command_prints_three_tables_and_trains_only_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(material, "VALIDATION_CLIPS", 24)
    save_motion(tmp_path / "recorded.npz", recorded_solo())
    words = [str(tmp_path / "recorded.npz"), "--out", str(tmp_path / "out"), "--clips", "32", "--threads", "1"]
    main(["study", "real-views", *words, "--length", "10"])
    printed = capsys.readouterr().out
    assert "24 windows of 10 frames" in printed and "only 4 people" in printed
    assert "simulated views, estimator" in printed and "share that lasts for a whole recording" in printed
    held = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert [row["training"] for row in held["transfer"]] == [
        "real views",
        "simulated views",
        "simulated views, estimator",
    ]
    assert held["choice"]["executions"] > 0 and held["real"]["frames"] > 1000
    before = (tmp_path / "out" / "causal-perfect-recorded.safetensors").stat().st_mtime_ns
    again = real_views(words[0], out=tmp_path / "out", length=10, clips=32, threads=1)
    assert (tmp_path / "out" / "causal-perfect-recorded.safetensors").stat().st_mtime_ns == before
    assert [row.mean for row in again.transfer] == [row["mean"] for row in held["transfer"]]
    with pytest.raises(UsageError, match="trained on other data or at another length: remove it"):
        real_views(words[0], out=tmp_path / "out", length=12, clips=32, threads=1)
    with pytest.raises(UsageError, match=r"cut short at 32 clips, fewer than the 64 of --clips: remove it"):
        real_views(words[0], out=tmp_path / "out", length=10, clips=64, threads=1)
    assert "From which real camera" in (tmp_path / "out" / "table.md").read_text()


def test_a_length_below_one_and_data_without_cameras(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--length: got 0, expected at least 1"):
        real_views("x.npz", out=tmp_path, length=0)
    save_motion(tmp_path / "tiny.npz", replace(tiny_data(), synthetic=False))
    with pytest.raises(DataError, match="expected recordings of one person with `views`"):
        real_views(str(tmp_path / "tiny.npz"), out=tmp_path)
