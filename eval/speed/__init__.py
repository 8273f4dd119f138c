"""How fast everything is: `ehar bench`."""
