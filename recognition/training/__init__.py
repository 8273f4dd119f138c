"""Training of a recogniser: clips, cameras, the training loop and its checkpoints."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from recognition.training.checkpoints import Checkpoint as Checkpoint
    from recognition.training.clips import ClipSource as ClipSource
    from recognition.training.config import TrainingConfig as TrainingConfig
    from recognition.training.trainer import train_recogniser as train_recogniser
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "TrainingConfig": "recognition.training.config",
            "train_recogniser": "recognition.training.trainer",
            "ClipSource": "recognition.training.clips",
            "Checkpoint": "recognition.training.checkpoints",
        },
    )
