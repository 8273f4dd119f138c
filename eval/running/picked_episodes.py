"""Some of a run's episodes as one batch, each with the start viewpoint and the noise that it has in the run."""

from collections.abc import Sequence

import numpy as np

from ehar.rollout import Batch
from ehar.sensors.sensor import SensorNoise
from eval.running.episodes import CHUNK, Episodes


def pick_episodes(episodes: Episodes, indices: Sequence[int]) -> Batch:
    """Return some episodes, in the order of their indices; at least one."""
    pieces = [_single(episodes, index) for index in indices]
    return Batch(
        positions=np.concatenate([piece.positions for piece in pieces]),
        labels=np.concatenate([piece.labels for piece in pieces]),
        starts=np.concatenate([piece.starts for piece in pieces]),
        noise=SensorNoise(*(np.concatenate(draws) for draws in zip(*(piece.noise for piece in pieces), strict=True))),
        names=tuple(name for piece in pieces for name in piece.names),
    )


def _single(episodes: Episodes, index: int) -> Batch:
    batch, place = episodes.batch(index // CHUNK), index % CHUNK
    only = slice(place, place + 1)
    return Batch(
        positions=batch.positions[only],
        labels=batch.labels[only],
        starts=batch.starts[only],
        noise=SensorNoise(*(draws[only] for draws in batch.noise)),
        names=batch.names[only],
    )
