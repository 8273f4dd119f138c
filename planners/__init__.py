"""Decides where to look from: planners that search over learned values, learned agents, heuristics and oracles."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from planners.agents.agent import Agent as Agent
    from planners.heuristic import HRotate as HRotate
    from planners.heuristic import NoAct as NoAct
    from planners.heuristic import Random as Random
    from planners.heuristic import Towards as Towards
    from planners.heuristic import VRotate as VRotate
    from planners.oracle import Oracle as Oracle
    from planners.oracle import OracleLookahead as OracleLookahead
    from planners.place.go_to_place import GoToPlace as GoToPlace
    from planners.place.go_to_place import Place as Place
    from planners.registry import make_planner as make_planner
    from planners.registry import planner_names as planner_names
    from planners.search.next_best_view import NextBestView as NextBestView
    from planners.search.view_search import NextBestViewGreedy as NextBestViewGreedy
    from planners.search.view_search import NextBestViewSearch as NextBestViewSearch
    from planners.value.model import GainModel as GainModel
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "NoAct": "planners.heuristic",
            "Random": "planners.heuristic",
            "Towards": "planners.heuristic",
            "HRotate": "planners.heuristic",
            "VRotate": "planners.heuristic",
            "Oracle": "planners.oracle",
            "OracleLookahead": "planners.oracle",
            "GoToPlace": "planners.place.go_to_place",
            "Place": "planners.place.go_to_place",
            "NextBestView": "planners.search.next_best_view",
            "NextBestViewGreedy": "planners.search.view_search",
            "NextBestViewSearch": "planners.search.view_search",
            "Agent": "planners.agents.agent",
            "GainModel": "planners.value.model",
            "make_planner": "planners.registry",
            "planner_names": "planners.registry",
        },
    )
