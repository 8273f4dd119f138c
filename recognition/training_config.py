"""How a recogniser is trained. Without torch, so that the command line can show it at once."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

Form = Literal["causal", "ctrgcn"]
Size = Literal["small", "published"]
FORMS: tuple[Form, ...] = get_args(Form)


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """How a recogniser is trained.

    Args:
        data: "duo", "solo", or an .npz file.
        out: models directory to write to.
        sensor: "perfect" or "estimator".
        views: "moving" or "paper".
        form: "causal" streams; "ctrgcn" is the published network, trained on prefixes of random length.
        size: "small" for 2 CPU cores, or the "published" widths.
        length: L, frames of a clip.
        fps: resample the motion first; None keeps its rate.
        clips: training clips in all, each drawn anew.
        batch: clips a step.
        learning_rate: peak of the schedule (AdamW).
        weight_decay: of AdamW.
        evaluations: how often validation is looked at, and a checkpoint kept.
        patience: evaluations without a better validation NLL after which training stops.
        seed: of initial weights, clips and dropout.
        init: weights of the same shape to start from, instead of random ones.
        device: a torch device.
        threads: of the CPU that torch uses; 0 leaves it to torch.
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
