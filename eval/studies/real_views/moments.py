"""Which frames of an execution all of its cameras recorded: each recording begins and ends when somebody cut it."""

from dataclasses import dataclass

import numpy as np

from ehar.data.motion_data import MotionData
from eval.studies.real_views.alignment import same_moments
from eval.studies.real_views.executions import Execution, Poses


@dataclass(frozen=True)
class Moments:
    """What all cameras of an execution recorded.

    Args:
        begin: the frame of each camera's recording in which it begins.
        frames: how long it is; below 1 if there is nothing.
    """

    begin: dict[int, int]
    frames: int


def shared_moments(data: MotionData, execution: Execution, poses: Poses) -> Moments:
    """Return the frames of an execution that all of its cameras recorded.

    Each pair of recordings is laid over each other. How much later one begins than another is the middle of what
    matched frames say, and what all pairs say is reconciled by least squares.
    """
    cameras = list(execution.sequences)
    recordings = [data.sequence(sequence)[:, 0] for sequence in execution.sequences.values()]
    pairs = [(i, k) for i in range(len(cameras)) for k in range(i + 1, len(cameras))]
    differs, later = np.zeros((len(pairs), len(cameras))), np.empty(len(pairs))
    for row, (i, k) in enumerate(pairs):
        carried = poses[execution.name, cameras[i], cameras[k]].carried(recordings[i])
        one, other = same_moments(carried, recordings[k], data.skeleton.mirror)
        differs[row, [i, k]] = -1, 1
        later[row] = np.median(other - one)
    starts = np.linalg.lstsq(differs, later)[0]  # the frame of each recording that shows one and the same moment
    begin = np.round(starts - starts.min()).astype(int)
    frames = min(len(recording) - first for recording, first in zip(recordings, begin.tolist(), strict=True))
    return Moments(dict(zip(cameras, begin.tolist(), strict=True)), frames)
