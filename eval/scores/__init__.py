"""Scores: pure functions of records."""
