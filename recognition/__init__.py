"""Recognises activities: CTR-GCN as published, its streaming form, training and calibration.

The import makes `ehar/Grid-v0`, `ehar/Flight-v0` and `ehar/Stream-v0` known to Gymnasium.
"""

import gymnasium

gymnasium.register(
    id="ehar/Grid-v0",
    entry_point="recognition.environments:make_env",
    vector_entry_point="recognition.environments:make_vector_env",
)
gymnasium.register(
    id="ehar/Flight-v0",
    entry_point="recognition.environments:make_env",
    vector_entry_point="recognition.environments:make_vector_env",
    kwargs={"track": "px4-auto"},
)
gymnasium.register(
    id="ehar/Stream-v0",
    entry_point="recognition.environments:make_stream_env",
    vector_entry_point="recognition.environments:make_stream_vector_env",
)
