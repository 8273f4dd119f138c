"""The panels of a replay's frames: what a camera sees, what is believed, and what directions are worth."""

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.patches import Rectangle
from matplotlib.text import Text

from ehar.arrays import FloatArray
from ehar.viewpoint import AZIMUTH, POLAR, wrap_azimuth
from eval.render.field_map import COLOUR_MAP
from eval.render.figures import outlined, shortened
from eval.render.palette import EDGE, FAINT, NEUTRAL, PAIR, SOFT, STRONG, TEXT, THIN, Look, bone_colours
from eval.replays.episode import CameraReplay, EpisodeReplay

LONGEST_NAME = 17  # letters of a class that there is room for
FIRST, WIDEST = 0.54, 0.34  # of the width of a panel: where bars begin, and how long they may be
NO_FIELD = "all directions; it has no gain field"
SECONDS = (0.5, 1, 2, 5, 10, 30, 60)  # between two marks of a stream
ROOM = 1.1  # around the people in an image
RIGHT_STRIP = (-14.0, 10.0)  # [%], top of the first strip below a course, and from one to the next


class Image:
    """The image of a camera: the joints that were found, and the bones between two found joints."""

    def __init__(self, axes: Axes, replay: EpisodeReplay, camera: CameraReplay) -> None:
        """Frame the people, and prepare what moves."""
        self._camera, persons = camera, replay.positions.shape[1]
        middle = np.array([replay.camera.width, replay.camera.height]) / 2
        reach = (np.abs(camera.joints_2d - middle) / middle)[camera.seen]
        self.enlarged = 1 / min(1.0, ROOM * max(float(reach.max(initial=0.0)), 0.05))
        left, top = middle * (1 - 1 / self.enlarged)
        right, bottom = middle * (1 + 1 / self.enlarged)
        axes.set_xlim(left, right)
        axes.set_ylim(bottom, top)
        axes.set_facecolor(FAINT)
        axes.set_xticks([])
        axes.set_yticks([])
        axes.spines[:].set_color(EDGE)
        joints, self._bones = camera.seen.shape[-1], np.array(replay.skeleton.bones)
        self._colours = np.array(bone_colours(persons, len(self._bones)))
        self._dot_colours = np.array(bone_colours(persons, joints))
        self._lines = LineCollection([], linewidths=STRONG, capstyle="round")
        axes.add_collection(self._lines)
        self._dots = axes.scatter([], [], s=9, zorder=3)
        note = f"{self.enlarged:.1f} x enlarged"
        axes.text(0.98, 0.04, note, transform=axes.transAxes, fontsize=8, color=SOFT, ha="right")
        self.moving: list[Artist] = [self._lines, self._dots]

    def show(self, frame: int) -> None:
        """Move to a frame."""
        joints, seen = self._camera.joints_2d[frame], self._camera.seen[frame]
        found = seen[:, self._bones].all(axis=-1).ravel()
        self._lines.set_segments(list(joints[:, self._bones].reshape(-1, 2, 2)[found]))
        self._lines.set_color(self._colours[found].tolist())
        self._dots.set_offsets(joints[seen])
        self._dots.set_facecolor(self._dot_colours[seen.ravel()].tolist())


class Beliefs:
    """Bars of the probabilities of a few classes, and which is recognised; the true one stands out."""

    def __init__(self, axes: Axes, replay: EpisodeReplay, camera: CameraReplay, look: Look) -> None:
        """Draw names and empty bars."""
        self._replay, self._camera, self._look = replay, camera, look
        self._shown = shown = replay.shown_classes
        self._right = replay.right(camera)
        axes.set_axis_off()
        axes.set_xlim(0, 1)
        axes.set_ylim(len(shown) + 0.8, -1.15)
        self._said = axes.text(0, -0.9, "", fontsize=9.5, color=TEXT, va="center", parse_math=False)
        if len(shown) < len(replay.class_names):
            count = f"{len(shown)} of {len(replay.class_names)} classes, those most believed"
            axes.text(0, len(shown) + 0.45, count, fontsize=8, color=SOFT, va="center")
        self._bars: list[Rectangle] = []
        self._values: list[Text] = []
        self._names: list[Text] = []
        for row in range(len(shown)):
            self._names.append(axes.text(0, row + 0.5, "", fontsize=9, va="center", parse_math=False))
            axes.add_patch(Rectangle((FIRST, row + 0.18), WIDEST, 0.64, color=FAINT))
            bar = Rectangle((FIRST, row + 0.18), 0.0, 0.64)
            axes.add_patch(bar)
            self._bars.append(bar)
            self._values.append(axes.text(1.0, row + 0.5, "", fontsize=9, va="center", ha="right", color=TEXT))
        self.moving: list[Artist] = [self._said, *self._names, *self._bars, *self._values]

    def show(self, frame: int) -> None:
        """Move to a frame."""
        probabilities = self._camera.probabilities[frame]
        for bar, value, name, label in zip(self._bars, self._values, self._names, self._shown, strict=True):
            true = label == self._replay.labels[frame]
            name.set_text(shortened(self._replay.class_names[label], LONGEST_NAME) + (" (true)" if true else ""))
            name.set_color(self._look.colour if true else TEXT)
            name.set_fontweight("bold" if true else "normal")
            bar.set_color(self._look.colour if true else NEUTRAL)
            bar.set_width(WIDEST * probabilities[label])
            value.set_text(f"{100 * probabilities[label]:.0f} %")
        most = int(probabilities.argmax())
        right = bool(self._right[frame])
        self._said.set_text(
            f"recognised: {shortened(self._replay.class_names[most], LONGEST_NAME)}, {'right' if right else 'wrong'}"
        )
        self._said.set_fontweight("bold" if right else "normal")


class DirectionMap:
    """All directions at the camera's distance: their worth, and the camera's path, position and target.

    Colours span the worth of all directions in this frame, from the least to the greatest.
    """

    def __init__(self, axes: Axes, camera: CameraReplay, look: Look) -> None:
        """Draw the axes, and prepare what moves."""
        self._camera = camera
        self._x, self._y, self._ends = unbroken(camera.path)
        axes.set_xlim(0, 360)
        axes.set_ylim(camera.lowest, 0)
        axes.set_facecolor(FAINT)
        axes.set_xticks([0, 90, 180, 270, 360], ["0°", "90°", "180°", "270°", "360°"])
        axes.set_yticks([0, 45, 90], ["0° above", "45°", "90° level"])
        axes.tick_params(labelsize=8, colors=SOFT, length=3)
        axes.spines[:].set_color(EDGE)
        self._caption = axes.text(0, 1.085, NO_FIELD, transform=axes.transAxes, fontsize=8.5, color=SOFT)
        self._field = None
        if camera.gain is not None:
            self._field = axes.imshow(
                camera.gain[0],
                cmap=COLOUR_MAP,
                extent=(-2.5, 362.5, camera.lowest + 2.5, -2.5),  # a cell's middle is its direction
                aspect="auto",
                interpolation="bilinear",
            )
        halo = outlined(5.0)
        (self._trail,) = axes.plot([], [], color=look.colour, linewidth=STRONG, path_effects=halo)
        (self._goal,) = axes.plot(
            [], [], "D", markerfacecolor="white", markeredgecolor=look.colour, markeredgewidth=2, markersize=7
        )
        (self._here,) = axes.plot(
            [], [], "o", color=look.colour, markeredgecolor="white", markeredgewidth=2, markersize=10
        )
        marks = (self._trail, self._goal, self._here)
        for mark in marks[1:]:
            mark.set_clip_on(False)
        self.moving: list[Artist] = [*([] if self._field is None else [self._field]), self._caption, *marks]

    def show(self, frame: int) -> None:
        """Move to a frame."""
        end = self._ends[frame]
        self._trail.set_data(self._x[: end + 1], self._y[: end + 1])
        self._here.set_data(self._x[end : end + 1], self._y[end : end + 1])
        if self._field is not None and self._camera.gain is not None:
            gain = self._camera.gain[min(frame, len(self._camera.gain) - 1)]
            low, high = float(gain.min()), float(gain.max())
            self._field.set_data(gain)
            self._field.set_clim(low, max(high, low + 1e-9))
            self._caption.set_text(f"gain field: {low:+.1f} (dark) to {high:+.1f} % (light)")
        wanted = self._camera.wanted(frame)
        self._goal.set_visible(wanted is not None)
        if wanted is not None:
            self._goal.set_data(np.degrees(wanted[None, [AZIMUTH, POLAR]]).T)


class CoursePanel:
    """The probability of the true class so far, one line per planner, and below it when each was right."""

    def __init__(self, axes: Axes, replay: EpisodeReplay) -> None:
        """Draw the axes, and prepare what moves."""
        self._replay = replay
        self._frames = np.arange(1, replay.frames + 1)
        self._courses = [100 * course for course in replay.true_probability]
        top, step = RIGHT_STRIP
        axes.set_xlim(0.5, replay.frames + 0.5)
        axes.set_ylim(top - step * len(replay.cameras), 104)
        axes.set_yticks([0, 50, 100])
        axes.tick_params(labelsize=8, colors=SOFT, length=3)
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color(EDGE)
        axes.hlines([0, 50, 100], 0.5, replay.frames + 0.5, colors=EDGE, linewidths=THIN, zorder=0)
        self._lines, self._ends, self._rights = [], [], []
        for index, (camera, look) in enumerate(zip(replay.cameras, PAIR, strict=False)):
            self._lines += axes.plot([], [], color=look.colour, linewidth=STRONG, linestyle=look.line)
            self._ends += axes.plot([], [], "o", color=look.colour, markeredgecolor="white", markersize=8)
            strip = axes.imshow(
                np.zeros((1, replay.frames, 4)),
                extent=(0.5, replay.frames + 0.5, top - step * (index + 1) + 2, top - step * index),
                aspect="auto",
                interpolation="nearest",
            )
            self._rights.append((strip, _right_pixels(replay, camera, look)))
        axes.set_xlim(0.5, replay.frames + 0.5)
        axes.set_ylim(top - step * len(replay.cameras), 104)
        if replay.of_streams:
            _mark_seconds(axes, replay)
        axes.text(-0.012, 0.0, "right", transform=axes.transAxes, fontsize=8, color=SOFT, ha="right", va="bottom")
        self.moving: list[Artist] = [*self._lines, *self._ends, *(strip for strip, _ in self._rights)]

    def show(self, frame: int) -> None:
        """Move to a frame."""
        for course, line, end in zip(self._courses, self._lines, self._ends, strict=True):
            line.set_data(self._frames[: frame + 1], course[: frame + 1])
            end.set_data(self._frames[frame : frame + 1], course[frame : frame + 1])
        for strip, pixels in self._rights:
            shown = pixels.copy()
            shown[:, frame + 1 :, 3] = 0
            strip.set_data(shown)


def _mark_seconds(axes: Axes, replay: EpisodeReplay) -> None:
    """Mark whole seconds of the episode in place of frames."""
    begin, end = replay.first / replay.fps, (replay.first + replay.frames) / replay.fps
    step = next(step for step in SECONDS if end - begin <= 10 * step or step == SECONDS[-1])
    seconds = np.arange(step * np.ceil(begin / step), end + 1e-9, step)
    axes.set_xticks(seconds * replay.fps - replay.first, [f"{second:g} s" for second in seconds])


def _right_pixels(replay: EpisodeReplay, camera: CameraReplay, look: Look) -> FloatArray:
    """Return a row of pixels, (1, L, 4): in the planner's colour where it was right, nearly white elsewhere."""
    pixels: FloatArray = np.where(replay.right(camera)[:, None], to_rgba(look.colour), to_rgba(FAINT))[None]
    return pixels


def unbroken(path: FloatArray) -> tuple[FloatArray, FloatArray, list[int]]:
    """Return azimuths and polar angles [deg] as a line on the map, with a gap where it leaves at 360° to return at 0°.

    Args:
        path: (L, 3).

    Returns:
        azimuths and polar angles, each (M,), NaN in gaps; and which of the M points belongs to each of the L frames.
    """
    azimuth, polar = np.degrees(wrap_azimuth(path[:, AZIMUTH])), np.degrees(path[:, POLAR])
    gaps = np.flatnonzero(np.abs(np.diff(azimuth)) > 180) + 1
    ends = np.arange(len(path)) + np.searchsorted(gaps, np.arange(len(path)), side="right")
    return np.insert(azimuth, gaps, np.nan), np.insert(polar, gaps, np.nan), ends.tolist()
