"""The records of a run: what happened in each frame, and the files that hold it."""
