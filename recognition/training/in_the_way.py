"""What is in the way in training clips: pillars, boxes and passers-by, drawn anew for a few clips at a time."""

from dataclasses import replace

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.data.scenario import Scenarios
from ehar.data.streams.scenario import StreamScenarios
from ehar.data.surroundings import surroundings_of
from ehar.errors import UsageError
from ehar.obstacles.passers import FLOOR
from ehar.obstacles.shapes import MARGIN, Box, Cylinder, Obstacles
from ehar.world import LEAST_REACH, PASSER_ROOM, World

SHARE = 0.5  # of the clips; the others show that nothing is hidden in the open
TOGETHER = 8  # clips that see the same things, from places of their own

NEAREST = 0.8  # [m], from the people's centre to the middle of a thing
CEILING = 6.5  # [m] above the floor: level cameras do not look over a pillar
MOST_PILLARS, RADIUS = 3, (0.1, 0.6)  # [m]
MOST_BOXES, WIDTH, HEIGHT = 2, (0.4, 2.0), (0.5, 2.0)  # [m]
MOST_PASSERS = 4


def check_room(world: World) -> None:
    """Raise UsageError if a world has things of its own, or no room for any between people and cameras."""
    if not world.is_open:
        raise UsageError(f"--in-the-way: expected an open world, {world.name} has obstacles or passers-by of its own")
    if not world.has_passing_room:
        raise UsageError(
            f"--in-the-way: expected a world with distance_min of at least {LEAST_REACH + PASSER_ROOM:g} m, as things "
            f"stand between people and cameras; {world.name} has {world.workspace.distance_min:g} m"
        )


def draw_world(world: World, rng: np.random.Generator) -> World:
    """Return an open world with 1 to 3 pillars, 0 to 2 boxes and 0 to 4 passers-by between people and cameras."""
    pillars = int(rng.integers(1, MOST_PILLARS + 1))
    boxes, passers = (int(rng.integers(most + 1)) for most in (MOST_BOXES, MOST_PASSERS))
    obstacles = Obstacles(
        boxes=tuple(_draw_box(world, rng) for _ in range(boxes)),
        cylinders=tuple(_draw_pillar(world, rng) for _ in range(pillars)),
    )
    return replace(world, obstacles=obstacles, passers_by=passers)


def hide(
    scenarios: Scenarios | StreamScenarios,
    world: World,
    viewpoints: FloatArray,
    positions: FloatArray,
    rng: np.random.Generator,
) -> BoolArray:
    """Return which joints are hidden by what is drawn around half of the clips, (B, L, P, J).

    Args:
        scenarios: the motion of B clips.
        world: the open world that they are in.
        viewpoints: (B, L, 3) of the cameras.
        positions: (B, L, P, J, 3) [m], relative to where cameras look.
        rng: what is drawn with.
    """
    hidden = np.zeros(positions.shape[:-1], dtype=bool)
    chosen = np.flatnonzero(rng.random(len(positions)) < SHARE)
    for begin in range(0, len(chosen), TOGETHER):
        clips = chosen[begin : begin + TOGETHER]
        around = surroundings_of(scenarios, clips, draw_world(world, rng), rng)
        assert around is not None  # there is a pillar at least
        seen_from = viewpoints[clips]
        is_inside = around.clearance(seen_from, slice(None)) < 0  # of a thing, where no camera is in a world
        hidden[clips] = around.hide(seen_from, positions[clips], slice(None)) & ~is_inside[..., None, None]
    return hidden


def _draw_pillar(world: World, rng: np.random.Generator) -> Cylinder:
    radius = rng.uniform(*RADIUS)
    east, north = _draw_place(world, radius, rng)
    return Cylinder(centre=(east, north, FLOOR + CEILING / 2), radius=radius, height=CEILING)


def _draw_box(world: World, rng: np.random.Generator) -> Box:
    width, depth, height = rng.uniform(*WIDTH), rng.uniform(*WIDTH), rng.uniform(*HEIGHT)
    east, north = _draw_place(world, float(np.hypot(width, depth)) / 2, rng)
    turned = rng.uniform(0, 180)
    return Box(centre=(east, north, FLOOR + height / 2), size=(width, depth, height), yaw_deg=turned)


def _draw_place(world: World, reach: float, rng: np.random.Generator) -> tuple[float, float]:
    """Draw where a thing stands [m]: as a clip begins, nearer to people than level cameras that keep the margin."""
    distance = rng.uniform(NEAREST, world.workspace.distance_min - MARGIN - reach)
    angle = rng.uniform(0, 2 * np.pi)
    return float(distance * np.cos(angle)), float(distance * np.sin(angle))
