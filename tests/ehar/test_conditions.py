"""What a run is told: every wrong word or number is refused in one line, and what is derived from the others."""

from dataclasses import FrozenInstanceError, fields, replace
from pathlib import Path
from typing import Any

import pytest

from ehar.conditions import FORMS, REGIMES, Conditions
from ehar.data.scenario import PARTS
from ehar.errors import UsageError
from ehar.sensors.estimator import EstimatorSensor
from recognition.storage import SHIPPED, recogniser_path
from tests.helpers.fakes import SKELETON, FakeRecogniser, tiny_data


def refusal(**told: Any) -> str:
    with pytest.raises(UsageError) as caught:
        Conditions(**told)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("wrong", ["", "train", "Moving", "spiral", None, 3])
@pytest.mark.parametrize(
    ("field", "known"),
    [
        ("part", "recogniser, policy, validation, test"),
        ("views", "moving, paper, recorded"),
        ("form", "causal, ctrgcn"),
    ],
)
def test_an_unknown_word_lists_the_known_ones(field: str, known: str, wrong: Any) -> None:
    assert refusal(**{field: wrong}) == f"unknown {field} {wrong!r}; expected one of: {known}"


@pytest.mark.parametrize(("field", "least"), [("starts", 1), ("length", 1), ("seed", 0)])
def test_numbers_are_whole_and_not_too_small(field: str, least: int) -> None:
    for wrong in (least - 1, -8, 2.0, float("nan"), "3", None, True):
        if (field, wrong) == ("length", None):
            continue  # the usual length
        assert refusal(**{field: wrong}) == f"{field}: expected a whole number of at least {least}, got {wrong!r}"
    assert getattr(Conditions(**{field: least}), field) == least


@pytest.mark.parametrize(("field", "most"), [("starts", 10**6), ("length", 10**6), ("seed", 2**63 - 1)])
def test_numbers_are_not_too_large_for_an_array(field: str, most: int) -> None:
    assert refusal(**{field: most + 1}) == f"{field}: expected a whole number of at most {most}, got {most + 1}"
    assert getattr(Conditions(**{field: most}), field) == most


@pytest.mark.parametrize("own", ["mine.py:Mine", FakeRecogniser()])
def test_a_recogniser_of_a_user_s_own_has_no_form(own: Any) -> None:
    assert Conditions(recogniser=own).form == "causal"
    message = refusal(recogniser=own, form="ctrgcn")
    assert message == "form: expected none beside your own recogniser, got ctrgcn"


def test_every_known_word_is_taken() -> None:
    told = [{"part": part} for part in PARTS] + [{"views": views} for views in REGIMES]
    for chosen in [*told, *({"form": form} for form in FORMS)]:
        conditions = Conditions(**chosen)  # type: ignore[arg-type]
        assert {name: getattr(conditions, name) for name in chosen} == chosen


def test_they_do_not_change_and_a_change_is_checked_too() -> None:
    conditions = Conditions()
    with pytest.raises(FrozenInstanceError):
        conditions.seed = 1  # type: ignore[misc]
    assert replace(conditions, seed=1).seed == 1
    with pytest.raises(UsageError, match="unknown views 'spiral'"):
        replace(conditions, views="spiral")
    assert Conditions() == conditions
    assert replace(conditions, seed=1) != conditions


def test_files_and_flags_hold_names_where_objects_may_stand() -> None:
    types = Conditions.named_types()
    assert list(types) == [field.name for field in fields(Conditions)]
    assert {name: types[name] for name in ("data", "sensor", "track")} == dict.fromkeys(
        ("data", "sensor", "track"), str
    )
    assert types["models"] == types["recogniser"] == str | None
    assert types["fps"] == float | None
    assert types["length"] == int | None
    assert (types["starts"], types["seed"], types["part"]) == (int, int, str)


def test_an_episode_has_60_frames_unless_another_length_is_told() -> None:
    assert Conditions().length is None and Conditions().frames == Conditions(length=60).frames == 60
    assert Conditions(length=42).frames == 42


@pytest.mark.parametrize("sensor", ["estimator", EstimatorSensor(skeleton=SKELETON)])
def test_weights_are_named_after_what_was_seen(sensor: Any) -> None:
    conditions = Conditions(sensor=sensor, views="paper")
    assert conditions.sensor_name == "estimator"
    assert conditions.seen == "estimator-paper"
    assert conditions.options == "--data duo --sensor estimator --views paper"


@pytest.mark.parametrize(
    ("data", "length", "told"),
    [("duo", 60, False), ("duo", 90, True), ("duo-stream", 60, True), ("duo-stream", None, False)],
)
def test_a_length_is_told_unless_it_is_the_usual_one(data: str, length: int | None, told: bool) -> None:
    assert (f"--length {length}" in Conditions(data=data, length=length).options) == told


def test_the_folder_of_weights_is_a_path_or_none() -> None:
    assert Conditions().directory is None
    assert Conditions(models="weights").directory == Conditions(models=Path("weights")).directory == Path("weights")


def test_data_may_be_an_object() -> None:
    data = tiny_data()
    assert Conditions(data=data).data is data


def test_the_usual_sensor_is_the_one_whose_weights_ship(tmp_path: Path) -> None:
    for data in ("duo", tiny_data(), tmp_path / "mine.npz"):
        assert Conditions(data=data).sensor == "perfect"
    for data in ("solo-stream", "duo-stream"):
        told = Conditions(data=data)
        assert told.sensor == "estimator" and "sensor" not in repr(told)
        assert recogniser_path(SHIPPED / data, told).is_file()
        assert Conditions(data=data, sensor="perfect").sensor == "perfect"
