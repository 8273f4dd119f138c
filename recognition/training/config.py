"""How a recogniser is trained. Without torch, so that the command line can show it at once."""

from dataclasses import dataclass
from pathlib import Path

from ehar.conditions import Conditions
from recognition.networks.sizes import Size


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """How a recogniser is trained.

    Args:
        conditions: of the clips, and the form that is trained; its seed is that of initial weights, clips and dropout.
        out: folder to write to.
        size: small, for 2 CPU cores, or the published widths.
        clips: training clips in all, each drawn anew.
        batch: clips a step.
        learning_rate: peak of the schedule (AdamW).
        weight_decay: of AdamW.
        evaluations: on validation scenarios, each with a checkpoint.
        patience: evaluations without a better validation NLL after which training stops.
        init: .safetensors of the same shape to start from, instead of random weights.
        device: of torch: cpu or cuda.
        threads: CPU threads of torch; 0 leaves it to torch.
    """

    conditions: Conditions
    out: Path
    size: Size = "small"
    clips: int = 15_000
    batch: int = 32
    learning_rate: float = 3e-3
    weight_decay: float = 0.02
    evaluations: int = 20
    patience: int = 8
    init: Path | None = None
    device: str = "cpu"
    threads: int = 0
