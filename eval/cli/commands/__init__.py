"""The commands of `ehar`: the function that each command runs, and how its result is printed."""
