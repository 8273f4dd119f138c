"""Replays: one episode as a film, a recording, or a part of a report."""
