"""Planners by name."""

import subprocess
import sys

import numpy as np
import pytest

from ehar.errors import UsageError
from eval.scores.resampling.training_seeds import record_name, split_record_name
from eval.scores.seed_accuracy import TABLE_3
from planners.agents.agent import Agent
from planners.oracle import OracleLookahead
from planners.place.storage import FixedPlace
from planners.registry import (
    ABLATED,
    LEARNED,
    check_spec,
    is_learned,
    make_planner,
    needs_fixed_place,
    needs_gain_model,
    planner_names,
)
from planners.value.model import GainModel
from tests.helpers.agents import untrained_agent
from tests.helpers.fixed_places import fixed_place
from tests.helpers.gain_models import model_of, peak_weights

NAMES = (
    "no-act",
    "random",
    "towards",
    "h-rotate",
    "v-rotate",
    "near-level",
    "side",
    "front",
    "fixed-best",
    "nbv-greedy",
    "nbv-search",
    "nbv",
    "il",
    "ppo",
    "il-ppo",
    "dagger",
    "oracle",
    "oracle-lookahead",
)


def gain_model() -> GainModel:
    return model_of(peak_weights(np.array([10.0, 1.0, 1.0])))


def test_names_come_in_the_order_of_display_and_make_their_planners() -> None:
    assert planner_names() == NAMES
    assert [make_planner(name, gain_model, untrained_agent, fixed_place).name for name in NAMES] == list(NAMES)
    assert make_planner("oracle") is not make_planner("oracle")


def test_a_model_is_loaded_for_planners_that_value_views_only() -> None:
    loaded: list[GainModel] = []

    def load() -> GainModel:
        loaded.append(gain_model())
        return loaded[-1]

    for name in NAMES:
        before = len(loaded)
        make_planner(name, load, untrained_agent, fixed_place)
        assert len(loaded) - before == needs_gain_model(name) == name.startswith("nbv")


@pytest.mark.parametrize("name", ["nbv", "nbv-greedy", "nbv-search"])
def test_a_planner_that_values_views_does_not_run_without_a_model(name: str) -> None:
    with pytest.raises(UsageError, match=f"planner '{name}': expected a gain model"):
        make_planner(name)


def test_a_place_is_loaded_for_the_planner_that_goes_there_only() -> None:
    loaded: list[FixedPlace] = []

    def load() -> FixedPlace:
        loaded.append(fixed_place())
        return loaded[-1]

    for name in NAMES:
        before = len(loaded)
        make_planner(name, gain_model, untrained_agent, load)
        assert len(loaded) - before == needs_fixed_place(name) == (name == "fixed-best")
    assert make_planner("fixed-best", load_place=load) is not make_planner("fixed-best", load_place=load)
    with pytest.raises(UsageError, match="planner 'fixed-best': expected a fitted place, got none"):
        make_planner("fixed-best", gain_model, untrained_agent)


def test_an_agent_is_loaded_for_learned_planners_only_and_by_the_name_they_were_asked_for() -> None:
    loaded: list[str] = []

    def load(spec: str) -> Agent:
        loaded.append(spec)
        return untrained_agent(spec)

    for spec in (*NAMES, "il-ppo/2", "ppo-no-vision", "il-no-position/0"):
        make_planner(spec, gain_model, load, fixed_place)
    assert loaded == ["il", "ppo", "il-ppo", "dagger", "il-ppo/2", "ppo-no-vision", "il-no-position/0"]


@pytest.mark.parametrize("spec", ["il", "il-ppo/0", "il-ppo-no-vision"])
def test_a_learned_planner_does_not_run_untrained(spec: str) -> None:
    with pytest.raises(UsageError, match=f"planner '{spec}': expected a trained agent, got none"):
        make_planner(spec, gain_model)


def test_what_is_learned_and_what_only_looks_so() -> None:
    assert all(map(is_learned, (*LEARNED, *ABLATED, "il/0", "il-ppo/12", "ppo-no-vision/3")))
    assert set(TABLE_3) <= {*LEARNED, *ABLATED}
    for spec in (
        "il/",
        "il/x",
        "il/-1",
        "il/00",
        "il/1/2",
        "il/\u0663",
        "/0",
        "nbv/0",
        "il-no-sound",
        "il-no-vision-no-x",
    ):
        assert not is_learned(spec)
        with pytest.raises(UsageError, match="unknown planner") as error:
            make_planner(spec, gain_model, untrained_agent)
        assert repr(spec) in str(error.value)


@pytest.mark.parametrize("seed", [0, 9, 10, 123])
def test_record_names_are_learned_planners(seed: int) -> None:
    for name in (*LEARNED, *ABLATED):
        assert is_learned(record_name(name, seed))
        assert split_record_name(record_name(name, seed)) == (name, seed)


def test_names_are_listed_without_torch_and_casadi() -> None:
    code = "import sys; from planners.registry import *; planner_names(); print({'torch', 'casadi'} & set(sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "set()\n"


def test_an_unknown_name_lists_the_known_ones_and_the_forms() -> None:
    forms = r"or path/to/file.py:ClassName or package.module:ClassName$"
    for spec in ("towers", "own.py", "own.py:", ":Mine", "own.py:3", "towers(speed=2)", "", "--radius"):
        for refuse in (check_spec, make_planner):
            with pytest.raises(
                UsageError, match=rf"unknown planner .*; .* no-act, .*, oracle-lookahead, {forms}"
            ) as error:
                refuse(spec)
            assert repr(spec) in str(error.value)


@pytest.mark.parametrize(("horizon", "commit"), [(0, 0), (4, 5), (4, 0)])
def test_the_lookahead_cannot_commit_to_more_than_it_has_seen(horizon: int, commit: int) -> None:
    with pytest.raises(UsageError, match=f"got {commit} and {horizon}"):
        OracleLookahead(horizon=horizon, commit=commit)
