"""Reads where planners went in runs of the benchmark, for a recogniser that is to learn from there."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ehar.conditions import Conditions
from ehar.data.motion_data import MotionData
from ehar.data.recordings import Recordings
from ehar.errors import UsageError
from ehar.track import IDEAL
from ehar.world import load_world
from eval.running.run import Run, read_run
from recognition.training.planned_views import PlannedViews

PART = "recogniser"  # of the data: people whom the recogniser learns from anyway


def planned_views(runs: Sequence[Path], data: Recordings, told: Conditions) -> PlannedViews:
    """Return where all planners of some runs went.

    Args:
        runs: folders of runs of the benchmark, on the recogniser's part, without planners that see the truth: a network
            would learn to read the class from the way that such a planner takes.
        data: the motion that the recogniser learns from.
        told: the conditions of its training, with its length.

    Raises:
        UsageError: a run is of other data, of another part, world, track or frame rate, of shorter episodes or in clips
            of longer ones, of another length than the others, or with a planner that sees the truth.
        DataError: a run's files cannot be read.
    """
    numbers = {name: index for index, name in enumerate(data.sequence_names)}
    pieces = []
    for folder in runs:
        run = read_run(folder)
        _check(folder, run, data, told)
        for episodes in run.records.values():
            sequence = np.array([numbers[name] for name in episodes.sequence])
            pieces.append(PlannedViews(sequence, episodes.first, episodes.viewpoint))
    lengths = {piece.viewpoints.shape[1] for piece in pieces}
    if len(lengths) > 1:
        raise UsageError(
            f"--planned: expected episodes of one length, got {', '.join(map(str, sorted(lengths)))} frames"
        )
    return PlannedViews(
        *(np.concatenate([getattr(piece, name) for piece in pieces]) for name in ("sequence", "first", "viewpoints"))
    )


def _check(folder: Path, run: Run, data: Recordings, told: Conditions) -> None:
    """Raise a UsageError unless the training may see what the planners of a run saw."""
    conditions, config = run.conditions, run.config
    privileged = [planner.name for planner in config.planners if planner.privileged]
    world, frames = load_world(told.world), conditions.frames
    # Viewpoints are about people's centre, which in clips is that of an episode's first frame.
    clips = isinstance(data, MotionData)
    fits = frames == told.frames if clips else frames >= told.frames
    refused = (
        (config.data_sha256 != data.sha256, f"of {data.title}", f"one of {config.data}, or of another version of it"),
        (conditions.part != PART, f"of --part {PART}", f"one of the {conditions.part} part"),
        (not config.world.agrees_with(world), f"in the world {world.name}", f"one in {config.world.name}"),
        (conditions.track != IDEAL, f"on the {IDEAL} track", f"one on {conditions.track}"),
        (conditions.fps != told.fps, f"at {told.fps} frames/s", f"one at {conditions.fps}"),
        (not fits, f"of {'' if clips else 'at least '}{told.frames} frames an episode", f"one of {frames}"),
        (bool(privileged), "of planners without the truth", f"one of {', '.join(privileged)}"),
    )
    for wrong, expected, got in refused:
        if wrong:
            raise UsageError(f"--planned: {folder}: expected a run {expected}, got {got}")
