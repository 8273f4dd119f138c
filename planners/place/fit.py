"""Fits `fixed-best`: tries a grid of places on the validation part, and keeps the best."""

import hashlib
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from ehar.arrays import BoolArray
from ehar.data.scenario import Scenarios, split_parts, windows
from ehar.data.streams.scenario import StreamScenarios
from ehar.errors import DataError, EharError, UsageError
from ehar.files import check_folder, json_text, read_json, write_text
from ehar.processes import Engine, Processes
from ehar.runner import Runner
from ehar.track import IDEAL
from planners.place.config import FixedBestConfig
from planners.place.go_to_place import GoToPlace, Place
from planners.place.people import trunk_of
from planners.place.storage import FIXED_BEST, fixed_place_path, load_fixed_place, save_fixed_place
from planners.value.situation import STREAM_WINDOW
from recognition.setting import Setting, load_setting, refuse_loss, refuse_told_onsets, with_length
from recognition.torch_threads import one_torch_thread

# Shares of the way from the nearest to the farthest distance. On the grid a way of 4 m costs most of an episode, so
# the camera may also keep its distance and make all of its moves around the people.
DISTANCES = (None, 0.3, 0.1)
POLARS = tuple(float(angle) for angle in np.radians([90, 75, 60]))
SIDES = tuple(float(angle) for angle in np.radians([0, 45, 90, 135, 180]))  # from the front, to either side
AROUND = tuple(float(angle) for angle in np.radians(np.arange(0, 360, 45)))  # in the world, where no front is known
STARTS = 4  # start viewpoints of each window
MOST_WINDOWS = 128  # windows that are drawn from a longer validation part, to save time
EPISODES = 64  # episodes that run in lockstep


@dataclass(frozen=True)
class TriedPlace:
    """A place, and its accuracy on the validation part, mean over frames and episodes."""

    place: Place
    accuracy: float


@dataclass(frozen=True)
class FixedPlaceFit:
    """The result of a fit.

    Args:
        path: path of the file.
        tried: all places that were tried, the best one first.
        part: the part of the data that they were tried on.
    """

    path: Path
    tried: tuple[TriedPlace, ...]
    part: str


@dataclass(frozen=True, eq=False)
class PlaceTask:
    """Everything needed to try places.

    Args:
        runner: runs the episodes.
        scenarios: the windows of the validation part.
        places: the places to try.
        seed: seed of start viewpoints and noise, which are the same for all places.
    """

    runner: Runner
    scenarios: Scenarios | StreamScenarios
    places: tuple[Place, ...]
    seed: int


def candidate_places(*, tells_front: bool) -> tuple[Place, ...]:
    """Return the places to try, those that need no turn first.

    Args:
        tells_front: whether the skeleton tells left from right. If not, azimuths are counted in the world: people in a
            set may all face one way.
    """
    azimuths = (None, *(SIDES if tells_front else AROUND))
    return tuple(
        Place(distance, azimuth, polar, absolute=azimuth is not None and not tells_front)
        for azimuth, distance, polar in product(azimuths, DISTANCES, POLARS)
    )


def best_first(places: tuple[Place, ...], accuracy: dict[int, float]) -> tuple[TriedPlace, ...]:
    """Return places by falling accuracy; of two that are equally good, the one that was listed first."""
    ranked = sorted(range(len(places)), key=lambda index: (-accuracy[index], index))
    return tuple(TriedPlace(places[index], accuracy[index]) for index in ranked)


def fit_fixed_best(
    config: FixedBestConfig,
    report: Callable[[str, int, int], None],
    note: Callable[[str], None] = lambda line: None,
    engine: Engine | None = None,
) -> FixedPlaceFit:
    """Fit and save; places that a stopped run has tried are not tried again.

    Args:
        config: the settings of the fit.
        report: called with progress: the name of the task, the amount done, and the total.
        note: called with a line if the recogniser was trained at another length, or with another localisation.
        engine: runs the trials; None means worker processes, as many as `config` says.

    Raises:
        EharError: data or recogniser are missing or do not fit, or a number is too small.
    """
    conditions = config.conditions
    if conditions.track != IDEAL:
        raise UsageError(
            f"train fixed-best: expected the track {IDEAL!r}, one place is for all; got {conditions.track}"
        )
    if config.workers < 1:
        raise UsageError(f"workers: expected at least 1, got {config.workers}")
    refuse_told_onsets(conditions)
    directory = config.out or conditions.directory
    if directory is None:
        raise UsageError("train fixed-best: expected --models DIR, or --out DIR where the shipped recogniser is used")
    check_folder(directory)
    setting = load_setting(conditions, device=config.device)
    for line in setting.notes:
        note(f"warning: {line}")
    path = fixed_place_path(directory, conditions)
    refuse_loss(path, setting, load_fixed_place)
    part, scenarios = validation_windows(setting, with_length(conditions, setting.recordings, STREAM_WINDOW).frames)
    places = candidate_places(tells_front=len(trunk_of(setting.recordings.skeleton)) > 0)
    task = PlaceTask(setting.runner, scenarios, places, conditions.seed)
    told = setting.conditions
    history: dict[str, Any] = {
        **{name: getattr(told, name) for name in ("data", "models")},
        "out": None if config.out is None else str(config.out),
        **{name: getattr(told, name) for name in ("sensor", "views")},
        "length": scenarios.length,
        **{name: getattr(told, name) for name in ("fps", "seed")},
        "data_sha256": setting.recordings.sha256,
        "part": part,
        "windows": len(scenarios),
        "starts": STARTS,
    }
    own = {"recogniser": told.recogniser, "sensor_sha256": setting.sensor_sha256}
    history |= {name: value for name, value in own.items() if value is not None}
    decisive = {name: value for name, value in history.items() if name not in ("data", "models", "out")}
    decisive["world"] = setting.world.to_json()
    key = json_text([decisive, setting.recogniser_sha256, [asdict(place) for place in places]])
    kept = path.with_name(f"{path.stem}-tried-{hashlib.sha256(key.encode()).hexdigest()[:8]}.json")
    tried = best_first(places, _try_all(task, engine or Processes(config.workers), kept, report))
    history["tried"] = [asdict(one) for one in tried]
    save_fixed_place(
        path, tried[0].place, recogniser_sha256=setting.recogniser_sha256, history=history, world=setting.world
    )
    kept.unlink(missing_ok=True)
    return FixedPlaceFit(path, tried, part)


def validation_windows(setting: Setting, length: int) -> tuple[str, Scenarios | StreamScenarios]:
    """Return the part that places are tried on, and its windows of so many frames, which do not overlap.

    It is the validation part. If none of its sequences is long enough, it is the policy part, which the recogniser has
    not learned from either. The test part is never looked at.

    Raises:
        DataError: no sequence of these parts is long enough.
    """
    data, conditions = setting.recordings, setting.conditions
    parts = split_parts(data)
    for part in ("validation", "policy"):
        found = windows(data, getattr(parts, part), length, stride=length)
        if len(found):
            break
    else:
        raise DataError(
            f"{data.name}: expected validation sequences of at least {length} frames to try places on, got none"
        )
    if len(found) > MOST_WINDOWS:
        rng = np.random.default_rng(conditions.seed)
        chosen = np.sort(rng.choice(len(found), MOST_WINDOWS, replace=False))
        found = replace(found, sequence=found.sequence[chosen], first=found.first[chosen])
    return part, found


@one_torch_thread()
def accuracy_at(task: PlaceTask, index: int) -> float:
    """Return the accuracy of one place, mean over frames and episodes; it depends only on the seed and the place.

    Of streams, frames that show no activity do not count.
    """
    rng = np.random.default_rng(task.seed)
    scenario = np.tile(np.arange(len(task.scenarios)), STARTS)
    starts = task.runner.world.sample_starts(rng, len(scenario))
    planner = GoToPlace(name=FIXED_BEST, place=task.places[index])
    correct: list[BoolArray] = []
    for first in range(0, len(scenario), EPISODES):
        some = slice(first, first + EPISODES)
        batch = task.runner.batch(task.scenarios, scenario[some], starts[some], rng)
        record = task.runner.roll(planner, batch, np.random.default_rng(task.seed))
        right = record.log_probs.argmax(axis=-1) == batch.frame_labels
        correct.append(right[batch.frame_labels < len(task.scenarios.data.class_names)])
    return float(np.concatenate(correct).mean())


def _try_all(task: PlaceTask, engine: Engine, kept: Path, report: Callable[[str, int, int], None]) -> dict[int, float]:
    """Return the accuracy of each place by its index; each is kept in a file, and a resumed run reads it there."""
    accuracy = _read(kept, len(task.places))
    report("places", len(accuracy), len(task.places))
    missing = [index for index in range(len(task.places)) if index not in accuracy]
    for index, found in engine.each_batch(accuracy_at, task, missing):
        accuracy[index] = found
        write_text(kept, [json_text({str(place): value for place, value in accuracy.items()})])
        report("places", len(accuracy), len(task.places))
    return accuracy


def _read(path: Path, places: int) -> dict[int, float]:
    """Return the accuracies that a stopped run kept; none if the file is missing or not whole."""
    try:
        held = read_json(path, dict[str, float], "accuracies of places")
    except EharError:
        return {}
    return {index: held[str(index)] for index in range(places) if str(index) in held}
