from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ehar.errors import DataError, UsageError
from ehar.flight.vehicle import VEHICLES
from eval.records.config import CONFIG, PlannerConfig
from eval.records.run_files import SUMMARY
from eval.running.accuracy_kept import SAME, TOLD, read_ideal_run
from tests.helpers.made_records import CONFIG_OF_RUN, config_of_run, make_records, three_planners, write_finished

FLIGHT = config_of_run(track="px4-max", vehicle=VEHICLES["px4-max"])


def test_the_records_of_a_run_under_the_same_conditions_are_read(tmp_path: Path) -> None:
    write_finished(tmp_path, three_planners(), gain_model_sha256="2", versions={"ehar": "0"})
    records = read_ideal_run(tmp_path, FLIGHT)
    assert list(records) == ["no-act", "mine", "oracle"]
    np.testing.assert_array_equal(records["mine"].predicted, three_planners()["mine"].predicted)


WORDS = {"sensor": "estimator", "sensor_sha256": "8", "views": "paper", "part": "validation", "form": "ctrgcn"}
WORDS |= {"world": "indoor", "onset": "known"}


@pytest.mark.parametrize("name", [*SAME, *TOLD])
def test_other_conditions_are_refused(tmp_path: Path, name: str) -> None:
    other = WORDS.get(name) or (
        "other" if isinstance(CONFIG_OF_RUN.to_json()[name], str) else 77.0 if name == "fps" else 77
    )
    write_finished(tmp_path, three_planners(), **{name: other})
    with pytest.raises(UsageError, match=rf"it differs in {name} \({name}: expected .*, got {other!r}\)"):
        read_ideal_run(tmp_path, FLIGHT)


def test_another_gain_field_is_refused(tmp_path: Path) -> None:
    write_finished(tmp_path, three_planners(), gain_model_sha256="2")
    with pytest.raises(UsageError, match="differs in gain_model_sha256"):
        read_ideal_run(tmp_path, replace(FLIGHT, gain_model_sha256="3"))


def of(**hashes: str | None) -> tuple[PlannerConfig, ...]:
    """Return planners by name, _ for what no name may hold."""
    return tuple(PlannerConfig(name.replace("_", "/"), False, "", sha256) for name, sha256 in hashes.items())


@pytest.mark.parametrize(
    ("ideal", "flight", "differs"),
    [
        (of(il_0="a"), of(il_0="a"), None),
        (of(il_0="a", il_1="b"), of(il_1="b", il_2="c", mine=None), None),  # only planners in both are compared
        (of(mine=None), of(mine=None), None),
        (of(il_0="a", il_1="b"), of(il_0="a", il_1="c"), "il/1 differ: expected sha256 c, got sha256 b"),
        (
            of(il_0="a"),
            of(il_0=None),
            "il/0 differ: expected sha256 None, got sha256 a",
        ),  # the user's own planner is called il/0
        (of(il_0=None), of(il_0="a"), "il/0 differ: expected sha256 a, got sha256 None"),
    ],
)
def test_other_weights_of_a_learned_planner_are_refused(
    tmp_path: Path, ideal: tuple[PlannerConfig, ...], flight: tuple[PlannerConfig, ...], differs: str | None
) -> None:
    records = {"no-act": make_records(1), **{planner.name: make_records(2) for planner in ideal}}
    write_finished(tmp_path, records, planners=ideal)
    if differs is None:
        assert list(read_ideal_run(tmp_path, replace(FLIGHT, planners=flight))) == list(records)
        return
    with pytest.raises(UsageError, match=f"the weights of {differs}"):
        read_ideal_run(tmp_path, replace(FLIGHT, planners=flight))


def test_an_own_planner_with_another_file_or_argument_is_refused(tmp_path: Path) -> None:
    mine = replace(PlannerConfig("mine", False, "mine.py:Mine"), arguments={"radius": 5}, source_sha256="1")
    write_finished(tmp_path, {"no-act": make_records(1), "mine": make_records(2)}, planners=(mine,))
    assert "mine" in read_ideal_run(tmp_path, replace(FLIGHT, planners=(mine,)))
    for changed, differs in (
        (replace(mine, source_sha256="2"), "file of mine differ: expected sha256 2, got sha256 1"),
        (
            replace(mine, arguments={"radius": 6}),
            r"arguments of mine differ: expected {'radius': 6}, got {'radius': 5}",
        ),
    ):
        with pytest.raises(UsageError, match=differs):
            read_ideal_run(tmp_path, replace(FLIGHT, planners=(changed,)))


def test_only_a_flight_is_compared_and_only_with_the_ideal_track(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="the track is ideal; expected a vehicle"):
        read_ideal_run(tmp_path, CONFIG_OF_RUN)
    write_finished(tmp_path, three_planners(), track=FLIGHT.conditions.track, vehicle=FLIGHT.vehicle)
    with pytest.raises(UsageError, match=r"differs in track \(track: expected 'ideal', got 'px4-max'\)"):
        read_ideal_run(tmp_path, FLIGHT)


def test_a_folder_without_a_run_an_incomplete_one_or_one_without_no_act(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"config\.json: expected a run of ehar benchmark, got: No such file"):
        read_ideal_run(tmp_path, FLIGHT)
    for content, message in (
        ("{", "expected the JSON of a run of ehar benchmark"),
        ("[1]", "expected the JSON object of a run of ehar benchmark, got"),
    ):
        (tmp_path / CONFIG).write_text(content)
        with pytest.raises(DataError, match=message):
            read_ideal_run(tmp_path, FLIGHT)
    write_finished(tmp_path, {"mine": make_records(1)})
    with pytest.raises(UsageError, match="expected a run with no-act among its planners, got mine"):
        read_ideal_run(tmp_path, FLIGHT)
    (tmp_path / SUMMARY).unlink()
    with pytest.raises(DataError, match="incomplete"):
        read_ideal_run(tmp_path, FLIGHT)
