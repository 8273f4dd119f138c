"""The settings of gain fields' training; there is no torch in this module, so the command line shows them at once."""

from dataclasses import dataclass, field
from pathlib import Path

from ehar.conditions import Conditions
from ehar.processes import cores


@dataclass(frozen=True, kw_only=True)
class GainTrainingConfig:
    """The settings for the training of gain fields and belief.

    Args:
        conditions: conditions of the episodes, and the recogniser; the seed is for episodes, forks and noise.
        out: folder to write to.
        batches: the most batches, each of 32 episodes with 3 forks of 8 paths. Rollouts stop before, when twice as
            many gain nothing.
        workers: number of processes; results do not depend on it.
        device: cpu or cuda, for our recogniser.
    """

    conditions: Conditions
    out: Path | None = None
    batches: int = 192
    workers: int = field(default_factory=cores)
    device: str = "cpu"
