"""The device that a recogniser runs on: the CPU, or a GPU that torch finds."""

from ehar.errors import UsageError


def check_device(device: str) -> None:
    """Raise a UsageError unless torch can run on a device.

    Args:
        device: cpu, cuda, or cuda:1 for the second GPU.
    """
    if device == "cpu":
        return
    import torch  # here, as the command line waits for this file

    kind, _, number = device.partition(":")
    if kind != "cuda" or (number and not number.isdigit()) or device.endswith(":"):
        raise UsageError(f"--device {device}: expected cpu or cuda")
    found = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if int(number or 0) >= found:
        raise UsageError(f"--device {device}: expected a GPU that torch can use, torch finds {found or 'none'}")
