"""Benchmarks in which cameras are vehicles."""

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from ehar.errors import UsageError
from ehar.flight.vehicle import VEHICLES
from eval.records.episode_lines import read_episodes
from eval.records.flights import summarise_flights
from eval.records.run_files import EPISODES, SUMMARY
from tests.helpers.agents import save_untrained
from tests.helpers.fakes import tiny_data
from tests.helpers.tiny_benchmarks import file_hash, run, with_agents
from tests.helpers.vehicle_files import FILE_KEYS

pytestmark = pytest.mark.usefixtures("fake_weights")


def test_a_vehicle_flies_within_its_limits_and_the_records_say_so(tmp_path: Path) -> None:
    summary = run(["no-act", "oracle"], track="px4-max", starts=1, out=tmp_path).summary
    vehicle = VEHICLES["px4-max"]
    config = json.loads((tmp_path / "config.json").read_text())
    assert config["track"] == summary.config.conditions.track == "px4-max"
    assert config["vehicle"] == asdict(vehicle)
    still, oracle = (planner.flight for planner in summary.planners)
    assert still is not None and oracle is not None and vehicle.body is not None
    assert (still.peak_speed, still.effort, still.limit_share, still.distance) == (0, 0, 0, 0)
    time = (summary.config.conditions.frames - 1) / 25  # the tiny data's frames a second
    assert still.energy == pytest.approx(time * vehicle.body.hover_power, rel=1e-6)
    assert oracle.distance is not None and still.noise is not None
    assert 0 < oracle.distance < time * vehicle.speed
    assert summary.planner("oracle").metrics["path_length_m"] == pytest.approx(oracle.distance, rel=0.1)
    assert 0 < vehicle.body.sound_power_level - 11 - still.noise < 20 * math.log10(15)
    assert 0 < oracle.peak_speed <= vehicle.speed
    assert 0 < oracle.peak_acceleration <= vehicle.acceleration * (1 + 1e-6)
    assert 0 < oracle.peak_jerk <= vehicle.jerk * (1 + 1e-6)
    assert oracle.effort > 0
    flights = read_episodes(tmp_path / EPISODES)["oracle"].flight
    assert flights is not None
    assert summarise_flights(flights) == oracle
    assert "effort" in (tmp_path / "table.md").read_text()


def test_a_vehicle_of_one_s_own_is_recorded_with_its_limits(tmp_path: Path) -> None:
    path = tmp_path / "snail.json"
    path.write_text(json.dumps(dict.fromkeys(FILE_KEYS, 0.5)))
    summary = run(["no-act", "oracle"], track=str(path), starts=1, out=tmp_path / "run").summary
    assert summary.config.conditions.track == summary.to_json()["track"] == "snail"
    assert json.loads((tmp_path / "run" / "config.json").read_text())["vehicle"]["speed"] == 0.5


def test_flights_are_compared_with_a_run_on_the_ideal_track(tmp_path: Path) -> None:
    ideal = run(["no-act", "oracle"], out=tmp_path / "ideal").summary
    flight = run(
        ["no-act", "oracle"], track="tracking-drone", ideal=tmp_path / "ideal", out=tmp_path / "flight"
    ).summary
    assert flight.planner("no-act").acc_mean == ideal.planner("no-act").acc_mean
    gains = [summary.planner("oracle").acc_mean - summary.planner("no-act").acc_mean for summary in (flight, ideal)]
    assert flight.planner("oracle").accuracy_kept == pytest.approx(gains[0] / gains[1])
    with pytest.raises(UsageError, match="differs in seed"):
        run(["no-act"], track="tracking-drone", ideal=tmp_path / "ideal", seed=1)


def test_the_flight_of_an_agent_is_compared_with_the_same_agent(tmp_path: Path) -> None:
    models = tmp_path / "models"
    with_agents(models)
    options: dict[str, Any] = {"planners": ["no-act", "oracle", "il-ppo"], "models": models, "starts": 1}
    run(**options, out=tmp_path / "ideal")
    flight = run(**options, track="tracking-drone", ideal=tmp_path / "ideal").summary
    assert flight.planner("il-ppo").accuracy_kept is not None
    save_untrained(models, tiny_data(sequences=40), "il-ppo", seed=1, like="another")
    with pytest.raises(UsageError, match="the weights of il-ppo/1 differ"):
        run(**options, track="tracking-drone", ideal=tmp_path / "ideal")


@pytest.mark.slow
def test_two_workers_give_the_same_bytes_in_flight_with_beliefs_and_plans(models: Path, tmp_path: Path) -> None:
    options: dict[str, Any] = {"models": models, "track": "px4-max", "readout": "belief", "starts": 2}
    for workers in (1, 2):
        run(["no-act", "nbv-greedy", "nbv"], out=tmp_path / str(workers), workers=workers, **options)
    one, two = (json.loads((tmp_path / name / SUMMARY).read_text()) for name in "12")
    assert file_hash(tmp_path / "1" / EPISODES) == file_hash(tmp_path / "2" / EPISODES)
    assert [planner["solves"] for planner in one["planners"]] == [planner["solves"] for planner in two["planners"]]
