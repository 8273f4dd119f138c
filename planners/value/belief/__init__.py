"""The belief: which activity is shown, from all that was recognised so far; in clips and in streams."""
