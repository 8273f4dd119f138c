"""Readers of original files: one file a format."""
