"""How gain fields are trained. Without torch, so that the command line can show it at once."""

from dataclasses import dataclass, field
from pathlib import Path

from ehar.cores import cores


@dataclass(frozen=True, kw_only=True)
class GainTrainingConfig:
    """How gain fields and belief are trained.

    Args:
        data: "duo", "solo", or an .npz file.
        models: directory of the recogniser, written to as well; without it, the recogniser that ships is used.
        out: directory to write to instead.
        sensor: "perfect" or "estimator".
        views: the recogniser's, "moving" or "paper".
        length: L, frames of an episode.
        fps: resample the motion first; None keeps its rate.
        batches: of 32 episodes with 3 forks of 8 paths each.
        seed: of episodes, forks and noise.
        workers: processes; the result is the same with any number.
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
