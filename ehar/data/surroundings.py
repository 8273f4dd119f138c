"""What stands and walks around the people of some scenarios in a world."""

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.data.scenario import Scenarios
from ehar.data.streams.scenario import StreamScenarios
from ehar.obstacles.passers import Bodies, Passers
from ehar.obstacles.surroundings import Surroundings
from ehar.world import PASSER_ROOM, World

WALKING = (1.0, 1.6)  # [m/s], from the slowest to the fastest passer-by
BERTH = 2.5  # [m], between cameras and passers-by whom they may meet, in the first frame
NEAREST = (0.7, 2.0)  # [m], between the people's centre and the nearest point of a passer-by's way
TRACKED = (0.05, 0.1)  # [m], [m/s], standard deviation of what planners are told on each axis, in each frame anew


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
    passers = None
    if world.passers_by:
        risen = np.zeros((len(chosen), scenarios.length)) if moved is None else moved[..., 2]
        passers = _passers(scenarios, chosen, world, risen, rng.spawn(1)[0])
    return Surroundings(world.obstacles, moved, passers)


def _passers(
    scenarios: Scenarios | StreamScenarios, chosen: IntArray, world: World, risen: FloatArray, rng: np.random.Generator
) -> Passers:
    """Draw the passers-by of B scenarios: people of other sequences of the same part, and straight ways past people.

    A way is a chord of the circle within which they walk. It is walked at one speed, from one end to the other and
    back. Where it begins is drawn, so at any time a passer-by is as likely here as there. Those whom cameras may meet
    begin near people, so that no camera begins in their way. They stay on the floor on which people stand in the first
    frame, though the centre, which places are relative to, follows people up and down.

    Args:
        scenarios: the scenarios.
        chosen: (B,) which of them.
        world: the world that the passers-by are in.
        risen: (B, L) how far the centre has risen since the first frame [m].
        rng: what is drawn with.
    """
    shape = (len(chosen), world.passers_by)
    reach, time = world.passing_reach, np.arange(scenarios.length) / scenarios.data.fps
    aside = rng.uniform(NEAREST[0], min(NEAREST[1], reach / 2), shape) * rng.choice([-1, 1], shape)
    half = np.sqrt(reach**2 - aside**2)
    direction = rng.uniform(0, 2 * np.pi, shape)
    gone = rng.uniform(0, 1, shape) * 4 * half
    if world.meets_passers:
        gone = _from_near(gone, half, aside, world)
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

    skeleton = scenarios.data.skeleton
    joints = scenarios.data.positions[:, 0]
    joints.flags.writeable = False  # of this view: all batches share the recording
    bodies = Bodies(joints, skeleton.bone_indices, skeleton.bone_radii())
    posture, lowest = _postures(scenarios, _others(scenarios, chosen, shape, rng), rng)
    facing = skeleton.heading(bodies.joints[posture[:, 0]])
    turn = np.arctan2(velocity[..., 1], velocity[..., 0]) - facing[:, None]
    lift = (_floor(scenarios, chosen, risen)[:, None] - lowest)[:, None] - risen[..., None]
    told = {"mistakable": world.identity == "tracked", "met": world.meets_passers}
    return Passers(place, posture, turn, lift, tracked, bodies, **told)


def _from_near(gone: FloatArray, half: FloatArray, aside: FloatArray, world: World) -> FloatArray:
    """Return how far passers-by have gone who begin farther than `BERTH` from where cameras may be, if they can.

    Args:
        gone: (B, W) how far they would have gone of their way and back [m].
        half: (B, W) half of each way's length [m].
        aside: (B, W) how far people's centre is from each way [m].
        world: the world.
    """
    near = np.sqrt(np.maximum((world.workspace.distance_min - PASSER_ROOM - BERTH) ** 2 - aside**2, 0))
    back = gone >= 2 * half
    along = ((gone % (2 * half)) / half - 1) * near
    nearer: FloatArray = np.where(back, 3 * half + along, half - along)
    return nearer


def _others(
    scenarios: Scenarios | StreamScenarios, chosen: IntArray, shape: tuple[int, int], rng: np.random.Generator
) -> IntArray:
    """Draw other sequences of the same part for each scenario, (B, W); where there is one sequence, it is its own."""
    sequences = np.unique(scenarios.sequence)
    own = np.searchsorted(sequences, scenarios.sequence[chosen])
    drawn: IntArray = sequences[(own[:, None] + rng.integers(1, max(len(sequences), 2), shape)) % len(sequences)]
    return drawn


def _postures(
    scenarios: Scenarios | StreamScenarios, sequence: IntArray, rng: np.random.Generator
) -> tuple[IntArray, FloatArray]:
    """Return the frames that passers-by show, (B, L, W), and the lowest height of each one's sequence, (B, W) [m].

    A sequence is played from a frame that is drawn, to its end, back to its beginning, and so on.
    """
    data = scenarios.data
    begin, length = data.offsets[sequence], data.lengths[sequence]
    shown = rng.integers(length)[:, None] + np.arange(scenarios.length)[:, None]
    period = np.maximum(2 * (length - 1), 1)[:, None]
    posture = begin[:, None] + np.minimum(shown % period, period - shown % period) * (length > 1)[:, None]
    lowest = np.empty(sequence.shape)
    for one in np.unique(sequence):
        frames = slice(data.offsets[one], data.offsets[one + 1])
        lowest[sequence == one] = data.positions[frames, 0, :, 2].min()
    return posture, lowest


def _floor(scenarios: Scenarios | StreamScenarios, chosen: IntArray, risen: FloatArray) -> FloatArray:
    """Return the height of the feet of those that are watched, (B,) [m], in the first frame in which they are seen.

    It is relative to the centre in the first frame. Positions are relative to where cameras look, which a vehicle's
    centre only follows.
    """
    heights = scenarios.positions(chosen)[..., 2].min(axis=(2, 3)) + risen  # NaN in frames that are missing
    gaze = scenarios.gaze(chosen) if isinstance(scenarios, StreamScenarios) else None
    heights += 0.0 if gaze is None else gaze[..., 2]
    floor: FloatArray = np.nan_to_num(heights[np.arange(len(chosen)), np.isfinite(heights).argmax(axis=1)])
    return floor
