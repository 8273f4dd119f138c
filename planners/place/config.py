"""The settings of `fixed-best`'s fit; there is no torch in this module, so the command line shows them at once."""

from dataclasses import dataclass, field
from pathlib import Path

from ehar.conditions import Conditions
from ehar.processes import cores


@dataclass(frozen=True, kw_only=True)
class FixedBestConfig:
    """The settings of the fit of `fixed-best`.

    Args:
        conditions: conditions of the episodes, and the recogniser; the seed is for start viewpoints and noise.
        out: folder to write to.
        workers: number of processes; results do not depend on it.
        device: cpu or cuda, for our recogniser.
    """

    conditions: Conditions
    out: Path | None = None
    workers: int = field(default_factory=cores)
    device: str = "cpu"
