"""How gain fields are trained. Without torch, so that the command line can show it at once."""

from dataclasses import dataclass, field
from pathlib import Path

from ehar.processes import cores


@dataclass(frozen=True, kw_only=True)
class GainTrainingConfig:
    """How gain fields and belief are trained: without `models` for the recogniser that ships, with `out` to write to.

    Args:
        data: duo, solo, or a prepared .npz.
        models: folder of the recogniser, and to write to.
        out: folder to write to instead.
        sensor: perfect (exact joints) or estimator (noisy joints).
        views: cameras the recogniser was trained on: moving or paper.
        length: L, frames of an episode.
        fps: frame rate to resample to [Hz]; None keeps the data's.
        batches: of 32 episodes with 3 forks of 8 paths each.
        seed: of episodes, forks and noise.
        workers: processes; numbers do not depend on it.
    """

    data: str
    models: Path | None = None
    out: Path | None = None
    sensor: str = "perfect"
    views: str = "moving"
    length: int = 60
    fps: float | None = None
    batches: int = 24
    seed: int = 0
    workers: int = field(default_factory=cores)
