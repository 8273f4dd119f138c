"""The frames of a replay, of 1280 x 720 pixels; only the parts that move are drawn for every frame."""

from typing import Any, Protocol

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from numpy.typing import NDArray

from ehar.viewpoint import wrap_azimuth
from eval.render.figures import shortened
from eval.render.palette import PAIR, SOFT, STRONG, TEXT, Look
from eval.replays.episode import CameraReplay, EpisodeReplay
from eval.replays.panels import Beliefs, CoursePanel, DirectionMap, Image
from eval.replays.scene import DrawnScene

WIDTH, HEIGHT = 1280, 720  # [px]
DPI = 100
COLUMN, GAP, MARGIN = 332, 26, 24  # [px], the column of one camera, the gap between columns, and the margin around all


class Panel(Protocol):
    """A part of a frame."""

    moving: list[Artist]  # in the order in which they are drawn

    def show(self, frame: int) -> None:
        """Move to a frame."""


class ReplayFigure:
    """Draws any frame of an episode.

    Args:
        replay: the episode.
        slower: how many times slower than life it is shown, for the title.
    """

    def __init__(self, replay: EpisodeReplay, slower: float) -> None:
        """Draw all parts that do not move."""
        self._replay, self._slower = replay, slower
        self._figure = Figure(figsize=(WIDTH / DPI, HEIGHT / DPI), dpi=DPI, facecolor="white")
        self._canvas = FigureCanvasAgg(self._figure)
        self._draw_title()
        self._panels: list[Panel] = []
        columns = len(replay.cameras) * (COLUMN + GAP)
        self._draw_left(WIDTH - MARGIN - columns)
        self._where = [
            self._draw_column(WIDTH - MARGIN + GAP - columns + index * (COLUMN + GAP), camera, look)
            for index, (camera, look) in enumerate(zip(replay.cameras, PAIR, strict=False))
        ]
        self._shown = self._text(MARGIN, 40, "", fontsize=16, fontweight="bold")
        self._clock = self._text(WIDTH - MARGIN, 40, "", fontsize=13, ha="right", family="DejaVu Sans Mono")
        self._moving = [
            *(part for panel in self._panels for part in panel.moving),
            *self._where,
            self._shown,
            self._clock,
        ]
        for part in self._moving:
            part.set_animated(True)
        self._canvas.draw()  # type: ignore[no-untyped-call]
        self._still = self._canvas.copy_from_bbox(self._figure.bbox)  # type: ignore[no-untyped-call]

    def draw(self, frame: int) -> NDArray[np.uint8]:
        """Return a frame, counted from 0, as pixels (720, 1280, 3)."""
        replay = self._replay
        self._canvas.restore_region(self._still)  # type: ignore[no-untyped-call]
        for panel in self._panels:
            panel.show(frame)
        for where, camera in zip(self._where, replay.cameras, strict=True):
            distance, azimuth, polar = camera.path[frame]
            degrees = np.degrees([wrap_azimuth(azimuth), polar])
            where.set_text(f"at {distance:.1f} m, azimuth {degrees[0]:.0f}°, polar angle {degrees[1]:.0f}°")
        kind = "shown" if replay.of_streams else "true class"
        self._shown.set_text(f"{kind}: {shortened(replay.class_names[replay.labels[frame]], 55)}")
        self._clock.set_text(self._time(frame))
        for part in self._moving:
            self._figure.draw_artist(part)
        buffer = self._canvas.buffer_rgba()  # type: ignore[no-untyped-call]
        pixels: NDArray[np.uint8] = np.asarray(buffer)[..., :3].copy()
        return pixels

    def _time(self, frame: int) -> str:
        """Return the number of a frame and its time; in a stream the time alone, as there are many frames."""
        replay = self._replay
        count = replay.length or replay.frames
        at = replay.first + frame + 1
        if replay.of_streams:
            return f"{at / replay.fps:5.1f} of {count / replay.fps:.1f} s"
        return f"frame {at:>{len(str(count))}} of {count}, {at / replay.fps:.2f} s"

    def _draw_title(self) -> None:
        """Say what is shown."""
        replay = self._replay
        pace = "" if self._slower == 1 else f", {self._slower:g} x slower than life"
        told = f"{replay.conditions}; episode {replay.index}{pace}, {replay.sequence}"
        self._text(MARGIN, 62, shortened(told, 160), fontsize=9.5, color=SOFT)

    def _draw_left(self, width: float) -> None:
        """Draw the scene, its legend, and below it the course of recognition."""
        scene = DrawnScene(self._axes(MARGIN, 84, width - MARGIN, 416), self._replay)
        self._panels.append(scene)
        key = [
            Line2D([], [], color=SOFT, linewidth=STRONG, label=scene.path_shown),
            Line2D(
                [], [], color=SOFT, marker="D", markerfacecolor="white", markersize=7, linestyle=":", label="heads for"
            ),
            Line2D([], [], color=TEXT, linewidth=STRONG, label=f"people, {scene.enlarged:.1f} x enlarged"),
        ]
        self._figure.legend(
            handles=key,
            loc="center",
            bbox_to_anchor=((MARGIN + width) / 2 / WIDTH, 1 - 520 / HEIGHT),
            ncols=len(key),
            fontsize=9,
            labelcolor=SOFT,
            frameon=False,
        )
        self._text(MARGIN, 558, "probability of the true class [%], frame by frame", fontsize=9.5, color=SOFT)
        self._panels.append(CoursePanel(self._axes(MARGIN + 34, 570, width - MARGIN - 34, 114), self._replay))

    def _draw_column(self, left: float, camera: CameraReplay, look: Look) -> Text:
        """Draw the column of one camera, and return the text for its position."""
        self._text(left, 98, shortened(camera.name, 24), fontsize=14, fontweight="bold", color=look.colour)
        replay = self._replay
        across, height = [left / WIDTH, (left + COLUMN) / WIDTH], 1 - 107 / HEIGHT
        self._figure.add_artist(
            Line2D(across, [height, height], color=look.colour, linestyle=look.line, linewidth=STRONG)
        )
        image = self._axes(left, 136, COLUMN, COLUMN * replay.camera.height / replay.camera.width)
        beliefs = self._axes(left, 332, COLUMN, 168)
        directions = self._axes(left + 56, 526, COLUMN - 56, 140)
        self._panels += [
            Image(image, replay, camera),
            Beliefs(beliefs, replay, camera, look),
            DirectionMap(directions, camera, look),
        ]
        return self._text(left, 126, "", fontsize=9.5, color=SOFT)

    def _axes(self, left: float, top: float, width: float, height: float) -> Axes:
        """Return axes in a place that is given in pixels from the top left."""
        return self._figure.add_axes((left / WIDTH, 1 - (top + height) / HEIGHT, width / WIDTH, height / HEIGHT))

    def _text(self, left: float, baseline: float, text: str, **options: Any) -> Text:
        """Write plain text at pixels from the top left."""
        return self._figure.text(
            left / WIDTH, 1 - baseline / HEIGHT, text, parse_math=False, **{"color": TEXT, **options}
        )
