"""The world of embodied human activity recognition, and the contracts of those who act in it."""
