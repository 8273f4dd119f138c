"""UTD-MHAD: one .mat a recording, with the 20 joints of a Kinect.

`a10_s1_t1_skeleton.mat` is action 10 by person 1, trial 1. It holds `d_skel`, (20, 3, frames) in metres. People with
odd numbers train, those with even numbers test, as published.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.motion_data import MotionData
from ehar.data.preparing.axes import Up, upright
from ehar.data.preparing.layouts import KINECT20
from ehar.data.readers.assembly import Clip, assemble
from ehar.data.readers.names import matching_files
from ehar.errors import DataError

FPS = 30.0
ACTIONS = (
    *("swipe_left", "swipe_right", "wave", "clap", "throw", "arm_cross", "basketball_shoot", "draw_x"),
    *("draw_circle_clockwise", "draw_circle_counter_clockwise", "draw_triangle", "bowling", "boxing"),
    *("baseball_swing", "tennis_swing", "arm_curl", "tennis_serve", "push", "knock", "catch", "pickup_and_throw"),
    *("jog", "walk", "sit_to_stand", "stand_to_sit", "lunge", "squat"),
)
_JOINTS = ("head", "shoulder_center", "spine", "hip_center", *KINECT20.joint_names[4:])  # their order in the files
_ORDER = [_JOINTS.index(name) for name in KINECT20.joint_names]
_NAME = re.compile(r"a(?P<action>\d+)_s(?P<person>\d+)_t\d+_skeleton")


def prepare_utd_mhad(source: str | Path, *, unit: str = "m", up: Up = "y") -> MotionData:
    """Read the skeleton .mat files of UTD-MHAD.

    People 1, 3, 5 and 7 are for training, 2, 4, 6 and 8 for tests.

    For example:
        ehar data prepare utd-mhad Skeleton utd-mhad.npz

    Args:
        source: folder of the files.
        unit: unit of length in the files: m, cm, mm, or a number of metres.
        up: axis that points up in the files.

    Raises:
        DataError: a name is not of this set, or a file does not hold 20 joints a frame.
    """
    files = matching_files(source, ".mat", "the skeletons of UTD-MHAD, such as a1_s1_t1_skeleton.mat")

    def clips() -> Iterator[Clip]:
        for file in files:
            match = _NAME.fullmatch(file.stem)
            if match is None or not 1 <= int(match["action"]) <= len(ACTIONS):
                expected = f"expected one as a1_s1_t1_skeleton.mat, of action 1 to {len(ACTIONS)}"
                raise DataError(f"{file}: got a name that is not of UTD-MHAD, {expected}")
            yield Clip(
                file=file,
                name=file.stem.removesuffix("_skeleton"),
                label=ACTIONS[int(match["action"]) - 1],
                motion=upright(read_skeletons(file), unit=unit, up=up)[:, None],
                is_test=int(match["person"]) % 2 == 0,
                subject=int(match["person"]),
            )

    return assemble(
        clips(),
        name="utd-mhad",
        skeleton=KINECT20,
        fps=FPS,
        license="none stated: UTD-MHAD (Chen, Jafari, Kehtarnavaz, ICIP 2015), research use",
        class_order=ACTIONS,
    )


def read_skeletons(file: Path) -> FloatArray:
    """Return the joints (T, 20, 3) of one file in the order of `KINECT20`, in its own unit and axes.

    Raises:
        DataError: the file is no .mat, or holds anything but finite numbers of this shape.
    """
    from scipy.io import loadmat  # imported here: `ehar --help` names the readers

    try:
        held = loadmat(file, variable_names=["d_skel"]).get("d_skel")
    except Exception as error:  # broken bytes can raise almost any error
        problem = " ".join(str(error).split()) or type(error).__name__
        raise DataError(f"{file}: not a readable .mat: {problem}") from error
    if held is None:
        raise DataError(f"{file}: d_skel: missing, expected an array (20, 3, frames)")
    if held.dtype.kind != "f" or held.ndim != 3 or held.shape[:2] != (20, 3) or not held.shape[2]:
        raise DataError(f"{file}: d_skel: got {held.dtype} of shape {held.shape}, expected floats (20, 3, frames)")
    joints: FloatArray = np.moveaxis(held, 2, 0)[:, _ORDER]
    wrong = np.flatnonzero(~np.isfinite(joints).all(axis=(1, 2)))
    if wrong.size:
        raise DataError(f"{file}: d_skel: got NaN or infinite in frame {wrong[0]}, expected metres")
    return joints
