"""Nothing that is trained knows the test part: other motion and other labels there leave all that is learned as it is.

Recogniser, temperatures, gain field, belief, fixed place and agents are trained twice, on data that differ in one part.
"""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import load_file

from ehar.conditions import Conditions
from ehar.data.motion_data import MotionData
from ehar.data.motion_file import save_motion
from ehar.data.scenario import TEST
from ehar.data.streams.data import StreamData
from ehar.data.streams.file import save_streams
from planners.agents.training import train_agents
from planners.place.config import FixedBestConfig
from planners.place.fit import fit_fixed_best
from planners.value.config import GainTrainingConfig
from planners.value.training import train_gain_field
from recognition.training.config import TrainingConfig
from recognition.training.trainer import train_recogniser
from tests.helpers.agent_trainings import TinyTraining, silent
from tests.helpers.fakes import tiny_data
from tests.helpers.other_people import with_others
from tests.helpers.small_trainings import searching, small_trainings
from tests.helpers.streams import raising_streams

LENGTH = 10
KINDS = {"agent", "causal", "fixed", "gain"}  # of files
ABOUT = ("sha256", "seconds", "out", "data", "models")  # files and the machine, not people


def clips() -> MotionData:
    """Return clips of twelve people, of whom three are tested."""
    people = np.arange(72) // 6
    return replace(tiny_data(sequences=72), subjects=people[:, None], is_test=people >= 9)


def learned(folder: Path, data: MotionData | StreamData) -> dict[str, Any]:
    """Train all that can be trained; return by file what was learned, and what is told of it."""
    folder.mkdir()
    path, models = folder / "people.npz", folder / "models"
    if isinstance(data, StreamData):
        save_streams(path, data)
    else:
        save_motion(path, data)
    told = Conditions(data=str(path), models=models, length=LENGTH)
    with small_trainings():
        train_recogniser(TrainingConfig(conditions=told, out=models, clips=320, batch=16, interval=160, threads=1))
        train_gain_field(GainTrainingConfig(conditions=told, batches=1, workers=1), searching, silent)
        fit_fixed_best(FixedBestConfig(conditions=told, workers=1), silent)
        agents = TinyTraining(conditions=told, episodes=8, frames=112, workers=1, stages="il,il-ppo")  # 2 rollouts
        train_agents(agents, silent, silent)
    found: dict[str, Any] = {}
    for file in sorted(models.iterdir()):
        if file.suffix == ".safetensors":
            found[file.name] = {name: array.tobytes() for name, array in load_file(file).items()}
        elif file.suffix == ".json":
            found[file.name] = of_people(json.loads(file.read_text()))
    return found


def of_people(told: Any) -> Any:
    """Return what a description tells of people, without hashes and places of files, and without times."""
    if isinstance(told, dict):
        return {key: of_people(value) for key, value in told.items() if not any(one in key for one in ABOUT)}
    return [of_people(one) for one in told] if isinstance(told, list) else told


@pytest.mark.parametrize("make", [clips, raising_streams])
def test_other_people_in_the_test_part_change_nothing_that_is_learned(
    make: Callable[[], MotionData | StreamData], tmp_path: Path
) -> None:
    data = make()
    usual = learned(tmp_path / "usual", data)
    assert {name.split("-")[0] for name in usual} == KINDS
    assert learned(tmp_path / "test", with_others(data, TEST)) == usual
    other = learned(tmp_path / "others", with_others(with_others(data, "policy"), "validation"))
    assert {name.split("-")[0] for name in usual if other[name] != usual[name]} == KINDS
