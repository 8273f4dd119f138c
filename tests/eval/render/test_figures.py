from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from eval.render.figures import _spread, draw_accuracy
from tests.helpers.made_records import CONFIG_OF_RUN, three_planners


def draw(stem: Path) -> None:
    records = three_planners()
    curves = {name: episodes.correct.mean(axis=0) for name, episodes in records.items()}
    draw_accuracy(curves, {"oracle"}, 3, CONFIG_OF_RUN.title, stem)


def test_the_figure_names_planners_data_and_chance(tmp_path: Path) -> None:
    draw(tmp_path / "accuracy")
    drawn = (tmp_path / "accuracy.svg").read_text()
    for word in ("no-act", "mine", "oracle (privileged)", "chance", "tiny (synthetic)", "accuracy [%]"):
        assert word in drawn
    picture = matplotlib.image.imread(tmp_path / "accuracy.png")
    assert picture.std() > 0.05
    assert {path.name for path in tmp_path.iterdir()} == {"accuracy.png", "accuracy.svg"}


@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_the_same_numbers_give_the_same_bytes(tmp_path: Path, suffix: str) -> None:
    draw(tmp_path / "a")
    draw(tmp_path / "b")
    assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_labels_keep_apart_in_the_order_of_the_curves() -> None:
    heights = {"a": 50.0, "b": 51.0, "c": 20.0, "d": 99.0, "e": 99.5}
    placed = _spread(heights, gap=5, high=100)
    order = sorted(heights, key=lambda name: heights[name])
    gaps = np.diff([placed[name] for name in order])
    assert (gaps >= 5 - 1e-9).all()
    assert max(placed.values()) <= 100
    assert placed["c"] == 20.0
    assert (placed["a"] + placed["b"]) / 2 == pytest.approx(50.5)
