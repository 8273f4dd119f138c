"""Running the benchmark: episodes, planners, jobs and processes."""
