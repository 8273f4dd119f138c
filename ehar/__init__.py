"""The world of embodied human activity recognition, and the contracts of those who act in it.

Importing it makes `ehar/Grid-v0` and `ehar/Flight-v0` known to Gymnasium.
"""

import gymnasium

# By name: an environment that is made without arguments needs a trained recogniser, which this folder knows nothing of.
gymnasium.register(
    id="ehar/Grid-v0",
    entry_point="recognition.environments:grid_env",
    vector_entry_point="recognition.environments:grid_vector_env",
)
gymnasium.register(
    id="ehar/Flight-v0",
    entry_point="recognition.environments:flight_env",
    vector_entry_point="recognition.environments:flight_vector_env",
)
