import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from test_results import CONFIG_OF_RUN, make_records, three_planners

from ehar.errors import UsageError
from ehar.vehicle import VEHICLES
from eval.accuracy_kept import SAME, read_ideal_run
from eval.results import CONFIG, write_run

FLIGHT = replace(CONFIG_OF_RUN, track="px4-max", vehicle=VEHICLES["px4-max"])


def test_the_records_of_a_run_under_the_same_conditions_are_read(tmp_path: Path) -> None:
    write_run(tmp_path, replace(CONFIG_OF_RUN, gain_model_sha256="2", versions={"ehar": "0"}), three_planners(), None)
    records = read_ideal_run(tmp_path, FLIGHT)
    assert list(records) == ["no-act", "mine", "oracle"]
    np.testing.assert_array_equal(records["mine"].predicted, three_planners()["mine"].predicted)


@pytest.mark.parametrize("name", SAME)
def test_other_conditions_are_refused(tmp_path: Path, name: str) -> None:
    assert name in asdict(CONFIG_OF_RUN)
    write_run(tmp_path, replace(CONFIG_OF_RUN, **{name: "other"}), three_planners(), None)
    with pytest.raises(UsageError, match=rf"it differs in {name} \({name}: expected .*, got 'other'\)"):
        read_ideal_run(tmp_path, FLIGHT)


def test_another_gain_field_is_refused(tmp_path: Path) -> None:
    write_run(tmp_path, replace(CONFIG_OF_RUN, gain_model_sha256="2"), three_planners(), None)
    with pytest.raises(UsageError, match="differs in gain_model_sha256"):
        read_ideal_run(tmp_path, replace(FLIGHT, gain_model_sha256="3"))


def test_only_a_flight_is_compared_and_only_with_the_ideal_track(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="the track is ideal; expected a vehicle"):
        read_ideal_run(tmp_path, CONFIG_OF_RUN)
    write_run(tmp_path, FLIGHT, three_planners(), None)
    with pytest.raises(UsageError, match=r"differs in track \(track: expected 'ideal', got 'px4-max'\)"):
        read_ideal_run(tmp_path, FLIGHT)


def test_a_folder_without_a_run_or_a_run_without_no_act(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"config\.json: expected a run on the ideal track, got: No such file"):
        read_ideal_run(tmp_path, FLIGHT)
    (tmp_path / CONFIG).write_text("{")
    with pytest.raises(UsageError, match="expected the JSON of a run"):
        read_ideal_run(tmp_path, FLIGHT)
    (tmp_path / CONFIG).write_text(json.dumps([1]))
    with pytest.raises(UsageError, match="differs in track"):
        read_ideal_run(tmp_path, FLIGHT)
    write_run(tmp_path, CONFIG_OF_RUN, {"mine": make_records(1)}, None)
    with pytest.raises(UsageError, match="expected a run with no-act among its planners, got mine"):
        read_ideal_run(tmp_path, FLIGHT)
