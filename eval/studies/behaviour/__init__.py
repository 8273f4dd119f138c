"""How planners behave in a finished run: what they gain by class, where they go, and what an agent's states show."""
