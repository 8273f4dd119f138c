import pytest
import torch


@pytest.fixture(autouse=True, scope="session")
def one_thread() -> None:
    """Tests run side by side, and their tensors are too small to divide."""
    torch.set_num_threads(1)
