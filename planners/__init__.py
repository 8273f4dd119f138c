"""What to do about it: planners that search over learned values, learned agents, heuristics and oracles."""
