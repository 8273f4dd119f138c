"""How well it went: the benchmark, its metrics, statistics and figures, and the command line."""
