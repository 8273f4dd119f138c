"""What explains one episode: what each view was worth, what was believed, and where the planner went."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.viewpoint import Workspace, wrap_azimuth
from eval.render.field_map import gain_over_directions
from eval.render.tables import Table
from planners.value.view_basis import field_value

MAP_STEP = 2.0  # [deg], from one azimuth or polar angle of a map to the next


class FieldMap(NamedTuple):
    """The gain field at one distance, as differences to where the camera is."""

    azimuth: FloatArray  # (A,) [deg], 0 to 360
    polar: FloatArray  # (H,) [deg], 0 is straight above
    gain: FloatArray  # (H, A), gained probability of looking from there, rather than from here, to the end
    best: tuple[int, int]  # row and column of the best view


@dataclass(frozen=True, eq=False)
class Explanation:
    """What happened in one episode, and why.

    Args:
        title: of the data, with sensor and views.
        planner: its name.
        sequence: the episode's, and its first frame in it.
        class_names: K names.
        label: the true class.
        viewpoints: (L, 3), where the camera was.
        recognised: (L, K), the recogniser's probabilities.
        targets: (L - 1, 3), where the planner wanted to be; the last frame is not planned upon.
        believed: (L - 1, K) probabilities.
        weights: (L - 1, 21) of the gain field, see `view_basis.field_value`.
        facing: (L - 1, P) [rad], the azimuths that people are believed to face.
        facing_std: (L - 1, P) [rad].
        moments: the frames to show.
        workspace: of the camera.
    """

    title: str
    planner: str
    sequence: str
    class_names: tuple[str, ...]
    label: int
    viewpoints: FloatArray
    recognised: FloatArray
    targets: FloatArray
    believed: FloatArray
    weights: FloatArray
    facing: FloatArray
    facing_std: FloatArray
    moments: IntArray
    workspace: Workspace

    @property
    def right(self) -> BoolArray:
        """Whether the recognised class is the true one after each frame, (L,)."""
        right: BoolArray = self.recognised.argmax(axis=1) == self.label
        return right

    @property
    def outcome(self) -> str:
        """What was recognised in the end, and since when."""
        length = len(self.right)
        last = self.class_names[int(self.recognised[-1].argmax())]
        if not self.right[-1]:
            return f"taken for {last} in the end, right in {int(self.right.sum())} of {length} frames"
        wrong = np.flatnonzero(~self.right)
        if not len(wrong):
            return f"recognised as {last} from the first frame on"
        return f"recognised as {last} for good from frame {wrong[-1] + 2} of {length} on"

    def field_map(self, frame: int) -> FieldMap:
        """Return the gain field at a frame, over all directions at the camera's distance then."""
        here = self.viewpoints[frame]
        azimuth = np.arange(0.0, 360.0 + MAP_STEP, MAP_STEP)
        low, high = np.degrees([self.workspace.polar_min, self.workspace.polar_max])
        polar = np.linspace(low, high, round((high - low) / MAP_STEP) + 1)
        gain = gain_over_directions(self.weights[frame], here, np.radians(azimuth), np.radians(polar))
        row, column = np.unravel_index(int(gain.argmax()), gain.shape)
        return FieldMap(azimuth, polar, gain, (int(row), int(column)))

    def tables(self) -> list[Table]:
        """Return what there is to read."""
        return [explain_table(self)]


def explain_table(explanation: Explanation) -> Table:
    """Return where the camera was at each moment, what was believed, and where the best view was."""
    rows = []
    for frame in explanation.moments:
        distance, azimuth, polar = explanation.viewpoints[frame]
        here = field_value(explanation.weights[frame], explanation.viewpoints[frame])
        field = explanation.field_map(frame)
        row, column = field.best
        believed = explanation.believed[frame]
        top = int(believed.argmax())
        rows.append(
            (
                str(frame + 1),
                f"{distance:.1f}",
                f"{np.degrees(wrap_azimuth(azimuth)):.0f}",
                f"{np.degrees(polar):.0f}",
                f"{explanation.class_names[top]} {100 * believed[top]:.0f} %",
                f"{100 * believed[explanation.label]:.0f} %",
                f"{100 * float(here):+.2f}",
                f"{100 * (float(here) + field.gain[row, column]):+.2f}",
                f"{field.azimuth[column] % 360:.0f}",
                f"{field.polar[row]:.0f}",
            )
        )
    return Table(
        title=f"{explanation.title}: {explanation.sequence}, {explanation.planner}, {explanation.outcome}",
        header=(
            "frame",
            "distance [m]",
            "azimuth [deg]",
            "polar [deg]",
            "most believed",
            "true class",
            "field here [%]",
            "best [%]",
            "at azimuth [deg]",
            "polar [deg]",
        ),
        rows=tuple(rows),
        footnotes=(
            f"True class: {explanation.class_names[explanation.label]}. Polar angle 0 is straight above, 90 level.",
            "The field is gained probability of the true class, at the camera's present distance; only differences "
            "mean anything. That views which spread tell more is not in it.",
        ),
    )
