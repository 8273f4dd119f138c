"""Conformance kits for a user's own classes."""
