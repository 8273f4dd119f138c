"""Files of the formats that readers read, written from people who are known."""

import json
import pickle
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
from scipy.io import savemat

from ehar.arrays import FloatArray
from ehar.data.motion_data import MotionData
from ehar.data.preparing.layouts import BODY12, KINECT20, NTU25, SMPL22
from ehar.data.preparing.mapping import joint_sources
from ehar.data.readers.utd_mhad import _ORDER
from ehar.data.skeleton import Skeleton
from ehar.data.source import load_data

FRAMES = 60


@cache
def _solo() -> MotionData:
    return load_data("solo")


@cache
def walker(skeleton: Skeleton) -> FloatArray:
    """Return somebody of `solo` with the joints of another skeleton, (T, J, 3) [m], z up.

    A joint that `solo` does not have, such as a thumb, is where the one before it on the body is.
    """
    data = _solo()
    motion = data.sequence(0)[:FRAMES, 0].astype(np.float64)
    sources = joint_sources(data.skeleton.joint_names, skeleton.joint_names)
    before = {child: parent for parent, child in skeleton.bones}
    places = []
    for joint in range(len(skeleton.joint_names)):
        while not sources[joint]:
            joint = before[joint]
        places.append(motion[:, sources[joint]].mean(axis=1))
    return np.stack(places, axis=1)


def ntu(folder: Path, joints: FloatArray) -> None:
    lines = [str(len(joints))]
    for body in joints:
        lines += ["1", "72057594037931101 0 1 1 1 1 0 0.02 0.05 2", "25"]
        lines += [" ".join(map(str, (*place, *range(8), 2))) for place in body.tolist()]
    (folder / "S001C001P001R001A001.skeleton").write_text("\n".join(lines) + "\n")


def nwucla(folder: Path, joints: FloatArray) -> None:
    (folder / "a01_s01_e00_v01.json").write_text(json.dumps({"skeletons": joints.tolist(), "label": 1}))


def utd_mhad(folder: Path, joints: FloatArray) -> None:
    held = np.empty((20, 3, len(joints)))
    held[_ORDER] = np.moveaxis(joints, 0, 2)
    savemat(folder / "a1_s1_t1_skeleton.mat", {"d_skel": held})


def humanml3d(folder: Path, joints: FloatArray) -> None:
    for name in ("new_joints", "texts"):
        (folder / name).mkdir()
    np.save(folder / "new_joints" / "000001.npy", joints.astype(np.float32))
    (folder / "texts" / "000001.txt").write_text("a man walks.#a/DET man/NOUN walk/VERB#0.0#0.0\n")


def pyskl(folder: Path, joints: FloatArray) -> None:
    annotation = {"frame_dir": "S1", "label": 0, "keypoint": joints[None].astype(np.float32)}
    (folder / "a.pkl").write_bytes(pickle.dumps({"annotations": [annotation]}))


def npy(folder: Path, joints: FloatArray) -> None:
    np.save(folder / "walk_1.npy", joints)
    _describe(folder)


def csv(folder: Path, joints: FloatArray) -> None:
    np.savetxt(folder / "walk_1.csv", joints.reshape(len(joints), -1), delimiter=",")
    _describe(folder)


def _describe(folder: Path) -> None:
    told = {"joints": "body12", "fps": 60, "pattern": "{label}_{number}.{ending}"}
    (folder / "ehar.json").write_text(json.dumps(told))


def c3d(folder: Path, joints: FloatArray) -> None:
    import ezc3d  # imported here: an extra

    made = ezc3d.c3d()
    points = np.ones((4, joints.shape[1], len(joints)))
    points[:3] = joints.transpose(2, 1, 0)
    told = {"RATE": [60.0], "UNITS": ["mm"], "LABELS": list(BODY12.joint_names)}
    for name, value in told.items():
        made["parameters"]["POINT"][name]["value"] = value
    made["data"]["points"] = points
    made.write(str(folder / "walk_1.c3d"))


# The reader, what writes its files, their joints, and their own unit and axis up.
FORMATS: dict[str, tuple[str, Callable[[Path, FloatArray], None], Skeleton, str, str]] = {
    "ntu": ("ntu", ntu, NTU25, "m", "y"),
    "nwucla": ("nwucla", nwucla, KINECT20, "m", "y"),
    "utd-mhad": ("utd-mhad", utd_mhad, KINECT20, "m", "y"),
    "humanml3d": ("humanml3d", humanml3d, SMPL22, "m", "y"),
    "pyskl": ("pyskl", pyskl, NTU25, "m", "y"),
    "npy": ("arrays", npy, BODY12, "m", "z"),
    "csv": ("arrays", csv, BODY12, "m", "z"),
    "c3d": ("c3d", c3d, BODY12, "mm", "z"),
}
