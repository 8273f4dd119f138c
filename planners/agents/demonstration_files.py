"""Demonstrations kept in a folder, batch by batch, so that a training that was stopped does not run them again."""

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load_file, save

from ehar.files import write_bytes
from planners.agents.demonstrations import Demonstrations, DemonstrationTask, demonstrate, join


def collect(
    task: Callable[[], DemonstrationTask],
    batches: int,
    folder: Path,
    *,
    workers: int,
    report: Callable[[str, int, int], None],
) -> Demonstrations:
    """Return the demonstrations of so many batches: those that lie in the folder, and those that are missing there.

    A file that was cut short, or is none of ours, counts as missing and is written anew.

    Args:
        task: returns what is demonstrated; called only if something is missing, as an agent that acts in it takes
            time to clone.
        batches: how many.
        folder: of this very task.
        workers: processes.
        report: hears of progress.
    """
    pieces = {batch: piece for batch in range(batches) if (piece := read_batch(folder / f"{batch}.safetensors"))}
    missing = [batch for batch in range(batches) if batch not in pieces]
    report(folder.name, len(pieces), batches)
    for batch, piece in demonstrate(task(), missing, workers=workers) if missing else ():
        pieces[batch] = piece
        tensors = {field.name: np.ascontiguousarray(getattr(piece, field.name)) for field in fields(Demonstrations)}
        write_bytes(folder / f"{batch}.safetensors", save(tensors))
        report(folder.name, len(pieces), batches)
    return join([pieces[batch] for batch in range(batches)])


def read_batch(path: Path) -> Demonstrations | None:
    """Return a batch that was kept; None if there is none, or it is not whole."""
    try:
        return Demonstrations(**load_file(path))
    except (OSError, SafetensorError, TypeError, ValueError):
        return None
