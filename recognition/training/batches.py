"""The batches of a training: the seed and a step's number decide its clips, whoever draws them."""

from collections.abc import Generator
from typing import NamedTuple

import numpy as np

from ehar.processes import computed_ahead, cores
from recognition.training.clips import Clips, ClipSource

DRAWING = 3  # processes that draw clips for a GPU, and batches that each has ready


class Batch(NamedTuple):
    """The clips of a step, and the generator that drew them, for what else is random in it."""

    clips: Clips
    rng: np.random.Generator


class _Drawing(NamedTuple):
    """What the batches are drawn from."""

    source: ClipSource
    seed: int
    size: int


def draw_batches(source: ClipSource, *, seed: int, size: int, steps: range, device: str) -> Generator[Batch]:
    """Yield the batch of each step; for a GPU processes draw them ahead. Close it, if not all are asked for.

    Args:
        source: draws clips.
        seed: seed of the training.
        size: number of clips in a batch.
        steps: numbers of the steps.
        device: torch device of the training.

    Raises:
        UsageError: the source cannot be sent to processes, or none could start.
        ModelError: a process has ended by itself.
    """
    drawing = _Drawing(source, seed, size)
    if device == "cpu":
        yield from (_draw(drawing, step) for step in steps)
    else:
        yield from computed_ahead(_draw, drawing, steps, workers=min(DRAWING, cores()), ahead=DRAWING**2)


def _draw(drawing: _Drawing, step: int) -> Batch:
    """Draw the clips of a step."""
    rng = np.random.default_rng((drawing.seed, step))
    return Batch(drawing.source.draw(rng, drawing.size), rng)
