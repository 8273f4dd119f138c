import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.conditions import Conditions
from ehar.data.motion_file import save_motion
from ehar.data.scenario import TEST
from ehar.errors import UsageError
from eval.cli.main import main
from eval.records.episode_lines import read_episodes
from eval.studies.belief.study import NLL_AT, BeliefReport, belief_report, belief_row, belief_tables
from planners.value.belief.clips_fit import ABLATIONS
from planners.value.view_basis import BASIS_SIZE
from tests.helpers.fakes import tiny_data
from tests.helpers.gain_models import model_of
from tests.helpers.other_people import with_others
from tests.helpers.tiny_benchmarks import HashedRecogniser, Log
from tests.helpers.tiny_benchmarks import run as run_tiny


@pytest.fixture(autouse=True)
def known_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("recognition.storage.load_recogniser", lambda *_, **__: HashedRecogniser())
    monkeypatch.setattr("eval.running.choice.ModelPlace.load_gain_model", lambda _: model_of(np.zeros(BASIS_SIZE)))


def report_of(**options: Any) -> BeliefReport:
    told = {name: options.pop(name) for name in ("data", "seed") if name in options}
    conditions = Conditions(**{"data": tiny_data(sequences=40), "length": 10, **told})
    return belief_report(conditions, **{"reporter": Log(), **options})


def test_a_row_by_hand() -> None:
    # Two episodes of 4 frames and 2 classes; the true class is believed with 1/2, and from half of it on with 4/5.
    true = np.array([[0.5, 0.8, 0.8, 0.8], [0.5, 0.8, 0.8, 0.8]])
    labels = np.array([0, 1])
    probabilities = np.stack([true, 1 - true], axis=-1)
    probabilities[1] = probabilities[1, :, ::-1]
    row = belief_row("any", "belief", np.log(probabilities), labels)
    assert row.nll_at["10"] == row.nll_at["20"] == pytest.approx(np.log(2))  # the first frame
    assert row.nll_at["50"] == row.nll_at["100"] == pytest.approx(-np.log(0.8))
    assert row.nll == pytest.approx((np.log(2) - 3 * np.log(0.8)) / 4)
    assert row.ece_late == pytest.approx(0.2)  # always right at a confidence of 80 %; the first frame is not counted


def test_the_default_belief_says_what_the_recogniser_says() -> None:
    rows = {(row.rollouts, row.reader): row for row in report_of().test}
    assert {rollouts for rollouts, _ in rows} == {"no-act", "random"}
    for rollouts in ("no-act", "random"):
        recogniser, belief = rows[rollouts, "recogniser"], rows[rollouts, "belief"]
        assert belief.nll == pytest.approx(recogniser.nll, abs=0.01)
    assert rows["no-act", "recogniser"].nll != rows["random", "recogniser"].nll


def test_its_episodes_are_the_benchmarks(tmp_path: Path) -> None:
    data = tiny_data(sequences=40)
    run_tiny(["no-act", "random"], data=data, starts=1, out=tmp_path / "run")
    recorded = read_episodes(tmp_path / "run" / "episodes.jsonl")
    for row in report_of(data=data).test:
        if row.reader == "recogniser":
            probability = recorded[row.rollouts].true_probability
            assert row.nll == pytest.approx(-np.log(probability).mean(), abs=1e-5)


def test_every_part_is_scored_on_the_same_held_out_episodes(tmp_path: Path) -> None:
    report = report_of(out=tmp_path / "out")
    assert [row.reader for row in report.parts] == ["recogniser", *ABLATIONS]
    assert 0 < report.parts_episodes < 2 * 40
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"config.json", "belief.json", "table.md"}
    held = json.loads((tmp_path / "out" / "belief.json").read_text())
    assert held["parts"][-1]["reader"] == "full"
    assert held["test"][0]["nll_at"].keys() == {str(percent) for percent in NLL_AT}
    assert "NLL@100" in (tmp_path / "out" / "table.md").read_text()
    assert all(len(row) == len(table.header) for table in belief_tables(report) for row in table.rows)
    with pytest.raises(UsageError, match="another run"):
        report_of(out=tmp_path / "out", seed=1)


def test_parts_are_fitted_and_scored_without_who_is_tested() -> None:
    usual, other = (
        report_of(data=data) for data in (tiny_data(sequences=40), with_others(tiny_data(sequences=40), TEST))
    )
    assert other.parts == usual.parts and other.test != usual.test


def test_the_command_prints_both_tables(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "tiny.npz"
    save_motion(path, tiny_data(sequences=40))
    main(["study", "belief", "--data", str(path), "--length", "10"])
    printed = capsys.readouterr().out
    assert "What each part of the belief is worth" in printed
    assert "+ whitening" in printed
