"""The replay of a report as JSON: some episodes, with arrays as base64 of small integers."""

import base64
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ehar.arrays import FloatArray
from ehar.errors import EharError
from ehar.viewpoint import Workspace, wrap_azimuth
from eval.records.episodes import EpisodeRecords
from eval.render.field_map import gain_over_directions
from eval.render.outlines import outlines
from eval.replays.choice import ChosenEpisode
from eval.replays.episode import lowest_polar, map_polars
from eval.replays.rerun import PlannerReplay, Replays, replay_run
from eval.running.run import Run
from eval.verification.inputs import check_inputs
from planners.value.view_basis import DistanceRange

MOST_BYTES = 6_000_000  # of all replays together; episodes beyond are left out
A_SECOND = 10  # frames of a stream that are kept; of long streams fewer
MILLI = 1000  # joints are in whole millimetres
CENTI = 100  # angles in hundredths of a degree, distances and the centre of streams in centimetres: up to 655 and 327 m
BASIS_POINTS = 10_000  # probabilities in hundredths of a percent
MAP_STEP = 10.0  # [deg], from one azimuth or polar angle of a field map to the next


def replay_data(
    run: Run,
    chosen: Sequence[ChosenEpisode],
    planners: Mapping[str, str],
    *,
    data: str | Path | None,
    models: str | Path | None,
    advance: Callable[[str], None],
) -> dict[str, Any]:
    """Return the replays of a run; if there can be none, `episodes` is empty and `missing` says why.

    Args:
        run: the run.
        chosen: the episodes.
        planners: record name of each planner, by name.
        data: path of the run's data; None takes the path in config.json.
        models: folder of the run's weights; None takes the folder in config.json.
        advance: is told of each record that is done.
    """
    try:
        inputs = check_inputs(run.config, data, models, run_own_code=True)
        replays = replay_run(run, inputs, [one.episode for one in chosen], list(planners.values()), advance=advance)
    except EharError as error:
        return {"episodes": [], "missing": str(error), "notes": []}
    bones = replays.skeleton.bones
    workspace = run.config.world.workspace
    of_streams = replays.centres is not None
    if of_streams:
        replays = replays.thinned(max(1, round(replays.fps / A_SECOND)))
    reference = next(iter(run.records.values()))
    pieces: list[dict[str, Any]] = []
    size = 0
    for row, one in enumerate(chosen):
        piece = _episode(run, reference, replays, row, one, planners)
        while of_streams and not pieces and _size(piece) > MOST_BYTES:
            replays = replays.thinned(2)
            piece = _episode(run, reference, replays, row, one, planners)
        size += _size(piece)
        if pieces and size > MOST_BYTES:
            break
        pieces.append(piece)
    _, length, persons, joints, _ = replays.positions.shape
    return {
        "episodes": pieces,
        "missing": None,
        "notes": list(replays.notes),
        "streams": of_streams,
        "frames": length,
        "persons": persons,
        "joints": joints,
        "bones": [list(bone) for bone in bones],
        "fps": replays.fps,
        "image": [replays.camera.width, replays.camera.height],
        "classes": list(replays.class_names),
        "distances": [workspace.distance_min, workspace.distance_max],
        "lowest": lowest_polar(workspace, MAP_STEP),
        "obstacles": [line.round(2).tolist() for line in outlines(run.config.world.obstacles)],
        "map": [len(_AROUND), len(_down(workspace))],
    }


def _size(piece: dict[str, Any]) -> int:
    """Return how many bytes an episode takes in the page."""
    return len(json.dumps(piece))


_AROUND = np.radians(np.arange(0.0, 360.0 + MAP_STEP, MAP_STEP))


def _down(workspace: Workspace) -> FloatArray:
    """Return the polar angles of field maps [rad]."""
    down: FloatArray = np.radians(map_polars(lowest_polar(workspace, MAP_STEP), MAP_STEP))
    return down


def _episode(
    run: Run, reference: EpisodeRecords, replays: Replays, row: int, one: ChosenEpisode, planners: Mapping[str, str]
) -> dict[str, Any]:
    """Return one episode with all planners; the reference says which it is."""
    return {
        "episode": one.episode,
        "title": f"{reference.sequence[one.episode]} from frame {reference.first[one.episode]}",
        "why": one.why,
        "labels": integers(replays.labels[row], np.uint16),
        "centre": None if replays.centres is None else integers(replays.centres[row] * CENTI, np.int16),
        "people": integers(replays.positions[row] * MILLI, np.int16),
        "passers": None if replays.passers is None else integers(replays.passers[row] * MILLI, np.int16),
        "planners": {
            name: _planner(replays.planners[record], row, run.config.world.workspace)
            for name, record in planners.items()
        },
    }


def _planner(replay: PlannerReplay, row: int, workspace: Workspace) -> dict[str, Any]:
    """Return the replay of one planner in one episode."""
    target, weights = replay.targets[row], replay.weights[row]
    return {
        "path": viewpoints(replay.viewpoints[row]),
        "target": None if target is None else viewpoints(workspace.clip(target)),
        "sensed": integers(replay.joints_2d[row], np.int16),
        "missed": integers(replay.confidence[row] <= 0, np.uint8),
        "belief": integers(replay.probabilities[row] * BASIS_POINTS, np.uint16),
        "field": None if weights is None else _field(weights, replay.viewpoints[row], workspace),
    }


def _field(weights: FloatArray, path: FloatArray, workspace: Workspace) -> dict[str, Any]:
    """Return the gain field of every frame but the last, over all directions at the camera's distance.

    Values are differences to the camera's own direction, in percent of probability; 0 to 255 stand for low to high.
    """
    span, down = DistanceRange.of(workspace), _down(workspace)
    gain = 100 * gain_over_directions(weights, path[: len(weights)], _AROUND, down, span)
    low, high = float(gain.min()), float(gain.max())
    scaled = 255 * (gain - low) / max(high - low, 1e-9)
    return {"low": round(low, 2), "high": round(high, 2), "values": integers(scaled, np.uint8)}


def viewpoints(path: FloatArray) -> str:
    """Return viewpoints (T, 3) as whole centimetres and hundredths of a degree."""
    degrees = np.degrees(np.stack([wrap_azimuth(path[:, 1]), path[:, 2]], axis=1))
    return integers(np.column_stack([path[:, 0], degrees]) * CENTI, np.uint16)


def integers(values: FloatArray, kind: type[np.integer[Any]]) -> str:
    """Return numbers, rounded and kept within what `kind` holds, as base64 of little-endian integers; NaN is the least.

    Where a tracker lost people, nobody knows where they are.
    """
    bounds = np.iinfo(kind)
    told = np.nan_to_num(np.asarray(values, dtype=np.float64), nan=-np.inf, posinf=np.inf, neginf=-np.inf)
    whole = np.clip(np.rint(told), bounds.min, bounds.max)
    return base64.b64encode(whole.astype(np.dtype(kind).newbyteorder("<")).tobytes()).decode("ascii")
