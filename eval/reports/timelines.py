"""Timelines of streams: what was shown and believed, beside the camera's way, as JSON for the page's script."""

from collections.abc import Collection
from typing import Any

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.data.recordings import Recordings
from ehar.data.skeleton import Skeleton
from ehar.data.streams.data import NO_ACTIVITY, StreamData
from eval.records.episodes import EpisodeRecords
from eval.render.palette import looks
from eval.replays.data import CENTI, integers, viewpoints
from eval.reports.data import ReportData
from eval.reports.tables import options
from eval.scores.resampling.training_seeds import first_trainings
from eval.verification.verify import run_episodes
from planners.place.people import KNOWN, trunk_of

MOST_BYTES = 3_000_000  # of all timelines together
A_SECOND = 10  # points of a camera's way
MOST_POINTS = 600  # of a camera's way; more of them than a screen shows
POINT_BYTES = 10  # of a point, as base64
UNKNOWN = 65535  # a direction that is not known


def timelines(data: ReportData, wanted: Collection[int], recordings: Recordings | None) -> dict[str, Any]:
    """Return the timelines of the first episodes, as many as there is room for, and of those that are wanted.

    Of a planner with several trainings, the first is shown.

    Args:
        data: data of the report, which are of streams.
        wanted: numbers of episodes.
        recordings: the streams; None without them, when nobody knows where people face.
    """
    records, reference = first_trainings(data.run.records), data.reference
    count, length = reference.label.shape
    fps, workspace = data.run.conditions.fps or 1.0, data.run.config.world.workspace
    every = max(1, round(fps / A_SECOND), -(-length // MOST_POINTS))
    most = MOST_BYTES // (len(records) * POINT_BYTES * -(-length // every))
    shown = sorted({*range(min(count, most)), *wanted})
    facing = None if recordings is None else _facing(data, recordings, shown)
    styles = looks(data.privileged)
    planners = {name: _planner(data.run.records[record], shown, every, data) for name, record in records.items()}
    return {
        "fps": fps,
        "frames": length,
        "every": every,
        "classes": list(data.recognised_names),
        "distances": [workspace.distance_min, workspace.distance_max],
        "lowest": max(90.0, float(np.degrees(workspace.polar_max))),
        "episodes": [
            {
                "episode": index,
                "shown": _rows(reference.label[index], data),
                "facing": None if facing is None else _angles(facing[row, ::every]),
                "planners": {name: held[row] for name, held in planners.items()},
            }
            for row, index in enumerate(shown)
        ],
        "looks": {name: {"colour": look.token, "dash": look.dash} for name, look in styles.items()},
    }


def _planner(records: EpisodeRecords, shown: list[int], every: int, data: ReportData) -> list[dict[str, Any]]:
    """Return what a planner believed in some episodes, and its way at every so many frames."""
    return [
        {
            "believed": _rows(records.predicted[index], data),
            "sure": integers(100 * records.true_probability[index, ::every], np.uint8),
            "path": viewpoints(records.viewpoint[index, ::every]),
        }
        for index in shown
    ]


def timelines_part(data: ReportData) -> str:
    """Return the choice of an episode, and where its timeline is drawn."""
    reference = data.reference
    episodes = {
        str(index): f"episode {index}: {reference.sequence[index]} from frame {reference.first[index]}"
        for index in range(len(reference))
    }
    return (
        f'<div class="controls"><label>Episode<select id="watched">{options(episodes, "0")}</select></label></div>'
        '<canvas id="timeline" tabindex="0" role="img" aria-label="What is shown and what is believed over the '
        'episode, and the distance, azimuth and polar angle of the camera; arrow keys move along it"></canvas>'
        '<p class="small moment" id="moment" aria-live="polite"></p>'
    )


def facing_of(positions: FloatArray, skeleton: Skeleton) -> FloatArray:
    """Return the azimuth that people face on the whole, (...,) [rad]; NaN where they face different ways.

    It is the mean of the directions that are at a right angle to the line from right to left of each trunk.

    Args:
        positions: (..., P, J, 3) [m].
        skeleton: the skeleton, which says left from right.
    """
    pairs = trunk_of(skeleton)
    if not len(pairs):
        return np.full(positions.shape[:-3], np.nan)
    across = (positions[..., pairs[:, 0], :2] - positions[..., pairs[:, 1], :2]).mean(axis=-2, dtype=np.float64)
    ahead = -1j * (across[..., 0] + 1j * across[..., 1])
    length = np.abs(ahead)
    mean = np.divide(ahead, length, out=np.zeros_like(ahead), where=length > 0).mean(axis=-1)  # 0 where nobody is seen
    facing: FloatArray = np.where(np.abs(mean) >= KNOWN, np.angle(mean), np.nan)
    return facing


def _facing(data: ReportData, recordings: Recordings, shown: list[int]) -> FloatArray | None:
    """Return where people face in episodes, (E, L) [rad]; None where that is not known for most of the time."""
    if not isinstance(recordings, StreamData):
        return None
    episodes = run_episodes(data.run.config, recordings)
    facing = np.stack(
        [facing_of(episodes.scenarios.positions(episodes.scenario[[index]])[0], recordings.skeleton) for index in shown]
    )
    return None if np.isnan(facing).mean() > 1 / 2 else facing


def _angles(angles: FloatArray) -> str:
    """Return angles (T,) as hundredths of a degree, `UNKNOWN` for NaN."""
    degrees = CENTI * np.degrees(np.nan_to_num(angles) % (2 * np.pi))
    return integers(np.where(np.isnan(angles), UNKNOWN, degrees), np.uint16)


def _rows(classes: IntArray, data: ReportData) -> list[int]:
    """Return where classes (L,) change and to which, [frame, class, frame, class, ...]; no activity is the last one."""
    begins = np.concatenate([[0], np.flatnonzero(np.diff(classes)) + 1])
    named = np.where(classes == NO_ACTIVITY, len(data.class_names), classes)
    listed: list[int] = np.stack([begins, named[begins]], axis=1).ravel().tolist()
    return listed
