import math
import multiprocessing
import sys
from collections.abc import Callable, Iterator
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import settings

from ehar.data.any_source import BUILT_IN_STREAMS
from ehar.data.recordings import Recordings
from ehar.data.source import BUILT_IN
from ehar.processes import THREADS
from planners.own_planner import entry_point_names
from tests.helpers.tiny_benchmarks import HashedRecogniser, save_models

# Tests try the same examples every time, so that they pass every time. `make fuzz` searches at random for others; what
# it finds is printed, is tried first in the next `make fuzz`, and belongs above its test as an `@example(...)`.
settings.register_profile("default", derandomize=True, deadline=None, database=None)
settings.register_profile("fuzz", max_examples=2000, deadline=None, print_blob=True)
settings.load_profile("default")

# Modules that workers of tests import: all that takes long.
PRELOADED = [
    "eval.running.benchmark",
    "planners.agents.training",
    "planners.value.training",
    "recognition.training.trainer",
]


@pytest.fixture(autouse=True, scope="session")
def one_thread() -> Iterator[None]:
    """Tests run side by side, and their tensors are too small to divide; so are those of the processes they start."""
    torch.set_num_threads(1)
    with pytest.MonkeyPatch.context() as patch:
        for name in THREADS:
            patch.setenv(name, "1")
        yield


@pytest.fixture(autouse=True, scope="session")
def workers_import_once() -> Iterator[None]:
    """Fork workers from a process that has imported what they need; spawned, each of a hundred would take 2 s for it.

    They are told all else as spawned ones are, and see as little of this process, but they have the environment of the
    first of them. `spawned_workers` are as users have them, and so are those of scripts that tests run.
    """
    forking = get_context("forkserver")
    forking.set_forkserver_preload(PRELOADED)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(multiprocessing, "get_context", lambda kind: forking if kind == "spawn" else get_context(kind))
        yield


@pytest.fixture
def spawned_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Spawn workers, each with the environment of its time."""
    monkeypatch.setattr(multiprocessing, "get_context", get_context)


@pytest.fixture(autouse=True, scope="session")
def nothing_in_the_cache() -> Iterator[None]:
    """However much tests plan, they leave no machine code in the cache of whoever runs them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("planners.search.solver.PATIENCE", math.inf)
        yield


@pytest.fixture(autouse=True, scope="session")
def built_in_data_are_made_once() -> Iterator[None]:
    """Each built-in set takes a second or two to make, and a hundred tests read one. None of them may write into it."""

    def once(make: Callable[[], Recordings]) -> Callable[[], Recordings]:
        @cache
        def made() -> Recordings:
            data = make()
            for array in vars(data).values():
                if isinstance(array, np.ndarray):
                    array.flags.writeable = False
            return data

        return made

    with pytest.MonkeyPatch.context() as patch:
        for sets in (BUILT_IN, BUILT_IN_STREAMS):
            for name, make in sets.items():
                patch.setitem(sets, name, once(make))
        yield


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


@pytest.fixture
def own_modules(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Forget afterwards what was imported from files of a test's own, and where from."""
    modules = set(sys.modules)
    monkeypatch.setattr(sys, "path", list(sys.path))
    entry_point_names.cache_clear()
    yield
    entry_point_names.cache_clear()
    for name in set(sys.modules) - modules:
        if name.startswith(("own_", "beside", "lab_")):
            del sys.modules[name]
