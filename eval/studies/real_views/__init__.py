"""Whether what is simulated holds for real cameras: executions that several cameras recorded at once."""
