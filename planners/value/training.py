"""Trains gain fields and belief for one recogniser: branching rollouts on the policy part, then regressions."""

import hashlib
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load_file, save

from ehar.data.scenario import split_parts
from ehar.errors import DataError, ModelError, UsageError
from ehar.files import write_bytes
from ehar.world import PAPER
from planners.value.belief_fit import fit_belief
from planners.value.body_filter import trunk_pairs
from planners.value.collection import Collection, CollectionTask, join, run_batches
from planners.value.config import GainTrainingConfig
from planners.value.fit import VARIANTS, Fit, fit_field
from planners.value.model import GainModel, gain_model_path, load_gain_model, save_gain_model
from planners.value.view_basis import DistanceRange
from recognition.setting import Setting, load_setting

LEAST_LENGTH = 3  # frames of an episode: views along a path spread only if there are two to come


@dataclass(frozen=True)
class GainTraining:
    """The result of a training: the path of the weights, and the fields with their scores in cross-validation."""

    path: Path
    fits: dict[str, Fit]


def train_gain_field(
    config: GainTrainingConfig, report: Callable[[str, int, int], None], note: Callable[[str], None] = lambda _: None
) -> GainTraining:
    """Train and save; batches of rollouts that a stopped run has finished are not run again.

    Args:
        config: the settings of the training.
        report: called with progress: the name of the task, the amount done, and the total.
        note: called with a line if the recogniser was trained at another length.

    Raises:
        EharError: data or recogniser are missing or do not fit, or a number is too small.
    """
    conditions = config.conditions
    for name, value, least in (
        ("batches", config.batches, 1),
        ("workers", config.workers, 1),
        ("length", conditions.length, LEAST_LENGTH),
    ):
        if value < least:
            raise UsageError(f"{name}: expected at least {least}, got {value}")
    directory = config.out or conditions.directory
    if directory is None:
        raise UsageError("train gain-field: expected --models DIR, or --out DIR where the shipped recogniser is used")
    setting = load_setting(conditions)
    if setting.length_note is not None:
        note(f"warning: {setting.length_note}")
    data, policy = setting.data, split_parts(setting.data).policy
    sequences = policy[data.lengths[policy] >= conditions.length]
    if len(sequences) < 2:  # a field is judged on sequences that it was not fitted on
        raise DataError(
            f"{data.name}: expected at least 2 policy sequences of at least {conditions.length} frames, "
            f"got {len(sequences)}"
        )
    task = CollectionTask(
        runner=setting.runner,
        sequences=sequences,
        length=conditions.length,
        pairs=trunk_pairs(data, sequences),
        seed=conditions.seed,
    )
    path = gain_model_path(directory, conditions)
    _check_place(path, setting)
    key = f"{data.sha256} {setting.recogniser_sha256} {conditions.length} {conditions.seed}"
    key += "" if setting.sensor_sha256 is None else f" {setting.sensor_sha256}"
    world = setting.world
    key += "" if world.agrees_with(PAPER) else f" {asdict(world)}"
    collection = _collect(task, config, path.with_suffix(""), hashlib.sha256(key.encode()).hexdigest(), report)
    belief = fit_belief(
        collection.log_probs,
        collection.viewpoints,
        collection.labels,
        collection.sequences,
        span=DistanceRange.of(world.workspace),
    )
    fits: dict[str, Fit] = {}
    for name, parts in VARIANTS.items():
        report("regressions", len(fits), len(VARIANTS))
        fits[name] = fit_field(collection, belief, parts)
    report("regressions", len(fits), len(VARIANTS))
    model = GainModel({name: fit.field for name, fit in fits.items()}, belief, task.pairs)
    told = setting.conditions
    history: dict[str, Any] = {
        **{name: getattr(told, name) for name in ("data", "models")},
        "out": None if config.out is None else str(config.out),
        **{name: getattr(told, name) for name in ("sensor", "views", "length", "fps")},
        "batches": config.batches,
        "seed": told.seed,
        "data_sha256": data.sha256,
        "cross_validation": {
            name: {score: value for score, value in fit._asdict().items() if score != "field"}
            for name, fit in fits.items()
        },
    }
    own = {"recogniser": told.recogniser, "sensor_sha256": setting.sensor_sha256}
    history |= {name: value for name, value in own.items() if value is not None}
    save_gain_model(path, model, recogniser_sha256=setting.recogniser_sha256, history=history, world=world)
    return GainTraining(path, fits)


def _check_place(path: Path, setting: Setting) -> None:
    """Raise a UsageError where the gain field of another recogniser would be lost to one for your own."""
    if setting.conditions.recogniser is None or not path.is_file():
        return
    try:
        load_gain_model(replace(setting.conditions, models=path.parent), setting.data, setting.recogniser_sha256)
    except ModelError as error:
        raise UsageError(f"{error}: remove it, or choose another --out") from error


def _collect(
    task: CollectionTask,
    config: GainTrainingConfig,
    folder: Path,
    key: str,
    report: Callable[[str, int, int], None],
) -> Collection:
    """Return the branching rollouts; each batch is kept in a folder, and a resumed run reads it from there."""
    folder = folder.with_name(f"{folder.name}-rollouts-{key[:8]}")
    pieces: dict[int, Collection] = {}
    for batch in range(config.batches):
        piece = _read(folder / f"{batch}.safetensors")
        if piece is not None:
            pieces[batch] = piece
    missing = [batch for batch in range(config.batches) if batch not in pieces]
    report("rollouts", len(pieces), config.batches)
    for batch, piece in run_batches(task, missing, workers=config.workers):
        pieces[batch] = piece
        tensors = {name.name: np.ascontiguousarray(getattr(piece, name.name)) for name in fields(Collection)}
        write_bytes(folder / f"{batch}.safetensors", save(tensors))
        report("rollouts", len(pieces), config.batches)
    return join([pieces[batch] for batch in range(config.batches)])


def _read(path: Path) -> Collection | None:
    """Return a batch that was kept; None if it is missing or not whole."""
    try:
        return Collection(**load_file(path))
    except (OSError, SafetensorError, TypeError):
        return None
