"""Freed memory stays with the process: a large block is not mapped, and filled with zeros, again and again."""

import sys

import pytest
import torch

from recognition.freed_memory import keep_freed_memory

PAGE = 4096
BYTES = 200_000_000  # above what glibc keeps by itself


@pytest.mark.skipif(sys.platform != "linux", reason="a setting of glibc")
def test_a_large_block_that_was_freed_is_used_again() -> None:
    import resource

    keep_freed_memory()
    torch.zeros(BYTES // 4)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(4):
        torch.empty(BYTES // 4).fill_(1.0)
    faults = resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before
    assert faults < 2 * BYTES / PAGE  # four new mappings would be four times the pages; the first may be new
