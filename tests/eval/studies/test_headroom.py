import sys
import types
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.conditions import Conditions
from ehar.errors import UsageError
from ehar.viewpoint import AZIMUTH, POLAR
from ehar.world import PAPER
from eval import headroom
from eval.studies.headroom import Headroom, best_per_class, headroom_tables, viewpoint_map
from tests.helpers.fakes import FakeRecogniser, tiny_data
from tests.helpers.tiny_benchmarks import Log


def seen_from_the_side(viewpoint: FloatArray) -> FloatArray:
    """Return a quality whose sign makes one half of the azimuths right, and the other wrong."""
    quality: FloatArray = np.sin(viewpoint[..., POLAR]) * np.where(viewpoint[..., AZIMUTH] < np.pi, 1.0, -1.0)
    return quality


class SidedRecogniser(FakeRecogniser):
    sha256 = "fake"
    spec = SimpleNamespace(length=None, fading=False)  # trained at any length

    def __init__(self) -> None:
        super().__init__(quality=seen_from_the_side)


@pytest.fixture
def result(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Headroom:
    module = types.ModuleType("recognition.storage")
    module.load_recogniser = lambda *_, **__: SidedRecogniser()  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "recognition.storage", module)
    options: dict[str, Any] = {"azimuths": 4, "polars": 3, "out": tmp_path / "out", "reporter": Log()}
    return headroom(Conditions(data=tiny_data(sequences=42), length=10), **options)


def test_the_map_lies_on_the_grid_from_the_top_to_the_horizon() -> None:
    viewpoints = viewpoint_map(PAPER.workspace, 10.0, 4, 6)
    assert viewpoints.shape == (6, 4, 3)
    np.testing.assert_allclose(viewpoints[..., 0], 10)
    np.testing.assert_allclose(np.degrees(viewpoints[:, 0, POLAR]), [0, 18, 36, 54, 72, 90])
    np.testing.assert_allclose(np.degrees(viewpoints[0, :, AZIMUTH]), [0, 90, 180, 270])


@pytest.mark.parametrize(("distance", "azimuths", "polars"), [(4.0, 4, 6), (16.0, 4, 6), (10.0, 0, 6), (10.0, 4, 1)])
def test_a_map_outside_the_workspace_or_of_nothing_is_refused(distance: float, azimuths: int, polars: int) -> None:
    with pytest.raises(UsageError, match="expected"):
        viewpoint_map(PAPER.workspace, distance, azimuths, polars)


def test_best_per_class_by_hand() -> None:
    acc = np.array([[1.0, 0.0], [0.0, 1.0], [0.2, 0.9]])
    assert best_per_class(acc, np.array([0, 1, 1]), 3).tolist() == [0, 1, 1]


def test_the_map_shows_where_the_recogniser_sees(result: Headroom) -> None:
    # Level cameras see all from azimuths below 180 degrees, and nothing but the opposite from those beyond.
    assert result.acc_mean[2, :2].min() > 90
    assert result.acc_mean[2, 2:].max() < 10
    assert result.scenarios == 42


def test_each_choice_that_knows_more_does_no_worse(result: Headroom) -> None:
    acc = {(row.name, row.chosen_on): row.acc_mean for row in result.rows}
    assert acc["fixed, mean over the map", "-"] == pytest.approx(result.acc_mean.mean())
    assert acc["best fixed", "test"] == pytest.approx(result.acc_mean.max())
    assert acc["best fixed", "validation"] <= acc["best fixed", "test"]
    assert acc["best fixed", "test"] <= acc["best fixed per class", "test"] <= acc["best fixed per sample", "test"]
    assert acc["no-act, random starts", "-"] <= acc["oracle*", "-"]


def test_every_class_has_its_best_viewpoint(result: Headroom) -> None:
    assert [row.class_name for row in result.classes] == ["nod", "left", "right"]
    assert all(row.acc_mean >= row.acc_mean_map for row in result.classes)
    assert all(row.azimuth_deg < 180 for row in result.classes)


def test_it_writes_numbers_tables_and_a_figure(result: Headroom, tmp_path: Path) -> None:
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"config.json", "headroom.json", "table.md", "headroom.png", "headroom.svg"}
    assert "tiny (synthetic)" in headroom_tables(result)[0].title
    assert "upper bound" in (tmp_path / "out" / "table.md").read_text()


def test_who_keeps_nothing_when_interrupted_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    module = types.ModuleType("recognition.storage")
    module.load_recogniser = lambda *_, **__: SidedRecogniser()  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "recognition.storage", module)
    monkeypatch.setattr("eval.running.jobs._run_chunks", interrupted)
    with pytest.raises(KeyboardInterrupt, match="nothing was written"):
        headroom(Conditions(data=tiny_data(sequences=42), length=10), reporter=Log())
