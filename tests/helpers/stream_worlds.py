"""Streams on disk, and a recogniser that learned on them for a moment."""

from pathlib import Path

import pytest

from ehar.conditions import Conditions
from ehar.data.streams.file import save_streams
from recognition.training import material
from recognition.training.config import TrainingConfig
from recognition.training.trainer import train_recogniser
from tests.helpers.streams import raising_streams


def save_stream_world(folder: Path) -> Path:
    """Write raising.npz, and models for it; return the folder."""
    save_streams(folder / "raising.npz", raising_streams())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(material, "VALIDATION_CLIPS", 24)
        conditions = Conditions(data=str(folder / "raising.npz"), length=40)
        train_recogniser(
            TrainingConfig(conditions=conditions, out=folder / "models", clips=480, batch=16, interval=160, threads=1)
        )
    return folder
