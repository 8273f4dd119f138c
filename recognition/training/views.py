"""The cameras of a recogniser's training: the paper's static grid, moving cameras, or those that recorded."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.errors import UsageError
from ehar.viewpoint import HOVER, Workspace, apply_moves, spherical
from ehar.world import World

# Sec. 4.2: "a uniform grid of 32 nodes spanning P_0". The paper does not say which 32: the middles of 2 x 8 x 2 cells.
QUARTERS = np.array([0.25, 0.75])  # of the ranges of distance and polar angle: 7.5 and 12.5 m, 22.5 and 67.5 degrees
PAPER_AZIMUTHS = 8

STATIC_SHARE = 0.5  # share of clips with a static camera in the moving regime
TURN_PROBABILITY = 0.1  # probability that a moving camera draws its move anew at a frame


def paper_viewpoints(workspace: Workspace) -> FloatArray:
    """Return the 32 static training viewpoints (32, 3) of the paper's regime."""
    distances = workspace.distance_min + QUARTERS * (workspace.distance_max - workspace.distance_min)
    polars = workspace.polar_min + QUARTERS * (workspace.polar_max - workspace.polar_min)
    azimuths = (np.arange(PAPER_AZIMUTHS) + 0.5) * 2 * np.pi / PAPER_AZIMUTHS
    grid = np.meshgrid(distances, azimuths, polars, indexing="ij")
    return np.stack(grid, axis=-1).reshape(-1, 3)


def recorded_viewpoints(centres: FloatArray, length: int) -> FloatArray:
    """Return where the cameras stood that recorded clips, (B, L, 3).

    Joints are in the recording camera's frame, so the camera is at its origin. Our camera looks at the people's centre;
    a real one looked along its own axis. That is a turn about the camera, which changes neither what hides what nor
    the rays to the joints.

    Args:
        centres: (B, 3) the people's centre in each clip's first frame, in the camera's frame [m].
        length: number L of frames.
    """
    return np.repeat(spherical(-centres.astype(np.float64))[:, None], length, axis=1)


def training_viewpoints(regime: str, world: World, rng: np.random.Generator, clips: int, length: int) -> FloatArray:
    """Draw the cameras of training clips that are simulated.

    Args:
        regime: "paper" takes each clip from one of the 32 viewpoints, of those that are free; "moving" takes half of
            the clips from a random start viewpoint, and half from a camera that makes random grid moves, drawn anew
            every 10 frames on average.
        world: the world that cameras are in.
        rng: the generator.
        clips: number B of clips.
        length: number L of frames.

    Returns:
        viewpoints (B, L, 3).

    Raises:
        UsageError: the regime is unknown, or none of the 32 viewpoints is free.
    """
    if regime == "paper":
        grid, space = paper_viewpoints(world.workspace), world.free_space
        grid = grid if space is None else grid[space.is_free(grid)]
        if not len(grid):
            raise UsageError(
                f"--views paper: expected one of its 32 viewpoints clear of obstacles in {world.name}, got none"
            )
        chosen = grid[rng.integers(len(grid), size=clips)]
        return np.repeat(chosen[:, None], length, axis=1)
    if regime != "moving":
        raise UsageError(f"unknown --views {regime!r}: expected moving or paper")
    viewpoints = np.empty((clips, length, 3))
    viewpoints[:, 0] = world.sample_starts(rng, clips)
    moving, space = rng.random(clips) >= STATIC_SHARE, world.free_space
    moves = rng.integers(HOVER, size=clips)
    for frame in range(1, length):
        moves = np.where(rng.random(clips) < TURN_PROBABILITY, rng.integers(HOVER, size=clips), moves)
        made = np.where(moving, moves, HOVER)
        before = viewpoints[:, frame - 1]
        viewpoints[:, frame] = (
            apply_moves(before, made, world.workspace) if space is None else space.after(before, made)
        )
    return viewpoints
