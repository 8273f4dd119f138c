"""What a training of everything will lack at a later stage, told before the first one begins."""

from typing import NamedTuple

import numpy as np

from ehar.arrays import IntArray
from ehar.data.motion_data import MotionData
from ehar.data.scenario import USUAL_LENGTH, advised_length, split_parts
from ehar.data.streams.data import StreamData
from ehar.errors import DataError

LEAST_POLICY = 2  # sequences: what planners learn is judged on others than it is fitted on


class Needed(NamedTuple):
    """The frames that a sequence needs for each stage; clips need the same for all."""

    recogniser: int
    planners: int
    benchmark: int

    @staticmethod
    def of(data: MotionData | StreamData, length: int | None) -> "Needed":
        """Return the frames for some data; a length that is told counts for all stages."""
        if not isinstance(data, StreamData):
            return Needed(*3 * (USUAL_LENGTH if length is None else length,))
        # Imported here: they bring torch and scipy, too slow for `ehar --help`.
        from planners.value.situation import STREAM_WINDOW
        from recognition.setting import EPISODE
        from recognition.training.config import WINDOW

        usual = (round(seconds * data.fps) for seconds in (WINDOW, STREAM_WINDOW, EPISODE))
        return Needed(*(frames if length is None else length for frames in usual))


def outlook(data: MotionData | StreamData, length: int | None) -> tuple[str, ...]:
    """Return a line for each thing that trainings can do without, but that their user should know.

    Args:
        data: the data, at its frame rate.
        length: number of frames of an episode; None means the usual ones, which in streams differ by stage.

    Raises:
        DataError: a training would stop, as it has no sequences that are long enough.
    """
    parts, needed = split_parts(data), Needed.of(data, length)
    one = "stream" if isinstance(data, StreamData) else "sequence"
    advice = _advice(data, needed.planners)

    def long_enough(sequences: IntArray, frames: int) -> IntArray:
        chosen: IntArray = sequences[data.lengths[sequences] >= frames]
        return chosen

    def classes(sequences: IntArray) -> str:
        """Return the names of the classes that no sequence among some shows, or nothing."""
        lacking = np.setdiff1d(np.arange(len(data.class_names)), _shown(data, sequences))
        return ", ".join(data.class_names[label] for label in lacking)

    recogniser = long_enough(parts.recogniser, needed.recogniser)
    policy, validation = (long_enough(part, needed.planners) for part in (parts.policy, parts.validation))
    test = long_enough(parts.test, needed.benchmark)
    for stage, part, held, frames, least in (
        ("recogniser", "training", recogniser, needed.recogniser, 1),
        ("planners", "policy", policy, needed.planners, LEAST_POLICY),
    ):
        if len(held) < least:
            wanted = f"expected {least} {part} {one}{'s' * (least > 1)} of at least {frames} frames"
            alone = "" if stage == "recogniser" else "; `ehar train recogniser` needs none"
            raise DataError(f"{data.name}: the {stage} could not be trained: {wanted}, got {len(held)}{advice}{alone}")
    lines = []
    for held, part, frames, result in (
        (recogniser, "training", needed.recogniser, "the recogniser will never name it"),
        (policy, "policy", needed.planners, "planners will not have met it"),
        (test, "test", needed.benchmark, "no benchmark will show it"),
    ):
        if classes(held):
            lines.append(f"no {part} {one} of at least {frames} frames of {classes(held)}: {result}")
    if not len(validation):
        lines.append(
            f"no validation {one} of at least {needed.planners} frames: the recogniser's training stops by how well it "
            f"does on its own training {one}s, and fixed-best is found on the policy part"
        )
    short = int((data.lengths < needed.planners).sum())
    if short and (advice or isinstance(data, StreamData)):
        left = f"{short} of {len(data.lengths)} {one}s are shorter than {needed.planners} frames and left out"
        lines.append(f"{left}{advice}")
    return tuple(f"warning: {line}" for line in lines)


def _shown(data: MotionData | StreamData, sequences: IntArray) -> IntArray:
    """Return the classes that some sequences show, each at least once."""
    if isinstance(data, StreamData):
        shown: IntArray = data.segments[np.isin(data.stream_of, sequences), 2]
        return shown
    return data.labels[sequences]


def _advice(data: MotionData | StreamData, length: int) -> str:
    advised = advised_length(data, length)
    return f"; --length {advised} is advised" if advised < length else ""
