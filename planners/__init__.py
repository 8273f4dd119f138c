"""What to do about it: heuristic planners and oracles."""
