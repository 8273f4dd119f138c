"""Studies: questions that are asked of data, of a belief, or of finished runs."""
