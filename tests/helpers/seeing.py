import numpy as np

from ehar.arrays import FloatArray
from ehar.planner import Context, Observation, Planner
from ehar.viewpoint import AZIMUTH


class Seeing(Planner):
    """Turns the way that it drew at the beginning; its state is what it sees and the frame."""

    name = "seeing"

    def __init__(self, step: float = 0.1) -> None:
        self.step = step

    def reset(self, context: Context) -> None:
        self._way = context.rng.choice([-self.step, self.step], size=context.episodes)
        self.state: FloatArray = np.empty((context.episodes, 0))

    def act(self, observation: Observation) -> FloatArray:
        frame = np.full((len(observation.viewpoint), 1), observation.frame)
        self.state = np.hstack([observation.log_probs, observation.viewpoint, frame])
        target = observation.viewpoint.copy()
        target[:, AZIMUTH] += self._way
        return target
