"""The fit of fixed-best: the best place is kept, on the validation part; it goes on, and is the same again."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.conditions import Conditions
from ehar.data.motion_data import MotionData
from ehar.data.scenario import split_parts
from ehar.errors import DataError, EharError, ModelError, UsageError
from ehar.processes import Processes
from ehar.viewpoint import POLAR
from planners.place import fit
from planners.place.config import FixedBestConfig
from planners.place.fit import accuracy_at, best_first, candidate_places, fit_fixed_best, validation_windows
from planners.place.go_to_place import PLACES
from planners.place.storage import fixed_place_path, load_fixed_place
from recognition.setting import load_setting
from tests.helpers.fakes import FakeRecogniser, tiny_data
from tests.helpers.settings import changed

LENGTH = 8
DATA = tiny_data(sequences=60)


def wants_level(viewpoint: FloatArray) -> FloatArray:
    """Return a quality that is good near level, and says nothing from above."""
    quality: FloatArray = np.where(viewpoint[..., POLAR] > np.radians(65), 5.0, 0.0)
    return quality


class LevelRecogniser(FakeRecogniser):
    sha256 = "level"
    spec = SimpleNamespace(length=LENGTH, fading=False)

    def __init__(self) -> None:
        super().__init__(quality=wants_level)


@pytest.fixture(autouse=True)
def small_world(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every run load a recogniser that wants to look from level, and try few places."""
    monkeypatch.setattr("recognition.storage.load_recogniser", lambda *_, **__: LevelRecogniser())
    monkeypatch.setattr(fit, "DISTANCES", (0.1,))
    monkeypatch.setattr(fit, "SIDES", (0.0, np.pi / 2))
    monkeypatch.setattr(fit, "POLARS", (np.radians(40), np.radians(85)))
    monkeypatch.setattr(fit, "STARTS", 2)


@pytest.fixture
def config(tmp_path: Path) -> FixedBestConfig:
    return FixedBestConfig(conditions=Conditions(data=DATA, length=LENGTH), out=tmp_path / "out", workers=1)


def silent(what: str, done: int, whole: int) -> None:
    """Hear nothing."""


def made(accuracies: list[float], calls: list[int]) -> Callable[[Any, int], float]:
    """Return a trial of places with made accuracies, which notes what is tried."""

    def trial(task: Any, index: int) -> float:
        calls.append(index)
        return accuracies[index]

    return trial


def written(config: FixedBestConfig) -> Any:
    assert config.out is not None
    return json.loads(fixed_place_path(config.out, config.conditions).read_text())


def test_every_place_that_needs_no_fit_is_a_candidate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    places = candidate_places(tells_front=True)
    assert set(PLACES.values()) <= set(places)
    assert len(set(places)) == len(places) == 54
    assert [place.azimuth for place in places[:9]] == [None] * 9
    absolute = candidate_places(tells_front=False)
    assert len(set(absolute)) == 81
    assert all(place.absolute == (place.azimuth is not None) for place in absolute)


def test_the_best_place_comes_first_and_of_equal_ones_the_first() -> None:
    places = candidate_places(tells_front=True)[:4]
    tried = best_first(places, {0: 0.5, 1: 0.75, 2: 0.25, 3: 0.75})
    assert [one.place for one in tried] == [places[index] for index in (1, 3, 0, 2)]
    assert [one.accuracy for one in tried] == [0.75, 0.75, 0.5, 0.25]


def test_a_recogniser_of_another_length_is_told_of(config: FixedBestConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fit, "accuracy_at", made([0.5] * 6, []))
    lines: list[str] = []
    fit_fixed_best(config, silent, lines.append)
    assert lines == []
    fit_fixed_best(changed(config, length=LENGTH - 2, out=Path(str(config.out)) / "short"), silent, lines.append)
    assert lines == ["warning: episodes have 6 frames, but weights were trained at another length: recogniser at 8"]


@pytest.mark.parametrize("best", [0, 3, 5])
def test_the_best_of_made_accuracies_is_saved(
    config: FixedBestConfig, monkeypatch: pytest.MonkeyPatch, best: int
) -> None:
    accuracies = [0.6 if index == best else 0.3 + index / 100 for index in range(6)]
    monkeypatch.setattr(fit, "accuracy_at", made(accuracies, []))
    reports: list[tuple[str, int, int]] = []
    result = fit_fixed_best(config, lambda *report: reports.append(report))
    assert reports == [("places", done, 6) for done in range(7)]
    assert result.tried[0].accuracy == 0.6
    assert result.tried[0].place == candidate_places(tells_front=True)[best]
    loaded = load_fixed_place(replace(config.conditions, models=config.out), DATA, "level")
    assert loaded.place == result.tried[0].place
    held = written(config)
    assert held["training"]["part"] == "validation"
    assert [one["accuracy"] for one in held["training"]["tried"]] == sorted(accuracies, reverse=True)
    assert [path.name for path in result.path.parent.iterdir()] == [result.path.name], "nothing else is left"


def test_a_recogniser_that_sees_better_from_level_sends_the_camera_there(config: FixedBestConfig) -> None:
    config = changed(config, data=tiny_data(sequences=24, frames=40), length=40)
    result = fit_fixed_best(config, silent)
    assert np.degrees(result.tried[0].place.polar) == pytest.approx(85)
    assert result.tried[0].accuracy > result.tried[-1].accuracy
    again = replace(config, out=Path(str(config.out)) / "again")
    assert fit_fixed_best(again, silent).tried == result.tried
    other = changed(config, seed=1, out=Path(str(config.out)) / "other")
    assert fit_fixed_best(other, silent).tried != result.tried


class Stopped(BaseException):
    """Ctrl-C."""


def test_a_stopped_fit_goes_on_where_it_was(config: FixedBestConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(what: str, done: int, whole: int) -> None:
        if done == 4:
            raise Stopped

    calls: list[int] = []
    monkeypatch.setattr(fit, "accuracy_at", made([0.1, 0.9, 0.3, 0.2, 0.4, 0.5], calls))
    with pytest.raises(Stopped):
        fit_fixed_best(config, stop)
    assert calls == [0, 1, 2, 3]
    other = changed(config, seed=1)
    with pytest.raises(Stopped):
        fit_fixed_best(other, stop)
    assert calls[4:] == [0, 1, 2, 3], "accuracies of another seed are not used"
    result = fit_fixed_best(config, silent)
    assert calls[8:] == [4, 5]
    assert result.tried[0].accuracy == 0.9


def test_only_the_validation_part_is_looked_at(config: FixedBestConfig) -> None:
    part, scenarios = validation_windows(load_setting(config.conditions), LENGTH)
    assert part == "validation"
    assert set(scenarios.sequence) == set(split_parts(DATA).validation)


def test_without_long_validation_sequences_the_policy_part_says_and_the_test_part_never() -> None:
    parts = split_parts(DATA)

    def cut(short: list[np.ndarray]) -> MotionData:
        lengths = np.where(np.isin(np.arange(len(DATA.labels)), np.concatenate(short)), LENGTH - 1, 20)
        pieces = [DATA.sequence(index)[:length] for index, length in enumerate(lengths)]
        return replace(DATA, positions=np.concatenate(pieces), offsets=np.cumsum([0, *lengths]))

    told = Conditions(data=cut([parts.validation]), length=LENGTH)
    part, scenarios = validation_windows(load_setting(told), told.length)
    assert part == "policy"
    assert set(scenarios.sequence) == set(parts.policy)
    with pytest.raises(DataError, match="tiny: expected validation sequences of at least 8 frames to try places on"):
        validation_windows(load_setting(replace(told, data=cut([parts.validation, parts.policy]))), told.length)


def test_a_long_validation_part_is_drawn_from(config: FixedBestConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    _, scenarios = validation_windows(load_setting(config.conditions), LENGTH)
    monkeypatch.setattr(fit, "MOST_WINDOWS", 3)
    drawn = [validation_windows(load_setting(replace(config.conditions, seed=seed)), LENGTH)[1] for seed in (0, 0, 1)]
    chosen = [list(zip(some.sequence.tolist(), some.first.tolist(), strict=True)) for some in drawn]
    assert len(chosen[0]) == 3 < len(scenarios)
    assert chosen[0] == chosen[1] != chosen[2]


def test_where_left_and_right_are_not_named_azimuths_are_the_world_s(config: FixedBestConfig) -> None:
    unnamed = replace(DATA.skeleton, joint_names=tuple(f"marker-{index}" for index in range(6)))
    told = replace(config.conditions, data=replace(DATA, skeleton=unnamed))
    result = fit_fixed_best(replace(config, conditions=told), silent)
    assert {one.place.absolute for one in result.tried if one.place.azimuth is not None} == {True}
    assert len(result.tried) == 2 * (1 + len(fit.AROUND))


@pytest.mark.slow
def test_workers_decide_nothing(config: FixedBestConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fit, "STARTS", 4)  # as in the workers, which import the module anew
    setting = load_setting(config.conditions)
    _, scenarios = validation_windows(setting, LENGTH)
    task = fit.PlaceTask(setting.runner, scenarios, candidate_places(tells_front=True), 0)
    one, two = (dict(Processes(workers).each_batch(accuracy_at, task, [0, 1])) for workers in (1, 2))
    assert one == two


@pytest.mark.parametrize(
    ("error", "changes", "message"),
    [
        (UsageError, {"workers": 0}, "workers: expected at least 1, got 0"),
        (UsageError, {"out": None}, "train fixed-best: expected --models DIR, or --out DIR"),
        (UsageError, {"sensor": "radar"}, "unknown sensor 'radar'"),
        (
            UsageError,
            {"track": "px4-auto"},
            "train fixed-best: expected the track 'ideal', one place is for all; got px4",
        ),
        (UsageError, {"onset": "known"}, "onset: expected unknown in a training, got known"),
        (DataError, {"length": 21}, "expected validation sequences of at least 21 frames"),
    ],
)
def test_options_that_make_no_sense(
    config: FixedBestConfig, error: type[EharError], changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(error, match=message):
        fit_fixed_best(changed(config, **changes), silent)


def test_the_place_of_another_recogniser_is_not_lost_to_one_for_your_own(
    config: FixedBestConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    fit_fixed_best(config, silent)

    class Mine(LevelRecogniser):
        class_names = DATA.class_names

    with pytest.raises(UsageError, match=r"trained for another recogniser.*: remove it, or choose another --out$"):
        fit_fixed_best(changed(config, recogniser=Mine()), silent)
    with pytest.raises(ModelError, match="trained for another recogniser"):
        load_fixed_place(replace(config.conditions, models=config.out), DATA, "mine")
