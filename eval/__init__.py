"""How well it went: the benchmark, its metrics, statistics and figures, and the command line."""

from eval.fixed_views import headroom as headroom
from eval.run import benchmark as benchmark
