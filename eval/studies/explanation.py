"""The explanation of one episode: the worth of each view, the belief, and the way of the camera."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.viewpoint import Workspace, wrap_azimuth
from eval.render.field_map import gain_over_directions
from eval.render.tables import Table
from planners.value.situation import STREAM_LOOKAHEAD
from planners.value.view_basis import PAPER_RANGE, DistanceRange, field_value

MAP_STEP = 2.0  # [deg] between neighbouring azimuths or polar angles of a map


class FieldMap(NamedTuple):
    """The gain field at one distance, relative to the gain at the camera."""

    azimuth: FloatArray  # (A,) [deg], 0 to 360
    polar: FloatArray  # (H,) [deg], 0 is straight above
    gain: FloatArray  # (H, A), probability gained by looking from there instead of from here, in the frames to come
    best: tuple[int, int]  # row and column of the best view


@dataclass(frozen=True, eq=False)
class Explanation:
    """What happened in one episode, and why.

    Args:
        title: title of the data, with sensor and views.
        planner: name of the planner.
        sequence: sequence of the episode, and its first frame there.
        class_names: K names; in a stream, the last one is no activity.
        labels: (L,), the true class in each frame.
        viewpoints: (L, 3), viewpoints of the camera.
        recognised: (L, K), probabilities of the recogniser.
        targets: (L - 1, 3), targets of the planner; there is no plan after the last frame.
        believed: (L - 1, K), probabilities of the belief; in a stream, the shares of classes in the
            time `expected`.
        weights: (L - 1, 21), weights of the gain field, see `view_basis.field_value`.
        facing: (L - 1, P) [rad], azimuths that people are believed to face.
        facing_std: (L - 1, P) [rad], standard deviations of these azimuths.
        moments: the frames to show.
        workspace: workspace of the camera.
        span: range of distances of the world.
        frame_time: duration of a frame [s].
        ahead: how far the planner looks ahead in a stream [s]; None in a clip, which it watches to its end.
        expected: the time that belief and gain field expect in a stream [s]; longer for a field of flights.
    """

    title: str
    planner: str
    sequence: str
    class_names: tuple[str, ...]
    labels: IntArray
    viewpoints: FloatArray
    recognised: FloatArray
    targets: FloatArray
    believed: FloatArray
    weights: FloatArray
    facing: FloatArray
    facing_std: FloatArray
    moments: IntArray
    workspace: Workspace
    span: DistanceRange = PAPER_RANGE
    frame_time: float = 0.04
    ahead: float | None = None
    expected: float = STREAM_LOOKAHEAD

    @property
    def subject(self) -> str:
        """What the planner looks at: an activity, or a stream of several."""
        if self.ahead is None:
            return self.class_names[int(self.labels[0])]
        return f"a stream for {self.frame_time * len(self.labels):.0f} s"

    @property
    def reach(self) -> int:
        """How many frames before and after a moment its map shows the path of: all, in a stream as far as one looks."""
        return len(self.labels) if self.ahead is None else round(self.ahead / self.frame_time)

    def when(self, frame: int) -> str:
        """Return when a frame is: its number, in a stream its second."""
        return str(frame + 1) if self.ahead is None else f"{self.frame_time * frame:.1f}"

    def of_true(self, probabilities: FloatArray) -> FloatArray:
        """Return the probability of the true class in each frame, (T,), from those of all, (T, K)."""
        return probabilities[np.arange(len(probabilities)), self.labels[: len(probabilities)]]

    @property
    def right(self) -> BoolArray:
        """Whether the recognised class is the true one after each frame, (L,)."""
        right: BoolArray = self.recognised.argmax(axis=1) == self.labels
        return right

    @property
    def outcome(self) -> str:
        """The class that was recognised in the end, and since which frame; in a stream, how often it was right."""
        length = len(self.right)
        if self.ahead is not None:
            return f"right in {int(self.right.sum())} of {length} frames"
        last = self.class_names[int(self.recognised[-1].argmax())]
        if not self.right[-1]:
            return f"taken for {last} in the end, right in {int(self.right.sum())} of {length} frames"
        wrong = np.flatnonzero(~self.right)
        if not len(wrong):
            return f"recognised as {last} from the first frame on"
        return f"recognised as {last} for good from frame {wrong[-1] + 2} of {length} on"

    def field_map(self, frame: int) -> FieldMap:
        """Return the gain field at a frame, over all directions at the camera's distance in that frame."""
        here = self.viewpoints[frame]
        azimuth = np.arange(0.0, 360.0 + MAP_STEP, MAP_STEP)
        low, high = np.degrees([self.workspace.polar_min, self.workspace.polar_max])
        polar = np.linspace(low, high, round((high - low) / MAP_STEP) + 1)
        gain = gain_over_directions(self.weights[frame], here, np.radians(azimuth), np.radians(polar), self.span)
        row, column = np.unravel_index(int(gain.argmax()), gain.shape)
        return FieldMap(azimuth, polar, gain, (int(row), int(column)))

    def tables(self) -> list[Table]:
        """Return the table of the episode."""
        return [explain_table(self)]


def explain_table(explanation: Explanation) -> Table:
    """Return a table with the viewpoint, the belief and the best view at each moment."""
    rows, stream = [], explanation.ahead is not None
    true_class = "" if stream else f"True class: {explanation.subject}. "
    to_come = f"over the coming {explanation.ahead:g} s, " if stream else ""
    for frame in explanation.moments:
        distance, azimuth, polar = explanation.viewpoints[frame]
        here = field_value(explanation.weights[frame], explanation.viewpoints[frame], explanation.span)
        field = explanation.field_map(frame)
        row, column = field.best
        believed = explanation.believed[frame]
        top, label = int(believed.argmax()), int(explanation.labels[frame])
        rows.append(
            (
                explanation.when(frame),
                f"{distance:.1f}",
                f"{np.degrees(wrap_azimuth(azimuth)):.0f}",
                f"{np.degrees(polar):.0f}",
                f"{explanation.class_names[top]} {100 * believed[top]:.0f} %",
                f"{stream * (explanation.class_names[label] + ' ')}{100 * believed[label]:.0f} %",
                f"{100 * float(here):+.2f}",
                f"{100 * (float(here) + field.gain[row, column]):+.2f}",
                f"{field.azimuth[column] % 360:.0f}",
                f"{field.polar[row]:.0f}",
            )
        )
    return Table(
        title=f"{explanation.title}: {explanation.sequence}, {explanation.planner}, {explanation.outcome}",
        header=(
            "time [s]" if stream else "frame",
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
            f"{true_class}Polar angle 0 is straight above, 90 level.",
            f"The field is the gained probability of the true class, {to_come}at the camera's distance; only its "
            "differences mean anything. It does not count that different views together tell more.",
            *stream * (f"What is believed is the share of each class in the coming {explanation.expected:g} s.",),
        ),
    )
