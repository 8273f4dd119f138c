"""Draws a data set: a few skeletons of each class."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from ehar.arrays import FloatArray, IntArray
from ehar.data.motion_data import MotionData
from ehar.data.skeleton import Skeleton
from ehar.data.streams.data import StreamData
from ehar.errors import DataError, UsageError
from ehar.files import replacing
from eval.render.palette import BLUE, EDGE, LINE, SOFT, THIN, VERMILION

FRAMES_SHOWN = 5
ROW_HEIGHT = 1.8  # inches
GROUND = -0.15  # [m] the lower edge of each row
VIEW_AZIMUTH = np.radians(40)  # off the direction that the first person faces: between front and side
VIEW_ELEVATION = np.radians(15)
LEFT, RIGHT, MIDDLE = VERMILION, BLUE, SOFT
PERSON_TINT = 0.45  # share of white in the colours of the second person


def activities(data: MotionData | StreamData) -> tuple[IntArray, IntArray]:
    """Return the first and the end frame of each activity, (N, 2), counted over all frames, and its class, (N,).

    A trimmed sequence is one activity.
    """
    if isinstance(data, StreamData):
        return data.segments[:, :2], data.segments[:, 2]
    return np.stack([data.offsets[:-1], data.offsets[1:]], axis=1), data.labels


def describe_figure(data: MotionData | StreamData, path: Path) -> None:
    """Draw one row for each class: a few frames of its activity of median length, seen from ahead and to one side.

    Left limbs are orange, right limbs are blue, and the second person is lighter. All rows have the same scale.

    Raises:
        UsageError: `path` does not end like a picture, or cannot be written.
        DataError: a class has no sequence.
    """
    path = Path(path)
    figure = Figure(layout="constrained")
    kinds = sorted(figure.canvas.get_supported_filetypes())
    if path.suffix[1:] not in kinds:
        raise UsageError(f"{path}: got the ending {path.suffix!r}, expected one of {', '.join(kinds)}")
    rows = [_shown(data, label) for label in range(len(data.class_names))]
    half_width = 1.05 * max(float(np.abs(points[..., 0]).max()) for _, _, points in rows)
    top = 1.15 * max(float(points[..., 1].max()) for _, _, points in rows)
    column = max(ROW_HEIGHT * 2 * half_width / (top - GROUND), 1.0)
    figure.set_size_inches(FRAMES_SHOWN * column + 0.4, len(rows) * (ROW_HEIGHT + 0.2) + 0.5)
    grid = figure.subplots(len(rows), FRAMES_SHOWN, squeeze=False)
    for axes, (source, frames, points), class_name in zip(grid, rows, data.class_names, strict=True):
        for axis, frame, joints in zip(axes, frames, points, strict=True):
            _draw(axis, joints, data.skeleton)
            axis.set(xlim=(-half_width, half_width), ylim=(GROUND, top), aspect="equal", xticks=[], yticks=[])
            axis.set_xlabel(f"{frame / data.fps:.1f} s", fontsize=8, labelpad=1)
            axis.spines[:].set_visible(False)
            axis.patch.set_visible(False)  # otherwise it covers the title, which spans several columns
        title = f"{class_name}   ({source})"
        # Above the heads, and outside the layout: a long title would widen its column.
        axes[0].text(0, 1, title, transform=axes[0].transAxes, va="top", fontsize=9).set_in_layout(False)
    second = ", second person pale" if data.persons > 1 else ""
    figure.suptitle(f"{title_of(data)}\nleft limbs orange, right limbs blue{second}", fontsize=9, x=0.02, ha="left")
    _write(figure, path)


def title_of(data: MotionData | StreamData) -> str:
    """Return what a data set is, on one line."""
    persons = "1 person" if data.persons == 1 else f"{data.persons} persons"
    joints = f"{len(data.skeleton.joint_names)} joints"
    return f"{data.title}: {persons}, {joints}, {data.fps:g} fps, {len(data.class_names)} classes"


def _shown(data: MotionData | StreamData, label: int) -> tuple[str, IntArray, FloatArray]:
    """Return the sequence of an activity, the frames to show, and their joints in the picture, (F, P, J, 2) [m].

    Frames are counted from the begin of the activity.
    """
    bounds, labels = activities(data)
    bounds = bounds[labels == label]
    if not len(bounds):
        raise DataError(f"{data.name}: class {data.class_names[label]!r} has no sequence to draw")
    first, end = bounds[np.argsort(bounds[:, 1] - bounds[:, 0], kind="stable")[len(bounds) // 2]]
    source = data.sequence_names[int(np.searchsorted(data.offsets, first, side="right")) - 1]
    motion = data.positions[first:end]
    frames = np.linspace(0, len(motion) - 1, FRAMES_SHOWN).round().astype(np.int64)
    shown = motion[frames].astype(np.float64)
    shown[..., :2] -= shown[..., :2].mean(axis=(1, 2), keepdims=True)
    shown[..., 2] -= np.percentile(motion[..., 2], 1)  # the lowest joints, without outliers
    return source, frames, _project(shown, _facing(motion[frames[0]], data.skeleton) + VIEW_AZIMUTH)


def _facing(joints: FloatArray, skeleton: Skeleton) -> float:
    """Return the azimuth [rad] that the first person of (P, J, 3) faces; 0 if no joints are named left and right."""
    return float(skeleton.heading(joints[0]))


def _project(points: FloatArray, azimuth: float) -> FloatArray:
    """Project points (..., 3) for a far camera at an azimuth and `VIEW_ELEVATION`: right and up, (..., 2)."""
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    toward = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    up = np.array([0.0, 0.0, np.cos(VIEW_ELEVATION)]) - np.sin(VIEW_ELEVATION) * toward
    return np.stack([points @ right, points @ up], axis=-1)


def _draw(axis: Axes, joints: FloatArray, skeleton: Skeleton) -> None:
    """Draw the persons (P, J, 2) of one frame, the first on top."""
    left, right = (np.isin(np.arange(len(skeleton.joint_names)), side) for side in skeleton.pairs.T)
    start, end = skeleton.bone_indices.T
    sides = np.select([left[start] | left[end], right[start] | right[end]], [1, 2], default=0)
    axis.axhline(0.0, color=EDGE, linewidth=THIN, zorder=0)
    for person in reversed(range(len(joints))):
        tint = PERSON_TINT * person / max(1, len(joints) - 1)
        palette = [np.array(to_rgb(color)) * (1 - tint) + tint for color in (MIDDLE, LEFT, RIGHT)]
        segments = np.stack([joints[person, start], joints[person, end]], axis=1)
        axis.add_collection(
            LineCollection(list(segments), colors=[palette[side] for side in sides], linewidths=LINE, capstyle="round")
        )


def _write(figure: Figure, path: Path) -> None:
    with replacing(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:], dpi=120)
