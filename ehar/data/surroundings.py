"""What stands and walks around the people of some scenarios in a world."""

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.data.scenario import Scenarios
from ehar.data.streams.scenario import StreamScenarios
from ehar.obstacles.surroundings import Passers, Surroundings
from ehar.world import PASSER_RADIUS, World

WALKING = (1.0, 1.6)  # [m/s], from the slowest to the fastest passer-by
NEAREST = (0.7, 2.0)  # [m], between the people's centre and the nearest point of a passer-by's way
TRACKED = (0.05, 0.1)  # [m], [m/s], standard deviation of what planners are told on each axis, in each frame anew
LOOKED_AT = 8  # frames of a sequence by which the height of a person is told


def surroundings_of(
    scenarios: Scenarios | StreamScenarios, chosen: IntArray, world: World, rng: np.random.Generator
) -> Surroundings | None:
    """Return what stands and walks around the people of scenarios; None in an open world.

    Args:
        scenarios: the motions.
        chosen: (B,) index into `scenarios`.
        world: the world.
        rng: its child draws passers-by, and its own numbers stay what they are.
    """
    if world.is_open:
        return None
    moved = None
    if isinstance(scenarios, StreamScenarios):
        centres = scenarios.centres(chosen)
        moved = centres - centres[:, :1]
    passers = _passers(scenarios, chosen, world, rng.spawn(1)[0]) if world.passers_by else None
    return Surroundings(world.obstacles, moved, passers)


def _passers(
    scenarios: Scenarios | StreamScenarios, chosen: IntArray, world: World, rng: np.random.Generator
) -> Passers:
    """Draw the passers-by of B scenarios: how tall they are, and straight ways past people, to and fro.

    A way is a chord of the circle within which they walk. It is walked at one speed, from one end to the other and
    back. Where it begins is drawn, so at any time a passer-by is as likely here as there.
    """
    shape = (len(chosen), world.passers_by)
    reach, time = world.passing_reach, np.arange(scenarios.length) / scenarios.data.fps
    aside = rng.uniform(NEAREST[0], min(NEAREST[1], reach / 2), shape) * rng.choice([-1, 1], shape)
    half = np.sqrt(reach**2 - aside**2)
    direction = rng.uniform(0, 2 * np.pi, shape)
    gone = rng.uniform(0, 1, shape) * 4 * half
    pace = rng.uniform(*WALKING, shape)[:, None]
    gone, half = gone[:, None] + pace * time[:, None], half[:, None]  # (B, L, W), (B, 1, W)
    turned = gone % (4 * half) - 2 * half
    along, speed = np.abs(turned) - half, np.where(turned < 0, -pace, pace)
    east, north = np.cos(direction)[:, None], np.sin(direction)[:, None]
    aside = aside[:, None]
    place = np.stack([along * east - aside * north, along * north + aside * east], axis=-1)
    velocity = np.stack([speed * east, speed * north], axis=-1)
    error = rng.standard_normal((*place.shape[:-1], 4)) * np.repeat(TRACKED, 2)
    tracked = np.concatenate([place, velocity], axis=-1) + error
    heights = scenarios.positions(chosen)[..., 2].min(axis=(2, 3))  # NaN in frames that are missing
    floor = np.nan_to_num(heights[np.arange(len(chosen)), np.isfinite(heights).argmax(axis=1)])
    low = np.repeat(floor[:, None], world.passers_by, axis=1).astype(np.float64)
    return Passers(place, low, low + _heights(scenarios, chosen, shape, rng), PASSER_RADIUS, tracked)


def _heights(
    scenarios: Scenarios | StreamScenarios, chosen: IntArray, shape: tuple[int, int], rng: np.random.Generator
) -> FloatArray:
    """Return the heights of people of other sequences of the same part, (B, W) [m]; with one sequence, of its own."""
    sequences = np.unique(scenarios.sequence)
    own = np.searchsorted(sequences, scenarios.sequence[chosen])
    others = (own[:, None] + rng.integers(1, max(len(sequences), 2), shape)) % len(sequences)
    data = scenarios.data
    heights = np.empty(len(sequences))
    for index in np.unique(others):
        sequence = sequences[index]
        frames = np.linspace(data.offsets[sequence], data.offsets[sequence + 1] - 1, LOOKED_AT).astype(np.int64)
        heights[index] = np.ptp(data.positions[frames, 0, :, 2], axis=1).max()
    drawn: FloatArray = heights[others]
    return drawn
