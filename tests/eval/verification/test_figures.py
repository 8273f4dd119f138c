"""Every value of a summary is compared with what the records give, whatever it holds."""

import copy
import json
from typing import Any

import pytest

from eval.records.config import PlannerConfig
from eval.records.solves import Solves
from eval.verification.figures import NOISE, count_figures, mismatch, recompute
from tests.helpers.made_records import config_of_run, summary_of, three_planners

CONFIG_OF_THREE = config_of_run(
    planners=tuple(PlannerConfig(name, name == "oracle", "") for name in ("no-act", "mine", "oracle")),
)


def held() -> Any:
    solves = {"no-act": None, "mine": Solves({"optimal": 3}, 1), "oracle": None}
    return json.loads(json.dumps(summary_of(three_planners(), solves=solves).to_json()))


def test_a_summary_is_recomputed_but_for_what_is_not_recorded() -> None:
    expected = recompute(CONFIG_OF_THREE, three_planners(), held(), None)
    assert mismatch(held(), expected) is None
    assert expected["planners"][1]["step_ms"] == pytest.approx(0.25)
    assert mismatch(held(), recompute(CONFIG_OF_THREE, three_planners(), "nothing", None)) is None
    found = mismatch("nothing", expected)
    assert found is not None and found.startswith("summary.json: got 'nothing', expected {'data': 'tiny")


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("episodes",), 10, "summary.json: episodes: got 10, expected 9"),
        (("data",), "expi", "summary.json: data: got 'expi', expected 'tiny (synthetic)'"),
        (("planners", 1, "name"), "yours", "summary.json: planners: mine: name: got 'yours', expected 'mine'"),
        (("planners", 2, "privileged"), False, "summary.json: planners: oracle: privileged: got False, expected True"),
        (("planners", 2, "privileged"), 1, "summary.json: planners: oracle: privileged: got 1, expected True"),
        (("planners", 0, "acc", "50"), 99.0, "summary.json: planners: no-act: acc: 50: got 99.0, expected "),
        (("planners", 1, "acc_mean_ci95", 1), None, "summary.json: planners: mine: acc_mean_ci95[1]: got None, expect"),
        (("planners", 1, "effort"), 1.5, "summary.json: planners: mine: effort: got 1.5, expected None"),
        (("planners", 1, "nll"), float("nan"), "summary.json: planners: mine: nll: got nan, expected "),
        (("planners",), [], "summary.json: planners: got [], expected [{'name': 'no-act'"),
        (("by hand",), 1, "summary.json: by hand: got 1, expected 'nothing'"),
    ],
)
def test_an_edited_value_is_named(path: tuple[Any, ...], value: Any, message: str) -> None:
    edited = held()
    inner = edited
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    found = mismatch(edited, held())
    assert found is not None and found.startswith(message)


def test_a_value_that_was_taken_out_is_named() -> None:
    edited = held()
    del edited["planners"][0]["ece"]
    found = mismatch(edited, held())
    assert found is not None and found.startswith("summary.json: planners: no-act: ece: got nothing, expected 0.")


def test_noise_is_no_difference_and_neither_are_timings() -> None:
    edited = copy.deepcopy(held())
    edited["planners"][1]["acc_mean"] *= 1 + NOISE / 2
    edited["planners"][1] |= {"step_ms": 7, "solves": {}, "fallback_share": None}
    assert mismatch(edited, held()) is None
    edited["planners"][1]["acc_mean"] *= 1 + 10 * NOISE
    assert mismatch(edited, held()) is not None


def test_figures_are_counted() -> None:
    assert count_figures({"a": [1, 2.0, None, True, "x"], "b": {"c": 3}, "step_ms": 4}) == 3
