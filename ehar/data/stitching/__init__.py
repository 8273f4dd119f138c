"""Stitching: streams out of trimmed sequences of the same people, one activity after another."""
