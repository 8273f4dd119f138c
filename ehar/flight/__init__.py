"""Flight: a vehicle carries the camera, and keeps its limits."""
