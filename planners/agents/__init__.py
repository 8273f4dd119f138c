"""What is learned instead: agents that imitate an oracle, or learn from reward."""
