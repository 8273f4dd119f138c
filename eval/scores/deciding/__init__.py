"""Deciding once: each activity is answered one time, waiting costs, and a rule says when to answer."""
