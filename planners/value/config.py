"""How gain fields are trained. Without torch, so that the command line can show it at once."""

from dataclasses import dataclass, field
from pathlib import Path

from ehar.conditions import Conditions
from ehar.processes import cores


@dataclass(frozen=True, kw_only=True)
class GainTrainingConfig:
    """How gain fields and belief are trained.

    Args:
        conditions: of the episodes, and the recogniser; its seed is that of episodes, forks and noise.
        out: folder to write to.
        batches: of 32 episodes with 3 forks of 8 paths each.
        workers: processes; numbers do not depend on it.
    """

    conditions: Conditions
    out: Path | None = None
    batches: int = 24
    workers: int = field(default_factory=cores)
