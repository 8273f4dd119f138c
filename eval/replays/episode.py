"""One replayed episode: the people, and what one or two planners' cameras did, saw and recognised."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.camera import Camera
from ehar.data.skeleton import Skeleton
from ehar.obstacles.shapes import Obstacles
from ehar.viewpoint import Workspace, cartesian
from eval.render.field_map import gain_over_directions
from eval.replays.rerun import PlannerReplay, replay_run
from eval.running.run import Run
from eval.verification.followed_way import VIEWPOINT
from eval.verification.inputs import Inputs
from planners.value.view_basis import DistanceRange

MAP_STEP = 5.0  # [deg], from one azimuth or polar angle of a field map to the next
MAP_AZIMUTHS = np.arange(0.0, 360.0 + MAP_STEP, MAP_STEP)  # [deg]
LEVEL = 90.0  # [deg], the polar angle that is level with the people
MOST_CLASSES = 6  # the classes that a replay has room for
TRAIL = 5.0  # [s], of a camera's way that is shown in a stream


@dataclass(frozen=True, eq=False)
class CameraReplay:
    """The replay of one planner's camera over L frames.

    Args:
        name: name of the planner's record.
        path: (L, 3) viewpoints.
        target: (L - 1, 3), the planner's targets in the workspace; None if they are unknown.
        gain: (L - 1, H, 73) [%], its gain field over `map_polars(lowest)` and `MAP_AZIMUTHS`; None without one.
        joints_2d: (L, P, J, 2) [px], as sensed.
        seen: (L, P, J), whether a joint was found.
        probabilities: (L, K), the scored probabilities.
        lowest: greatest polar angle of maps [deg].
    """

    name: str
    path: FloatArray
    target: FloatArray | None
    gain: FloatArray | None
    joints_2d: FloatArray
    seen: BoolArray
    probabilities: FloatArray
    lowest: float = LEVEL

    def cut(self, frames: slice) -> "CameraReplay":
        """Return some frames, one after another."""
        targets = slice(frames.start, frames.stop - 1)  # after the last frame there is none
        return replace(
            self,
            path=self.path[frames],
            target=None if self.target is None else self.target[targets],
            gain=None if self.gain is None else self.gain[targets],
            joints_2d=self.joints_2d[frames],
            seen=self.seen[frames],
            probabilities=self.probabilities[frames],
        )

    def wanted(self, frame: int) -> FloatArray | None:
        """The planner's target after a frame, (3,); None if it is the present viewpoint, unknown, or past the end."""
        if self.target is None or frame >= len(self.target):
            return None
        away = np.linalg.norm(cartesian(self.target[frame]) - cartesian(self.path[frame]))
        return self.target[frame] if away > VIEWPOINT else None


@dataclass(frozen=True, eq=False)
class EpisodeReplay:
    """One episode, with one or two planners.

    Args:
        index: number of the episode in the run.
        conditions: title of the run.
        sequence: name of the sequence, and the episode's first frame in it.
        class_names: K names.
        labels: (L,), the true class of each frame.
        positions: (L, P, J, 3) [m], relative to the scenario's centre; in a stream, to where it is in that frame.
        skeleton: the skeleton of one person.
        fps: frames per second.
        camera: the intrinsics of all cameras.
        cameras: cameras of the planners.
        notes: what is missing, one sentence each.
        centres: (L, 3) [m], where the centre is in a stream, relative to its first frame; None in a clip.
        first: the number of the first frame in the episode.
        length: the number of frames of the episode, if these are only some of them.
        obstacles: what stands there, relative to where the centre is in the episode's first frame.
        passers: (L, W, J, 3) [m], who walks past, in the frame of `positions`; None if nobody does.
    """

    index: int
    conditions: str
    sequence: str
    class_names: tuple[str, ...]
    labels: IntArray
    positions: FloatArray
    skeleton: Skeleton
    fps: float
    camera: Camera
    cameras: tuple[CameraReplay, ...]
    notes: tuple[str, ...]
    centres: FloatArray | None = None
    first: int = 0
    length: int | None = None
    obstacles: Obstacles = field(default_factory=Obstacles)
    passers: FloatArray | None = None

    @property
    def frames(self) -> int:
        """The number of frames, L."""
        return len(self.positions)

    @property
    def shown_classes(self) -> list[int]:
        """The classes that bars are drawn for: the true ones, and those most believed in any frame.

        In a clip the true one comes first. In a stream it is another one from time to time, so none does.
        """
        most = np.max([camera.probabilities.max(axis=0) for camera in self.cameras], axis=0)
        most[self.labels] += 1.0  # a true one comes before one that is not
        first, *others = np.argsort(-most, kind="stable")[:MOST_CLASSES].tolist()
        return sorted([first, *others]) if self.of_streams else [first, *sorted(others)]

    @property
    def of_streams(self) -> bool:
        """Whether one activity follows another."""
        return self.centres is not None

    @property
    def true_probability(self) -> tuple[FloatArray, ...]:
        """The probability of the true class in each frame, (L,) for each camera."""
        rows = np.arange(self.frames)
        return tuple(camera.probabilities[rows, self.labels] for camera in self.cameras)

    def right(self, camera: CameraReplay) -> BoolArray:
        """Return whether the most probable class is the true one in each frame, (L,)."""
        right: BoolArray = camera.probabilities.argmax(axis=1) == self.labels
        return right

    def cut(self, first: int, end: int) -> "EpisodeReplay":
        """Return the frames from `first` up to `end`, which is not included."""
        frames = slice(first, end)
        return replace(
            self,
            labels=self.labels[frames],
            positions=self.positions[frames],
            cameras=tuple(camera.cut(frames) for camera in self.cameras),
            centres=None if self.centres is None else self.centres[frames],
            passers=None if self.passers is None else self.passers[frames],
            first=self.first + first,
            length=self.length or self.frames,
        )


def replay_episode(
    run: Run, inputs: Inputs, index: int, records: Sequence[str], *, advance: Callable[[str], None]
) -> EpisodeReplay:
    """Replay one episode along its recorded path.

    Args:
        run: the run.
        inputs: data and models of the run.
        index: number of the episode in the run.
        records: names of the planners' records.
        advance: is told of each planner that is done.

    Raises:
        DataError: the data or the recogniser is missing, or the replay differs from the records.
        EharError: something that the run needed cannot be read.
    """
    replays = replay_run(run, inputs, [index], records, advance=advance)
    reference = run.records[records[0]]
    return EpisodeReplay(
        index=index,
        conditions=run.config.title,
        sequence=f"{reference.sequence[index]} from frame {reference.first[index]}",
        class_names=replays.class_names,
        labels=replays.labels[0],
        centres=None if replays.centres is None else replays.centres[0],
        positions=replays.positions[0],
        skeleton=replays.skeleton,
        fps=replays.fps,
        camera=replays.camera,
        cameras=tuple(_camera(record, replays.planners[record], run.config.world.workspace) for record in records),
        notes=replays.notes,
        obstacles=run.config.world.obstacles,
        passers=None if replays.passers is None else replays.passers[0],
    )


def map_polars(lowest: float = LEVEL, step: float = MAP_STEP) -> FloatArray:
    """Return the polar angles of a field map [deg], from straight above to the lowest."""
    return np.arange(0.0, lowest + step, step)


def lowest_polar(workspace: Workspace, step: float) -> float:
    """Return the greatest polar angle of maps [deg], a multiple of `step`: level, or as low as the camera may be."""
    below = np.degrees(workspace.polar_max) / step
    return max(LEVEL, step * float(np.ceil(below - 1e-6)))


def _camera(name: str, replay: PlannerReplay, workspace: Workspace) -> CameraReplay:
    """Return the camera in the first episode of a planner's replay."""
    path, target, weights = replay.viewpoints[0], replay.targets[0], replay.weights[0]
    lowest, span = lowest_polar(workspace, MAP_STEP), DistanceRange.of(workspace)
    around, down = np.radians(MAP_AZIMUTHS), np.radians(map_polars(lowest))
    return CameraReplay(
        name=name,
        path=path,
        target=None if target is None else workspace.clip(target),
        gain=None if weights is None else 100 * gain_over_directions(weights, path[:-1], around, down, span),
        joints_2d=replay.joints_2d[0],
        seen=replay.confidence[0] > 0,
        probabilities=replay.probabilities[0],
        lowest=lowest,
    )
