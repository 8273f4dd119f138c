import numpy as np

from eval.records.solves import Solves, join_solves, solves_of
from planners.heuristic import NoAct
from planners.search.next_best_view import NextBestView
from planners.search.solver import SolverStatistics, SolveStatus
from tests.helpers.fakes import tiny_context
from tests.helpers.gain_models import model_of, peak_weights


class Counting(NoAct):
    statistics = SolverStatistics()


def test_a_planner_that_counts_nothing_has_no_solves() -> None:
    assert solves_of(NoAct()) is None
    assert join_solves([None, None]) is None


def test_the_planner_of_the_registry_counts_from_each_reset() -> None:
    planner = NextBestView(model=model_of(peak_weights(np.array([10.0, 1.0, 1.0]))))
    assert solves_of(planner) == Solves({}, 0)
    planner.reset(tiny_context())
    planner.statistics.counts[SolveStatus.OPTIMAL] += 1
    assert solves_of(planner) == Solves({"optimal": 1}, 0)
    planner.reset(tiny_context())
    assert solves_of(planner) == Solves({}, 0)


def test_batches_add_up() -> None:
    planner = Counting()
    planner.statistics.counts.update({SolveStatus.OPTIMAL: 7, SolveStatus.INFEASIBLE: 2, SolveStatus.NAN_FIELD: 1})
    one = solves_of(planner)
    assert one == Solves({"infeasible": 2, "nan-field": 1, "optimal": 7}, 3)
    both = join_solves([one, Solves({"ipopt-fallback": 10}, 10), None])
    assert both == Solves({"infeasible": 2, "ipopt-fallback": 10, "nan-field": 1, "optimal": 7}, 13)
    assert (both.total, both.fallback_share) == (20, 0.65)
    assert Solves({}, 0).fallback_share == 0
