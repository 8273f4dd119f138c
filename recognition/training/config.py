"""The settings of a recogniser's training; there is no torch in this module, so the command line shows them at once."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ehar.conditions import Conditions
from recognition.networks.sizes import Size

Optimiser = Literal["adamw", "published"]
PUBLISHED_BATCH = 64  # clips of a step with the published optimiser


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """The settings of a recogniser's training.

    Args:
        conditions: conditions of the clips, and the form to train; the seed is for initial weights, clips and dropout.
        out: folder to write to.
        size: small; half of the published widths; or published.
        clips: number of training clips in all; each is drawn anew.
        batch: number of clips in a step.
        optimiser: adamw, or published: SGD with the rates and decay of CTR-GCN.
        learning_rate: peak of the schedule (AdamW).
        weight_decay: weight decay of AdamW.
        evaluations: number of evaluations on validation scenarios; each writes a checkpoint.
        patience: number of evaluations without a better validation NLL after which training stops.
        init: .safetensors file of the same shape to start from, instead of random weights.
        device: torch device, cpu or cuda.
        threads: number of CPU threads of torch; with 0, torch decides.
    """

    conditions: Conditions
    out: Path
    size: Size = "small"
    clips: int = 15_000
    batch: int = 32
    optimiser: Optimiser = "adamw"
    learning_rate: float = 3e-3
    weight_decay: float = 0.02
    evaluations: int = 20
    patience: int = 8
    init: Path | None = None
    device: str = "cpu"
    threads: int = 0
