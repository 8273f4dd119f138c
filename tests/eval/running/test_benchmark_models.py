"""Planners and readouts that need trained weights, in a benchmark."""

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ehar.conditions import Conditions
from ehar.data.scenario import split_parts
from ehar.errors import ModelError
from ehar.motion import GridMotion
from ehar.rollout import rollout
from ehar.sensors.perfect import PerfectSensor
from ehar.world import PAPER
from eval.records.episode_lines import read_episodes
from eval.records.run_files import EPISODES
from eval.running.episodes import CHUNK, cut_scenarios, random_starts
from planners.heuristic import NoAct
from planners.registry import planner_names
from planners.search.next_best_view import NextBestView
from planners.value.belief.clips import readout
from planners.value.model import gain_model_path
from tests.helpers.fakes import FakeRecogniser, tiny_context, tiny_data
from tests.helpers.fixed_places import save_place
from tests.helpers.gain_models import model_of, peak_weights
from tests.helpers.tiny_benchmarks import SLOW_TO_BELIEVE, Log, file_hash, names, run, save_models, with_agents

pytestmark = pytest.mark.usefixtures("fake_weights")


def test_without_names_every_planner_runs_each_training_of_a_learned_one(models: Path, tmp_path: Path) -> None:
    log, hashes = Log(), with_agents(models)
    summary = run(None, starts=1, models=models, out=tmp_path / "run", reporter=log).summary
    ran = {*log.done}
    trainings = {"il/0", "ppo/3", "il-ppo/0", "il-ppo/1", "dagger/0"}
    assert ran == {*planner_names()} - {"il", "ppo", "il-ppo", "dagger"} | trainings
    assert names(summary) == planner_names(), "the trainings of a planner are one row"
    assert log.notes == []
    hashes["fixed-best"] = file_hash(models / "fixed-best-perfect-moving.json")
    for planner in json.loads((tmp_path / "run" / "config.json").read_text())["planners"]:
        assert planner["weights_sha256"] == hashes.get(planner["name"])
        assert not planner["privileged"] or planner["name"].startswith("oracle")
    config = json.loads((tmp_path / "run" / "config.json").read_text())
    weights = gain_model_path(models, Conditions())
    content = weights.read_bytes() + weights.with_suffix(".json").read_bytes()
    assert config["gain_model_sha256"] == hashlib.sha256(content).hexdigest()
    assert {"casadi", "filterpy", "ruckig"} <= config["versions"].keys()


def test_those_for_whom_nothing_was_trained_are_left_out_aloud(tmp_path: Path) -> None:
    log = Log()
    summary = run(None, starts=1, models=tmp_path / "none", reporter=log).summary
    trained = ("fixed-best", "nbv", "il", "ppo", "dagger")
    assert names(summary) == tuple(name for name in planner_names() if not name.startswith(trained))
    fitted, valuing, learned = log.notes
    assert fitted.startswith("left out: fixed-best: ")
    assert "`ehar train fixed-best --data X.npz" in fitted
    assert valuing.startswith("left out: nbv-greedy, nbv-search, nbv: ")
    assert "`ehar train gain-field --data X.npz" in valuing
    assert learned.startswith("left out: il, ppo, il-ppo, dagger: no agent was trained for this recogniser: ")
    assert "`ehar train agent --data X.npz" in learned
    log = Log()
    run(None, starts=1, form="ctrgcn", reporter=log)
    fitted, valuing, learned = log.notes
    assert fitted.endswith("fixed places are fitted for the causal recogniser, and this is ctrgcn")
    assert valuing.endswith("gain fields are trained for the causal recogniser, and this is ctrgcn")
    assert learned.startswith("left out: il, ppo, il-ppo, dagger: no agent was trained for this recogniser: ")


def test_who_is_named_has_to_run(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="no such file: expected a gain field"):
        run(["no-act", "nbv"], models=tmp_path / "none")
    with pytest.raises(ModelError, match=r"agent-il-ppo-perfect-moving-seed0\.safetensors: no such file"):
        run(["no-act", "il-ppo"], models=tmp_path / "none")


@pytest.mark.parametrize("planners", [None, ["nbv-greedy"]])
def test_a_gain_field_of_another_recogniser_is_never_passed_over(models: Path, planners: list[str] | None) -> None:
    save_models(models, recogniser_sha256="another")
    save_place(models)
    with pytest.raises(ModelError, match="trained for another recogniser"):
        run(planners, models=models)


def test_a_gain_field_that_is_right_is_worth_following(models: Path) -> None:
    summary = run(["no-act", "nbv-greedy", "nbv-search", "nbv"], models=models, starts=1).summary
    no_act, *valuing = (planner.acc_mean for planner in summary.planners)
    assert min(valuing) > no_act
    assert [(difference.planner, difference.other) for difference in summary.differences] == [
        ("nbv", "no-act"),
        ("nbv", "nbv-greedy"),
        ("nbv", "nbv-search"),
    ]


def test_plans_are_counted_over_all_chunks(models: Path) -> None:
    # 80 episodes of 10 frames: a plan for each of them at every frame that is a multiple of `replan`, but the last.
    summary = run(["no-act", "nbv"], models=models, starts=2).summary
    assert summary.episodes == 80 > CHUNK
    assert summary.planner("no-act").solves is None
    solves = summary.planner("nbv").solves
    assert solves is not None
    replan = NextBestView(model=model_of(peak_weights(np.array([8.0, 1.0, 1.0])))).replan
    assert solves.total == 80 * len(range(0, 9, replan))


def test_the_belief_is_scored_and_planners_act_the_same(models: Path, tmp_path: Path) -> None:
    run(["no-act", "oracle"], models=models, out=tmp_path / "recogniser", starts=1)
    summary = run(["no-act", "oracle"], models=models, readout="belief", out=tmp_path / "belief", starts=1).summary
    seen, believed = (read_episodes(tmp_path / name / EPISODES) for name in ("recogniser", "belief"))
    for name in seen:
        np.testing.assert_array_equal(seen[name].viewpoint, believed[name].viewpoint)
        assert not np.array_equal(seen[name].true_probability, believed[name].true_probability)
    assert summary.config.readout == summary.to_json()["readout"] == "belief"
    assert json.loads((tmp_path / "belief" / "config.json").read_text())["readout"] == "belief"
    assert "readout belief" in (tmp_path / "belief" / "table.md").read_text()
    # By hand: the belief of the fake recogniser's words from where no-act stands.
    data = tiny_data(sequences=40)
    scenarios = cut_scenarios(data, split_parts(data).test, 10, print)
    episodes = random_starts(scenarios, 1, 0, PAPER)
    context = replace(tiny_context(episodes=32, length=10), frame_time=1 / data.fps)
    record = rollout(NoAct(), episodes.batch(0), FakeRecogniser(), PerfectSensor(), GridMotion(), context)
    probabilities = np.exp(readout(SLOW_TO_BELIEVE, record.log_probs, record.viewpoints))
    true = np.take_along_axis(probabilities, episodes.chunk(0).labels[:, None, None], axis=2)[..., 0]
    np.testing.assert_allclose(believed["no-act"].true_probability[:32], true, atol=1e-6)


def test_the_belief_is_not_scored_without_a_model(tmp_path: Path) -> None:
    for planners in (None, ["no-act"]):
        with pytest.raises(ModelError, match="no such file: expected a gain field"):
            run(planners, models=tmp_path / "none", readout="belief")


@pytest.mark.slow
def test_trainings_that_are_named_run_alone_and_agents_reach_the_workers(tmp_path: Path) -> None:
    with_agents(tmp_path)
    for workers in (1, 2):
        log = Log()
        chosen = ["no-act", "il-ppo/1", "il-ppo-no-vision"]
        run(chosen, models=tmp_path, starts=1, out=tmp_path / str(workers), workers=workers, reporter=log)
        assert {*log.done} == {"no-act", "il-ppo/1", "il-ppo-no-vision/0"}
    assert file_hash(tmp_path / "1" / EPISODES) == file_hash(tmp_path / "2" / EPISODES)
    ways = {name: episodes.viewpoint for name, episodes in read_episodes(tmp_path / "1" / EPISODES).items()}
    assert not np.array_equal(ways["il-ppo/1"], ways["no-act"])
    assert not np.array_equal(ways["il-ppo/1"], ways["il-ppo-no-vision/0"])
