"""Watches recordings with a recogniser from cameras that stay: simulated, or where the real ones stood."""

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.data.scenario import Scenarios
from ehar.recogniser import Recogniser
from ehar.sensors.sensing import sense
from ehar.sensors.sensor import Sensor, draw_noise


def right_answers(
    recogniser: Recogniser, sensor: Sensor, scenarios: Scenarios, viewpoint: FloatArray, rng: np.random.Generator
) -> BoolArray:
    """Return in which frames the recogniser names the class, (N, L).

    Args:
        recogniser: the recogniser.
        sensor: what the camera's images are made with.
        scenarios: N windows of L frames.
        viewpoint: (N, 3), where the camera stands around each window's centre.
        rng: draws the sensor's errors.
    """
    positions = scenarios.positions(np.arange(len(scenarios)))
    noise = draw_noise(rng, positions.shape[:2], *positions.shape[2:4])
    state, right = recogniser.start(len(scenarios)), []
    for frame in range(scenarios.length):
        sensed = sense(sensor, positions[:, frame], viewpoint, noise.frame(frame), f"frame {frame + 1}")
        recognition, state = recogniser.step(state, sensed, viewpoint)
        right.append(recognition.log_probs.argmax(axis=1) == scenarios.labels)
    return np.stack(right, axis=1)
