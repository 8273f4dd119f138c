"""Northwestern-UCLA Multiview Action3D: one .json a recording, as distributed with CTR-GCN.

`a05_s02_e00_v03.json` is action 5 by person 2, execution 0, seen by camera 3. It holds `skeletons`, (frames, 20, 3) in
metres in the camera's own frame. Cameras 1 and 2 train, camera 3 tests, as published. The frame rate is not stated.
"""

import json
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

FPS = 12.0  # assumed: not stated by its authors
TEST_VIEW = 3
ACTIONS = {
    1: "pick_up_with_one_hand",
    2: "pick_up_with_two_hands",
    3: "drop_trash",
    4: "walk_around",
    5: "sit_down",
    6: "stand_up",
    8: "donning",
    9: "doffing",
    11: "throw",
    12: "carry",
}
_NAME = re.compile(r"a(?P<action>\d+)_s(?P<person>\d+)_e\d+_v(?P<view>\d+)")


def prepare_nwucla(source: str | Path, *, unit: str = "m", up: Up = "y") -> MotionData:
    """Read the .json files of Northwestern-UCLA.

    Views 1 and 2 are for training, 3 is for tests. 12 frames/s are assumed.

    For example:
        ehar data prepare nwucla nw-ucla nwucla.npz

    Args:
        source: folder of the files.
        unit: unit of length in the files: m, cm, mm, or a number of metres.
        up: axis that points up in the files.

    Raises:
        DataError: a name is not of this set, or a file does not hold 20 joints a frame.
    """
    files = matching_files(source, ".json", "the skeletons of NW-UCLA, such as a01_s01_e00_v01.json")

    def clips() -> Iterator[Clip]:
        for file in files:
            match = _NAME.fullmatch(file.stem)
            if match is None or int(match["action"]) not in ACTIONS:
                expected = f"expected one as a01_s01_e00_v01.json, of action {', '.join(map(str, ACTIONS))}"
                raise DataError(f"{file}: got a name that is not of NW-UCLA, {expected}")
            yield Clip(
                file=file,
                name=file.stem,
                label=ACTIONS[int(match["action"])],
                motion=upright(read_skeletons(file), unit=unit, up=up, of_camera=True)[:, None],
                is_test=int(match["view"]) == TEST_VIEW,
                subject=int(match["person"]),
                view=int(match["view"]),
            )

    return assemble(
        clips(),
        name="nwucla",
        skeleton=KINECT20,
        fps=FPS,
        license="none stated: Northwestern-UCLA Multiview Action3D (Wang et al., CVPR 2014), research use",
        class_order=tuple(ACTIONS.values()),
        notes=(f"{FPS:g} frames/s are assumed, as the authors state no rate; --fps sets another",),
    )


def read_skeletons(file: Path) -> FloatArray:
    """Return the joints (T, 20, 3) of one file, in its own unit and axes.

    Raises:
        DataError: the file is not JSON, or holds anything but finite numbers of this shape.
    """
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise DataError(f"{file}: expected JSON, got {' '.join(str(error).split())}") from error
    held = content.get("skeletons") if isinstance(content, dict) else None
    if held is None:
        raise DataError(f"{file}: skeletons: missing, expected an object that holds them")
    try:
        joints = np.array(held, dtype=np.float64)
    except (ValueError, TypeError, OverflowError) as error:
        raise DataError(
            f"{file}: skeletons: expected 20 joints of 3 numbers in every frame, got a ragged list or no such number"
        ) from error
    if joints.ndim != 3 or joints.shape[1:] != (20, 3) or not len(joints):
        raise DataError(f"{file}: skeletons: got shape {joints.shape}, expected (frames, 20, 3)")
    wrong = np.flatnonzero(~np.isfinite(joints).all(axis=(1, 2)))
    if wrong.size:
        raise DataError(f"{file}: skeletons: got NaN or infinite in frame {wrong[0]}, expected metres")
    return joints
