"""Sensors: what a pose estimator makes of joints in space."""
