"""Processes that others started, as /proc lists them."""

import time
from collections.abc import Collection
from pathlib import Path

import pytest

needs_proc = pytest.mark.skipif(not Path("/proc").is_dir(), reason="processes are looked up there")


def _stat(pid: int) -> list[str]:
    """Return what the system says of a process, from its state on; nothing if there is none."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return []


def runs(pid: int) -> bool:
    """Return whether a process still runs; one that nobody has waited for does not."""
    return _stat(pid)[:1] not in ([], ["Z"])


def descendants(pid: int) -> set[int]:
    """Return the processes that a process has started, and those that these have started."""
    parents = {int(path.name): _stat(int(path.name)) for path in Path("/proc").iterdir() if path.name.isdigit()}
    found, added = set[int](), {pid}
    while added:
        added = {one for one, stat in parents.items() if len(stat) > 1 and int(stat[1]) in added}
        found |= added
    return found


def still_running(pids: Collection[int], seconds: float = 10.0) -> list[int]:
    """Wait until processes have ended, and return those that have not."""
    end = time.monotonic() + seconds
    while (left := [pid for pid in pids if runs(pid)]) and time.monotonic() < end:
        time.sleep(0.05)
    return left
