"""How well it went: the benchmark, its metrics, statistics and figures, and the command line."""

from eval.check_planner import check_planner as check_planner
from eval.check_recogniser import check_recogniser as check_recogniser
from eval.fixed_views import headroom as headroom
from eval.run import benchmark as benchmark
