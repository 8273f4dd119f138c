"""Scaling: what jobs and transfers take, and how long commands take on many machines."""
