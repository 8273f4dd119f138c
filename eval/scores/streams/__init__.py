"""Scores of streams: activities within them like clips, and frame by frame how soon and how wrongly they are named."""
