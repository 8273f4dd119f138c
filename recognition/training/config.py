"""How a recogniser is trained. Without torch, so that the command line can show it at once."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ehar.conditions import Form

Size = Literal["small", "published"]


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """How a recogniser is trained.

    Args:
        data: duo, solo, or a prepared .npz.
        out: folder to write to.
        sensor: perfect (exact joints) or estimator (noisy joints).
        views: cameras to train on: moving, or paper (32 static ones).
        form: causal streams; ctrgcn, as published, is trained on prefixes of random length.
        size: small, for 2 CPU cores, or the published widths.
        length: L, frames of a clip.
        fps: frame rate to resample to [Hz]; None keeps the data's.
        clips: training clips in all, each drawn anew.
        batch: clips a step.
        learning_rate: peak of the schedule (AdamW).
        weight_decay: of AdamW.
        evaluations: on validation scenarios, each with a checkpoint.
        patience: evaluations without a better validation NLL after which training stops.
        seed: of initial weights, clips and dropout.
        init: .safetensors of the same shape to start from, instead of random weights.
        device: of torch: cpu or cuda.
        threads: CPU threads of torch; 0 leaves it to torch.
    """

    data: str
    out: Path
    sensor: str = "perfect"
    views: str = "moving"
    form: Form = "causal"
    size: Size = "small"
    length: int = 60
    fps: float | None = None
    clips: int = 15_000
    batch: int = 32
    learning_rate: float = 3e-3
    weight_decay: float = 0.02
    evaluations: int = 20
    patience: int = 8
    seed: int = 0
    init: Path | None = None
    device: str = "cpu"
    threads: int = 0
