"""The settings of a recogniser's training; there is no torch in this module, so the command line shows them at once."""

from dataclasses import dataclass
from pathlib import Path

from ehar.conditions import Conditions
from recognition.networks.sizes import Size


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """The settings of a recogniser's training.

    Args:
        conditions: conditions of the clips, and the form to train; the seed is for initial weights, clips and dropout.
        out: folder to write to.
        size: small, for 2 CPU cores, or the published widths.
        clips: the most training clips; each is drawn anew. Training stops before, when twice as many gain nothing.
        batch: number of clips in a step.
        learning_rate: peak of the schedule (AdamW).
        weight_decay: weight decay of AdamW.
        interval: clips from one checkpoint to the next, and between the first evaluations on validation clips.
        init: .safetensors file of the same shape to start from, instead of random weights.
        device: torch device, cpu or cuda.
        threads: number of CPU threads of torch; with 0, torch decides.
    """

    conditions: Conditions
    out: Path
    size: Size = "small"
    clips: int = 400_000
    batch: int = 32
    learning_rate: float = 3e-3
    weight_decay: float = 0.02
    interval: int = 2_500
    init: Path | None = None
    device: str = "cpu"
    threads: int = 0
