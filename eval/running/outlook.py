"""What a training of everything will lack at a later stage, told before the first one begins."""

import numpy as np

from ehar.arrays import IntArray
from ehar.data.motion_data import MotionData
from ehar.data.scenario import advised_length, split_parts
from ehar.errors import DataError

LEAST_POLICY = 2  # sequences: what planners learn is judged on others than it is fitted on


def outlook(data: MotionData, length: int) -> tuple[str, ...]:
    """Return a line for each thing that trainings can do without, but that their user should know.

    Args:
        data: the data, at its frame rate.
        length: number of frames of an episode.

    Raises:
        DataError: a training would stop, as it has no sequences that are long enough.
    """
    parts = split_parts(data)
    advice = _advice(data, length)

    def long_enough(sequences: IntArray) -> IntArray:
        chosen: IntArray = sequences[data.lengths[sequences] >= length]
        return chosen

    def classes(sequences: IntArray) -> str:
        """Return the names of the classes that have no sequence among some, or nothing."""
        lacking = np.setdiff1d(np.arange(len(data.class_names)), data.labels[sequences])
        return ", ".join(data.class_names[label] for label in lacking)

    recogniser, policy = long_enough(parts.recogniser), long_enough(parts.policy)
    validation, test = long_enough(parts.validation), long_enough(parts.test)
    for stage, part, held, least in (
        ("recogniser", "training", recogniser, 1),
        ("planners", "policy", policy, LEAST_POLICY),
    ):
        if len(held) < least:
            wanted = f"expected {least} {part} sequence{'s' * (least > 1)} of at least {length} frames"
            alone = "" if stage == "recogniser" else "; `ehar train recogniser` needs none"
            raise DataError(f"{data.name}: the {stage} could not be trained: {wanted}, got {len(held)}{advice}{alone}")
    lines = []
    for held, part, result in (
        (recogniser, "training", "the recogniser will never name it"),
        (policy, "policy", "planners will not have met it"),
        (test, "test", "no benchmark will show it"),
    ):
        if classes(held):
            lines.append(f"no {part} sequence of at least {length} frames of {classes(held)}: {result}")
    if not len(validation):
        lines.append(
            f"no validation sequence of at least {length} frames: the recogniser's training stops by how well it does "
            "on its own training sequences, and fixed-best is found on the policy part"
        )
    short = int((data.lengths < length).sum())
    if short and advice:
        lines.append(f"{short} of {len(data.lengths)} sequences are shorter than {length} frames and left out{advice}")
    return tuple(f"warning: {line}" for line in lines)


def _advice(data: MotionData, length: int) -> str:
    advised = advised_length(data)
    return f"; --length {advised} is advised" if advised < length else ""
