"""One episode of a run as it is replayed: the people, what one or two planners' cameras did, saw and made of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.camera import Camera
from ehar.data.skeleton import Skeleton
from ehar.viewpoint import Workspace, cartesian
from eval.render.field_map import gain_over_directions
from eval.replays.rerun import PlannerReplay, replay_run
from eval.running.run import Run
from eval.verification.followed_way import VIEWPOINT
from eval.verification.inputs import Inputs

MAP_STEP = 5.0  # [deg], from one azimuth or polar angle of a field map to the next
MAP_AZIMUTHS = np.arange(0.0, 360.0 + MAP_STEP, MAP_STEP)  # [deg]
MAP_POLARS = np.arange(0.0, 90.0 + MAP_STEP, MAP_STEP)  # [deg], 0 is straight above
MOST_CLASSES = 6  # that a replay has room for


@dataclass(frozen=True, eq=False)
class CameraReplay:
    """What one planner's camera did in L frames.

    Args:
        name: of the planner's record.
        path: (L, 3) viewpoints.
        target: (L - 1, 3), where the planner wanted to be, inside of the workspace; None where that is not known.
        gain: (L - 1, 19, 73) [%], its gain field over `MAP_POLARS` and `MAP_AZIMUTHS`; None without one.
        joints_2d: (L, P, J, 2) [px], as sensed.
        seen: (L, P, J), whether a joint was found.
        probabilities: (L, K), those that were scored.
    """

    name: str
    path: FloatArray
    target: FloatArray | None
    gain: FloatArray | None
    joints_2d: FloatArray
    seen: BoolArray
    probabilities: FloatArray

    def wanted(self, frame: int) -> FloatArray | None:
        """Where the planner wanted to be, (3,), after a frame; None where that is here, not known, or past the end."""
        if self.target is None or frame >= len(self.target):
            return None
        away = np.linalg.norm(cartesian(self.target[frame]) - cartesian(self.path[frame]))
        return self.target[frame] if away > VIEWPOINT else None


@dataclass(frozen=True, eq=False)
class EpisodeReplay:
    """One episode, with one or two planners.

    Args:
        index: which of the run's episodes.
        conditions: what the run is headed with.
        sequence: the episode's, and its first frame in it.
        class_names: K names.
        label: the true class.
        positions: (L, P, J, 3) [m], relative to the scenario's centre.
        skeleton: of one person.
        fps: frames a second.
        camera: through which all of them look.
        cameras: of the planners.
        notes: what could not be had, one sentence each.
    """

    index: int
    conditions: str
    sequence: str
    class_names: tuple[str, ...]
    label: int
    positions: FloatArray
    skeleton: Skeleton
    fps: float
    camera: Camera
    cameras: tuple[CameraReplay, ...]
    notes: tuple[str, ...]

    @property
    def frames(self) -> int:
        """The number of frames, L."""
        return len(self.positions)

    @property
    def shown_classes(self) -> list[int]:
        """The classes that bars are drawn for: the true one first, then those most believed in any frame."""
        most = np.max([camera.probabilities.max(axis=0) for camera in self.cameras], axis=0)
        most[self.label] = np.inf
        first, *others = np.argsort(-most, kind="stable")[:MOST_CLASSES].tolist()
        return [first, *sorted(others)]


def replay_episode(
    run: Run, inputs: Inputs, index: int, records: Sequence[str], *, advance: Callable[[str], None]
) -> EpisodeReplay:
    """Replay one episode on its recorded way.

    Args:
        run: the run.
        inputs: what it was made from.
        index: of the episode.
        records: the names of the planners' records.
        advance: told of each planner that is done.

    Raises:
        DataError: the data or the recogniser are not at hand, or what is seen is not what was recorded.
        EharError: something that the run needed cannot be read.
    """
    replays = replay_run(run, inputs, [index], records, advance=advance)
    reference = run.records[records[0]]
    return EpisodeReplay(
        index=index,
        conditions=run.config.title,
        sequence=f"{reference.sequence[index]} from frame {reference.first[index]}",
        class_names=replays.class_names,
        label=int(reference.label[index]),
        positions=replays.positions[0],
        skeleton=replays.skeleton,
        fps=replays.fps,
        camera=replays.camera,
        cameras=tuple(_camera(record, replays.planners[record]) for record in records),
        notes=replays.notes,
    )


def _camera(name: str, of: PlannerReplay) -> CameraReplay:
    """Return the first episode of a planner's."""
    path, target, weights = of.viewpoints[0], of.targets[0], of.weights[0]
    around, down = np.radians(MAP_AZIMUTHS), np.radians(MAP_POLARS)
    return CameraReplay(
        name=name,
        path=path,
        target=None if target is None else Workspace().clip(target),
        gain=None if weights is None else 100 * gain_over_directions(weights, path[:-1], around, down),
        joints_2d=of.joints_2d[0],
        seen=of.confidence[0] > 0,
        probabilities=of.probabilities[0],
    )
