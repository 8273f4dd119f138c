"""The cameras of a recogniser's training: the paper's static grid, or moving cameras."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.conditions import REGIMES
from ehar.errors import UsageError
from ehar.viewpoint import MOVES, Workspace, apply_moves, sample_starts

# Sec. 4.2: "a uniform grid of 32 nodes spanning P_0". The paper does not say which 32: the middles of 2 x 8 x 2 cells.
PAPER_DISTANCES = (7.5, 12.5)  # [m]
PAPER_AZIMUTHS = 8
PAPER_POLARS = (np.pi / 8, 3 * np.pi / 8)  # [rad]

STATIC_SHARE = 0.5  # share of clips with a static camera in the moving regime
TURN_PROBABILITY = 0.1  # probability that a moving camera picks another move at a frame


def paper_viewpoints() -> FloatArray:
    """Return the 32 static training viewpoints (32, 3) of the paper's regime."""
    azimuths = (np.arange(PAPER_AZIMUTHS) + 0.5) * 2 * np.pi / PAPER_AZIMUTHS
    grid = np.meshgrid(PAPER_DISTANCES, azimuths, PAPER_POLARS, indexing="ij")
    return np.stack(grid, axis=-1).reshape(-1, 3)


def training_viewpoints(regime: str, rng: np.random.Generator, clips: int, length: int) -> FloatArray:
    """Draw the cameras of training clips.

    Args:
        regime: "paper" takes each clip from one of the 32 viewpoints; "moving" takes half of the clips from a random
            start viewpoint, and half from a camera that makes random grid moves, each for 10 frames on average.
        rng: the generator.
        clips: number B of clips.
        length: number L of frames.

    Returns:
        viewpoints (B, L, 3).

    Raises:
        UsageError: the regime is unknown.
    """
    if regime == "paper":
        grid = paper_viewpoints()
        chosen = grid[rng.integers(len(grid), size=clips)]
        return np.repeat(chosen[:, None], length, axis=1)
    if regime != "moving":
        raise UsageError(f"unknown --views {regime!r}: expected one of {', '.join(REGIMES)}")
    workspace = Workspace()
    viewpoints = np.empty((clips, length, 3))
    viewpoints[:, 0] = sample_starts(rng, clips)
    moving = rng.random(clips) >= STATIC_SHARE
    hover = len(MOVES) - 1
    moves = rng.integers(hover, size=clips)
    for frame in range(1, length):
        moves = np.where(rng.random(clips) < TURN_PROBABILITY, rng.integers(hover, size=clips), moves)
        viewpoints[:, frame] = apply_moves(viewpoints[:, frame - 1], np.where(moving, moves, hover), workspace)
    return viewpoints
