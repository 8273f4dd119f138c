"""The study of the published protocol: one table of both forms, on joints, bones and both."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ehar.data.motion_file import save_motion
from ehar.errors import UsageError
from eval.cli.main import main
from eval.studies.published import published
from recognition.training.arithmetic import arithmetic_on
from tests.helpers.fakes import tiny_data


@pytest.fixture(scope="module")
def motion(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("data") / "tiny.npz"
    save_motion(path, replace(tiny_data(), is_test=np.arange(len(tiny_data().labels)) >= 3))
    return path


def test_the_command_trains_tests_and_prints_both_forms(
    motion: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(
        [
            "study",
            "published",
            str(motion),
            "--out",
            str(tmp_path),
            "--epochs",
            "1",
            "--seeds",
            "0",
            "1",
            "--threads",
            "1",
        ]
    )
    printed = capsys.readouterr()
    assert "CTR-GCN, four streams, as published" in printed.out and "1 epochs, as published 65" in printed.out
    assert "causal-bone-small-seed1-1-epochs: 1 of 1 epochs, loss" in printed.err
    held = json.loads((tmp_path / "summary.json").read_text())
    assert [(row["form"], row["streams"]) for row in held["rows"]] == [
        (form, streams) for form in ("ctrgcn", "causal") for streams in ("joint", "bone", "joint + bone")
    ]
    assert np.shape(held["rows"][0]["accuracy"]) == (2, 10)
    here = arithmetic_on(torch.device("cpu"))
    assert held["arithmetic"] == [here] and f"Products in training: {here}" in " ".join(printed.out.split())
    found = published(str(motion), out=tmp_path, epochs=1, seeds=(0, 1))  # from what is done
    assert not capsys.readouterr().err
    assert found.rows[5].accuracy.tolist() == held["rows"][5]["accuracy"]
    assert (tmp_path / "table.md").read_text().count("±") > 10
    main(["study", "published", str(motion), "--out", str(tmp_path), "--epochs", "1", "--streams", "bone"])
    held = json.loads((tmp_path / "summary.json").read_text())
    assert [(row["form"], row["streams"]) for row in held["rows"]] == [("ctrgcn", "bone"), ("causal", "bone")]
    assert held["rows"][1]["accuracy"] == [found.rows[4].accuracy[0].tolist()]
    one = published(str(motion), out=tmp_path, epochs=1, forms=("causal",))
    assert [(row.form, row.streams) for row in one.rows] == [
        ("causal", name) for name in ("joint", "bone", "joint + bone")
    ]
    assert one.rows[1].accuracy.tolist() == held["rows"][1]["accuracy"]
    for row in found.rows:  # with one epoch the last is the best
        assert row.accuracy_best.tolist() == row.accuracy[:, -1].tolist()


def test_what_cannot_be_trained_is_refused(motion: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--seeds: got none, expected whole numbers of at least 0, each once"):
        published(str(motion), out=tmp_path, seeds=())
    with pytest.raises(UsageError, match="--epochs: got 0, expected at least 1"):
        published(str(motion), out=tmp_path, epochs=0)
    for streams, got in (((), "none"), (("bone", "bone"), "bone bone"), (("motion",), "motion")):
        with pytest.raises(UsageError, match=f"--streams: got {got}, expected joint or bone, each once"):
            published(str(motion), out=tmp_path, streams=streams)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="--forms: got lstm, expected ctrgcn or causal, each once"):
        published(str(motion), out=tmp_path, forms=("lstm",))  # type: ignore[arg-type]


def test_copies_of_training_sequences_are_counted_and_left_out(tmp_path: Path) -> None:
    data = tiny_data()
    positions = data.positions.copy()
    positions[data.offsets[6] : data.offsets[7]] = data.sequence(0)
    save_motion(tmp_path / "tiny.npz", replace(data, positions=positions))
    found = published(str(tmp_path / "tiny.npz"), out=tmp_path, epochs=1, threads=1)
    assert (found.tests, found.copies) == (6, ("nod",))
    assert "1 of 6 test sequences are copies of training sequences, frame by frame: of nod." in str(found)
    sixths, fifths = found.rows[0].accuracy[0] * 6 / 100, found.rows[0].accuracy_new[0] * 5 / 100
    np.testing.assert_allclose([sixths, fifths], np.round([sixths, fifths]), atol=1e-9)
    assert set(np.round(sixths - fifths).astype(int)) <= {0, 1}  # the copy is right, or it is not
