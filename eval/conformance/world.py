"""The small world of the conformance kits: a few episodes, and a sensor that replays what was seen in them."""

from dataclasses import dataclass, field

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.batch import Batch
from ehar.camera import Camera
from ehar.data.motion_data import MotionData
from ehar.data.scenario import TEST, part_of
from ehar.data.streams.data import StreamData
from ehar.errors import DataError
from ehar.sensors.sensor import Sensed, SensorNoise, draw_noise
from ehar.world import PAPER, World
from eval.running.episodes import cut_scenarios, random_starts

LENGTH = 20  # frames of an episode, L
EPISODES = 14  # 7 to check, and 7 others to run beside or instead of them
BATCH = 7  # episodes that run together


def small_batch(data: MotionData | StreamData, world: World = PAPER) -> Batch:
    """Return 14 test episodes of 20 frames at most, spread over the data, from random starts of a world.

    Raises:
        DataError: no test sequence is long enough.
    """
    longest = int(data.lengths[part_of(data, TEST)].max())
    scenarios = cut_scenarios(data, part_of(data, TEST), min(LENGTH, longest), lambda _: None)
    if scenarios.length < 3:
        raise DataError(f"{data.name}: expected a test sequence of at least 3 frames, the longest has {longest}")
    episodes = random_starts(scenarios, starts=-(-EPISODES // len(scenarios)), seed=0, world=world)
    spread = np.linspace(0, len(episodes) - 1, EPISODES).astype(np.int64)
    some = type(episodes)(scenarios, episodes.scenario[spread], episodes.starts[spread], seed=0, world=world)
    return some.batch(0)


def other_future(positions: FloatArray, noise: SensorNoise, frames: int) -> tuple[FloatArray, SensorNoise]:
    """Return joints (B, T, P, J, 3) and draws with the same first frames; then other people do something else.

    Args:
        positions: the joints.
        noise: the draws (B, T, ...).
        frames: number of frames that stay.
    """
    joints = positions.copy()
    joints[:, frames:] = 1 - 2 * joints[::-1, frames:]
    later = draw_noise(np.random.default_rng(1), joints.shape[:2], *joints.shape[2:4])
    pairs = zip(noise, later, strict=True)
    return joints, SensorNoise(*(np.concatenate([one[:, :frames], two[:, frames:]], axis=1) for one, two in pairs))


@dataclass
class ReplayedSensor:
    """Returns, frame by frame, what was seen before, whatever the camera looks at now.

    Args:
        seen: joints of each frame.
        camera: the camera that saw them.
        name: name of the sensor.
    """

    seen: list[Sensed]
    camera: Camera
    name: str = "replayed"
    frame: int = field(default=-1, init=False)

    def sense(
        self, positions: FloatArray, viewpoint: FloatArray, noise: SensorNoise, hidden: BoolArray | None = None
    ) -> Sensed:
        """Return the joints of the next frame."""
        self.frame += 1
        return self.seen[self.frame]
