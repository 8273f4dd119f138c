"""Trials: a recogniser is trained with one thing changed, and asked about people who were left out."""
