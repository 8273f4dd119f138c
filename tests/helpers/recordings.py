"""Motion as three real cameras would have recorded it: each sequence in its own camera's frame."""

from dataclasses import replace

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.motion_data import MotionData
from ehar.data.synthetic.sets import solo

TURNS = {1: 0.0, 2: 0.7, 3: 1.6}  # azimuth of each camera [rad]
DISTANCE = 3.0  # [m]


def rotation(turn: float) -> FloatArray:
    """Return the rotation (3, 3) about the axis up."""
    c, s = np.cos(turn), np.sin(turn)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def recorded_solo(*, executions: int = 12, frames: int = 24, noise: float = 0.0) -> MotionData:
    """Return solo dances of four people and three classes, each seen by cameras 1, 2 and 3; 3 is the test.

    Args:
        executions: number of dances.
        frames: of each recording; camera 2 begins two frames later, camera 3 three frames.
        noise: standard deviation of each camera's errors [m].
    """
    data, rng = solo(), np.random.default_rng(0)
    positions, labels, names, people, views = [], [], [], [], []
    for number in range(executions):
        label, person = number % 3, number // 3 % 4
        motion = data.sequence(int(np.flatnonzero(data.labels == label)[number // 3]))
        for view, turn in TURNS.items():
            seen = motion[2 * view : 2 * view + frames] @ rotation(turn).T + np.array([0.1 * view, DISTANCE, 0])
            positions.append(seen + noise * rng.standard_normal(seen.shape))
            labels.append(label)
            names.append(f"a{label}_s{person}_e{number}_v{view}")
            people.append(person)
            views.append(view)
    return replace(
        data,
        name="recorded",
        positions=np.concatenate(positions).astype(np.float32),
        offsets=np.arange(len(names) + 1) * frames,
        labels=np.array(labels),
        class_names=data.class_names[:3],
        sequence_names=tuple(names),
        fps=12.0,
        is_test=np.array(views) == 3,
        subjects=np.array(people)[:, None],
        synthetic=False,
        views=np.array(views),
    )
