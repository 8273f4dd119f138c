"""Where to go for it: search over views, and optimal control over trajectories."""
