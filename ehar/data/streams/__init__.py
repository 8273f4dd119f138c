"""Streams: recordings of minutes, in which one activity follows another and nobody says where one begins."""
