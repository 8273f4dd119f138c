"""The settings of a recogniser's training; there is no torch in this module, so the command line shows them at once."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ehar.conditions import Conditions
from recognition.networks.sizes import Size

Optimiser = Literal["adamw", "published"]
WINDOW = 4.0  # [s], the usual length of a training clip of streams
PUBLISHED_BATCH = 64  # clips of a step with the published optimiser


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """The settings of a recogniser's training.

    Args:
        conditions: conditions of the clips, and the form to train; the seed is for initial weights, clips and dropout.
        out: folder to write to.
        size: small, for 2 CPU cores; half of the published widths; or published.
        clips: the most training clips; each is drawn anew. With adamw, training stops before, when twice as many gain
            nothing.
        batch: number of clips in a step.
        optimiser: adamw, or published: SGD with the rates and decay of CTR-GCN.
        learning_rate: peak of the schedule (AdamW).
        weight_decay: weight decay of AdamW.
        interval: clips from one checkpoint to the next, and between the first evaluations on validation clips.
        folds: number of groups of people; each is left out of one more training, as long as the weights that are kept
            have learned, and asked about. So temperatures are fitted on more people than those of the validation part;
            with 0 on these alone.
        init: .safetensors file of the same shape to start from, instead of random weights.
        in_the_way: whether pillars, boxes and passers-by hide joints in half of the clips; the world is open.
        device: torch device, cpu or cuda.
        threads: number of CPU threads of torch; with 0, torch decides.
    """

    conditions: Conditions
    out: Path
    size: Size = "small"
    clips: int = 400_000
    batch: int = 32
    optimiser: Optimiser = "adamw"
    learning_rate: float = 3e-3
    weight_decay: float = 0.02
    interval: int = 2_500
    folds: int = 0
    init: Path | None = None
    in_the_way: bool = False
    device: str = "cpu"
    threads: int = 0
