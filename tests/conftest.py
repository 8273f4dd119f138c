from pathlib import Path

import pytest
import torch
from tiny_benchmarks import HashedRecogniser, save_models


@pytest.fixture(autouse=True, scope="session")
def one_thread() -> None:
    """Tests run side by side, and their tensors are too small to divide."""
    torch.set_num_threads(1)


@pytest.fixture
def fake_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every run load a fake recogniser."""
    monkeypatch.setattr("recognition.storage.load_recogniser", lambda *_, **__: HashedRecogniser())


@pytest.fixture
def models(tmp_path: Path) -> Path:
    """Return a folder with a gain model of the fake recogniser, that wants to look from level."""
    directory = tmp_path / "models"
    save_models(directory, recogniser_sha256="fake")
    return directory
