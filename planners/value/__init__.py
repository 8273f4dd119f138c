"""What a view is worth: the belief, where people are, and the gain field over views."""
