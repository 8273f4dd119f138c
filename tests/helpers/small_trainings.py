"""Trainings of recognisers and planners that take seconds: next to nothing of everything."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from ehar.planner import Planner
from planners.agents import demonstrations, validation
from planners.agents import training as agent_training
from planners.place import fit as places
from planners.search.view_search import NextBestViewSearch
from planners.value import collection
from planners.value import fit as fields
from planners.value import training as gain_training
from planners.value.belief import streams_fit
from planners.value.model import GainModel
from recognition.training import material


@contextmanager
def small_trainings() -> Iterator[None]:
    """Let recognisers and planners be trained on next to nothing."""
    with pytest.MonkeyPatch.context() as patch:
        for module, name, value in (
            (material, "VALIDATION_CLIPS", 24),
            (collection, "EPISODES", 6),
            (fields, "PENALTIES", (1.0,)),
            (fields, "CONSTANT_SHARES", (0.1,)),
            (fields, "EMBEDDING_DIRECTIONS", 2),
            (fields, "FOLDS", 2),
            (gain_training, "UNSEEN_BATCHES", 1),
            (streams_fit, "STEPS", 2),
            (places, "POLARS", (1.0,)),
            (places, "SIDES", (0.0, 1.0)),
            (places, "STARTS", 1),
            (demonstrations, "EPISODES", 4),
            (agent_training, "EPISODES", 4),
            (validation, "EPISODES", 4),
        ):
            patch.setattr(module, name, value)
        yield


def searching(model: GainModel) -> Planner:
    """Return a planner of the second round of a gain field's training."""
    return NextBestViewSearch(model=model)
