import sys
import types
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.conditions import Conditions
from ehar.viewpoint import AZIMUTH, POLAR
from eval import headroom
from eval.studies.headroom.study import Headroom, headroom_tables
from tests.helpers.fakes import FakeRecogniser, tiny_data
from tests.helpers.tiny_benchmarks import Log


def seen_from_the_side(viewpoint: FloatArray) -> FloatArray:
    """Return a quality whose sign makes azimuths 0 and 90 of people who face azimuth 0 right, and the others wrong."""
    quality: FloatArray = np.sin(viewpoint[..., POLAR]) * np.sin(viewpoint[..., AZIMUTH] + np.pi / 4)
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


def test_the_map_shows_where_the_recogniser_sees(result: Headroom) -> None:
    # Level cameras see all from the front and the left, and nothing but the opposite from elsewhere.
    assert result.acc_mean[2, :2].min() > 90
    assert result.acc_mean[2, 2:].max() < 10
    assert result.scenarios == 42


def test_each_choice_that_knows_more_does_no_worse(result: Headroom) -> None:
    acc = {(row.name, row.chosen_on): row.acc_mean for row in result.rows}
    assert acc["fixed, mean over the map", "-"] == pytest.approx(result.acc_mean.mean())
    assert acc["best fixed", "test"] == pytest.approx(result.acc_mean.max())
    assert acc["best fixed", "others"] <= acc["best fixed per sample", "test"]
    assert acc["best fixed", "test"] <= acc["best fixed per class", "test"] <= acc["best fixed per sample", "test"]
    assert acc["no-act, random starts", "-"] <= acc["oracle*", "-"]


def test_every_class_has_its_best_place(result: Headroom) -> None:
    assert [row.class_name for row in result.maps.classes] == ["nod", "left", "right"]
    assert all(row.own >= row.over_map for row in result.maps.classes)
    assert all(row.azimuth_deg in (0, 90) for row in result.maps.classes)
    # Everything is seen best from the same places, so to know the class is worth nothing.
    assert result.maps.worth == pytest.approx(0, abs=1)


def test_it_writes_numbers_tables_and_a_figure(result: Headroom, tmp_path: Path) -> None:
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"config.json", "headroom.json", "table.md", "headroom.png", "headroom.svg"} | {
        "class-maps.png",
        "class-maps.svg",
    }
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
