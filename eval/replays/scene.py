"""The people and the cameras in space, as a panel of a replay's frames: an orthographic view from outside."""

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patches import Polygon

from ehar.arrays import FloatArray
from ehar.camera import look_at_rotation
from ehar.viewpoint import DISTANCE, cartesian
from eval.render.figures import outlined, shortened
from eval.render.outlines import outlines
from eval.render.palette import EDGE, FAINT, LINE, PAIR, STRONG, THIN, Look, bone_colours
from eval.replays.episode import TRAIL, CameraReplay, EpisodeReplay

TILT = np.radians(28)  # of the view, above the horizontal
SIDES = np.radians(np.arange(0.0, 360.0, 15.0))  # azimuths from which it may be seen
CLEAR = 0.45  # share of the farthest camera's distance that cameras keep from the people in the picture
PEOPLE_REACH = 0.3  # share of the farthest camera's distance: people are enlarged to be visible
CAMERA_SIZE = 0.075  # share of that distance
LONGEST_NAME = 16  # letters of a planner's name
GROUND, GROUND_STEP = 2.0, 0.5  # [m], radius and step of the lines below the people of a stream
WIRE_POLARS = np.radians([30.0, 60.0, 90.0])
WIRE_AZIMUTHS = np.radians(np.arange(0.0, 180.0, 45.0))


class DrawnScene:
    """The panel.

    Args:
        axes: the axes to draw in, which are cleared.
        replay: the episode.
    """

    def __init__(self, axes: Axes, replay: EpisodeReplay) -> None:
        """Draw the parts that do not move, and prepare those that do."""
        self._replay, self._axes = replay, axes
        views = [camera.path for camera in replay.cameras]
        views += [camera.target for camera in replay.cameras if camera.target is not None]
        self._reach = reach = max(float(view[:, DISTANCE].max()) for view in views)
        self._to_plane = view_from_aside([cartesian(camera.path) for camera in replay.cameras])
        extent = float(np.linalg.norm(replay.positions, axis=-1).max())
        self.enlarged = max(1.0, PEOPLE_REACH * reach / extent)
        self._people = self.enlarged * (replay.positions @ self._to_plane.T)  # (L, P, J, 2) in the plane
        self._frame_axes()
        self._draw_wire()
        self._floor = float(replay.positions[..., 2].min())
        self._walked = LineCollection([], colors=EDGE, linewidths=THIN, zorder=2)
        axes.add_collection(self._walked)
        self._draw_ground(extent)
        self._outlines = [line @ self._to_plane.T for line in outlines(replay.obstacles)]
        self._obstacles = LineCollection(self._outlines, colors=EDGE, linewidths=THIN, zorder=2)
        self._passing = LineCollection([], colors=EDGE, linewidths=STRONG, capstyle="round", zorder=3)
        axes.add_collection(self._obstacles)
        axes.add_collection(self._passing)
        colours = bone_colours(replay.positions.shape[1], len(replay.skeleton.bones))
        self._bones = LineCollection([], colors=colours, linewidths=STRONG, capstyle="round", zorder=3)
        axes.add_collection(self._bones)
        trail = round(TRAIL * replay.fps) if replay.of_streams else replay.frames
        self._cameras = [
            _CameraGlyph(axes, camera, look, self._to_plane, reach, trail, above=index == 0)
            for index, (camera, look) in enumerate(zip(replay.cameras, PAIR, strict=False))
        ]
        self.moving: list[Artist] = [
            self._walked,
            self._obstacles,
            self._passing,
            self._bones,
            *(part for camera in self._cameras for part in camera.moving),
        ]

    @property
    def path_shown(self) -> str:
        """How much of a camera's path is drawn."""
        return f"path of the last {TRAIL:g} s" if self._replay.of_streams else "path so far"

    def show(self, frame: int) -> None:
        """Move everything to a frame."""
        bones = np.array(self._replay.skeleton.bones)
        segments = self._people[frame][:, bones].reshape(-1, 2, 2)
        self._bones.set_segments(list(segments))
        if self._replay.centres is not None:
            self._walked.set_segments(list(self._lines_below(self._replay.centres[frame])))
            away = self._replay.centres[frame] @ self._to_plane.T
            self._obstacles.set_segments([line - away for line in self._outlines])
        if self._replay.passers is not None:
            passing = self._at_their_places(self._replay.passers[frame])
            self._passing.set_segments(list(passing[:, bones].reshape(-1, 2, 2)))
        for camera in self._cameras:
            camera.show(frame)

    def _at_their_places(self, joints: FloatArray) -> FloatArray:
        """Return bodies (W, J, 3) [m] in the plane, (W, J, 2): as much enlarged as people, each where it is.

        So a line of sight that it cuts is cut in the picture too.
        """
        place = joints.mean(axis=1, keepdims=True) * [1, 1, 0]
        drawn: FloatArray = (place + self.enlarged * (joints - place)) @ self._to_plane.T
        return drawn

    def _frame_axes(self) -> None:
        """Fit half a sphere as large as the farthest camera's, and the ground below it, into the panel."""
        place, reach = self._axes, self._reach
        place.set_axis_off()
        place.set_aspect("equal")
        low, high = -1.12 * reach * np.sin(TILT), 1.12 * reach
        place.set_ylim(low, high)
        box = place.get_window_extent()
        half = max(1.1 * reach, 0.5 * (high - low) * box.width / box.height)
        place.set_xlim(-half, half)

    def _draw_wire(self) -> None:
        """Draw half a sphere, as far away as the farthest camera."""
        turn = np.linspace(0, 2 * np.pi, 121)
        over = np.linspace(-np.pi / 2, np.pi / 2, 61)
        rings = [np.column_stack([np.full(121, self._reach), turn, np.full(121, polar)]) for polar in WIRE_POLARS]
        arcs = [
            np.column_stack([np.full(61, self._reach), np.where(over < 0, azimuth + np.pi, azimuth), np.abs(over)])
            for azimuth in WIRE_AZIMUTHS
        ]
        lines = [cartesian(line) @ self._to_plane.T for line in (*rings, *arcs)]
        widths = [1.4 if polar == WIRE_POLARS[-1] else 0.8 for polar in WIRE_POLARS] + [0.8] * len(arcs)
        self._axes.add_collection(LineCollection(lines, colors=EDGE, linewidths=widths, zorder=1))

    def _draw_ground(self, extent: float) -> None:
        """Draw the ground that people stand on."""
        turn = np.linspace(0, 2 * np.pi, 61)
        edge = np.column_stack([extent * np.cos(turn), extent * np.sin(turn), np.full(61, self._floor)])
        self._axes.add_patch(Polygon(self.enlarged * (edge @ self._to_plane.T), color=FAINT, zorder=2))

    def _lines_below(self, centre: FloatArray) -> FloatArray:
        """Return lines on the ground of a stream, (N, 2, 2) in the plane.

        Everything is drawn as seen from the centre, which moves with the people. The lines stay where they are, so they
        pass below it.

        Args:
            centre: (3,) [m].
        """
        extent = GROUND
        steps = np.arange(-extent, extent + GROUND_STEP, GROUND_STEP)
        lines = []
        for axis in (0, 1):
            aside = steps - centre[axis] % GROUND_STEP
            half = np.sqrt(np.maximum(0.0, extent**2 - aside**2))
            along = np.stack([-half, half], axis=1)
            across = np.repeat(aside[:, None], 2, axis=1)
            level = np.full(across.shape, self._floor)
            lines.append(np.stack([across, along, level] if axis == 0 else [along, across, level], axis=-1))
        drawn: FloatArray = self.enlarged * (np.concatenate(lines) @ self._to_plane.T)
        return drawn


class _CameraGlyph:
    """One camera: where it came from, where it is, and where its planner wants it."""

    def __init__(
        self,
        axes: Axes,
        camera: CameraReplay,
        look: Look,
        to_plane: FloatArray,
        reach: float,
        trail: int,
        *,
        above: bool,
    ) -> None:
        # Cameras start at one place: one name is above it, the other below.
        self._path = cartesian(camera.path) @ to_plane.T
        self._camera, self._to_plane, self._kept = camera, to_plane, trail
        self._bodies = _bodies(camera.path, CAMERA_SIZE * reach) @ to_plane.T  # (L, 8, 2, 2)
        halo = outlined(3.0)
        (self._trail,) = axes.plot([], [], color=look.colour, linewidth=STRONG, zorder=4, path_effects=halo)
        (self._sight,) = axes.plot(
            [], [], color=look.colour, linewidth=THIN, linestyle=(0, (4, 4)), zorder=4, alpha=0.7
        )
        (self._way,) = axes.plot([], [], color=look.colour, linewidth=LINE, linestyle=(0, (1, 1.5)), zorder=5)
        (self._goal,) = axes.plot(
            [], [], "D", markerfacecolor="white", markeredgecolor=look.colour, markeredgewidth=2, markersize=8, zorder=5
        )
        self._body = LineCollection([], colors=look.colour, linewidths=LINE, zorder=6)
        axes.add_collection(self._body)
        self._name = axes.annotate(
            shortened(camera.name, LONGEST_NAME),
            (0, 0),
            (0, 13 if above else -13),
            textcoords="offset points",
            ha="center",
            va="bottom" if above else "top",
            fontsize=11,
            fontweight="bold",
            color=look.colour,
            path_effects=outlined(3.0),
            zorder=7,
            parse_math=False,
        )
        box = self._name.get_window_extent().transformed(axes.transData.inverted())
        self._farthest = max(0.0, axes.get_xlim()[1] - box.width / 2)  # from the middle; the name still fits there
        self.moving: list[Artist] = [self._sight, self._trail, self._name, self._way, self._goal, self._body]

    def show(self, frame: int) -> None:
        here = self._path[frame]
        self._trail.set_data(self._path[max(0, frame + 1 - self._kept) : frame + 1].T)
        self._sight.set_data([here[0], 0.0], [here[1], 0.0])
        self._body.set_segments(list(self._bodies[frame]))
        self._name.xy = (float(np.clip(here[0], -self._farthest, self._farthest)), float(here[1]))
        wanted = self._camera.wanted(frame)
        for part in (self._way, self._goal):
            part.set_visible(wanted is not None)
        if wanted is not None:
            there = cartesian(wanted) @ self._to_plane.T
            self._way.set_data(np.stack([here, there], axis=1))
            self._goal.set_data(there[:, None])


def view_from_aside(ways: Sequence[FloatArray]) -> FloatArray:
    """Return the matrix (2, 3) of an orthographic view, `TILT` above the horizontal, that shows the cameras best.

    It is a view from a side on which no camera comes nearer than `CLEAR` to the people, who are in the middle. Without
    such a side, it is the one on which cameras stay farthest from them. If several sides are equally good, it is the
    one with the longest paths.

    Args:
        ways: positions of each camera, (L, 3) [m].
    """
    clear = CLEAR * max(float(np.linalg.norm(way, axis=1).max()) for way in ways)
    views = []
    for azimuth in SIDES:
        right, down, _ = look_at_rotation(np.array([1.0, azimuth, np.pi / 2 - TILT]))
        views.append(np.stack([right, -down]))

    def worth(view: FloatArray) -> tuple[float, float]:
        drawn = [way @ view.T for way in ways]
        nearest = min(float(np.linalg.norm(way, axis=1).min()) for way in drawn)
        return min(nearest, clear), sum(float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum()) for way in drawn)

    return max(views, key=worth)


def _bodies(path: FloatArray, size: float) -> FloatArray:
    """Return pyramids that open towards the people, (L, 8, 2, 3): four edges from the camera, and four of the base."""
    tips = cartesian(path)
    right, down, forward = np.moveaxis(look_at_rotation(path), -2, 0)
    corners = np.stack(
        [
            tips + size * (forward + 0.6 * across * right + 0.34 * along * down)
            for across, along in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ],
        axis=1,
    )
    edges = np.stack([np.broadcast_to(tips[:, None], corners.shape), corners], axis=2)
    base = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)
    return np.concatenate([edges, base], axis=1)
