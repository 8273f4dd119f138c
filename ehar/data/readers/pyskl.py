"""Annotation pickles of pyskl: a dict of `split` and `annotations`, as for NTU RGB+D's 3D joints.

Each annotation has `frame_dir` (its name), `label` (a number) and `keypoint`, (people, frames, joints, 3). Files of 2D
keypoints are refused: a camera that moves around people needs their joints in space.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.motion_data import MotionData
from ehar.data.preparing.axes import Up, upright
from ehar.data.preparing.gaps import without_empty_bodies
from ehar.data.preparing.layouts import Layout, layout_of
from ehar.data.readers.assembly import Clip, assemble
from ehar.data.readers.pickles import load_arrays
from ehar.errors import DataError

FPS = 30.0  # assumed; that of NTU RGB+D


def prepare_pyskl(
    source: str | Path,
    *,
    split: str | None = None,
    classes: Path | None = None,
    joints: Layout = "ntu25",
    persons: int = 1,
    unit: str = "m",
    up: Up = "y",
) -> MotionData:
    """Read an annotation pickle of pyskl with 3D joints.

    Nothing in it is executed. Sequences with fewer people are left out.

    For example:
        ehar data prepare pyskl ntu60_3danno.pkl ntu.npz --split xsub

    Args:
        source: the .pkl.
        split: split in the file: xsub takes xsub_train for training, xsub_val or xsub_test for tests; what is in
            neither is left out.
        classes: text file with the name of each class, one a line.
        joints: layout of the joints in the file.
        persons: people of a sequence: those who move most.
        unit: unit of length in the file: m, cm, mm, or a number of metres.
        up: axis that points up in the file.

    Raises:
        DataError: the file is no annotation pickle, holds no 3D joints, or has no such split.
    """
    file = Path(source)
    if not file.is_file():
        raise DataError(f"{file}: no such file; expected an annotation pickle of pyskl")
    content = load_arrays(file)
    annotations = content.get("annotations") if isinstance(content, dict) else None
    if not isinstance(annotations, list) or not annotations:
        raise DataError(f"{file}: annotations: missing, expected a dict with a list of them, and `split`")
    tests = None if split is None else _sides(file, content.get("split"), split)
    names = _class_names(classes)
    layout = layout_of(joints)

    def clips() -> Iterator[Clip]:
        for index, annotation in enumerate(annotations):
            where = f"{file}: annotation {index}"
            name = annotation.get("frame_dir") if isinstance(annotation, dict) else None
            if not isinstance(name, str):
                raise DataError(f"{where}: frame_dir: missing, expected the name of the sequence")
            label = annotation.get("label")
            if not isinstance(label, int | np.integer) or label < 0 or (names and label >= len(names)):
                expected = f"a number from 0 to {len(names) - 1}" if names else "a number from 0"
                raise DataError(f"{where}, {name}: label: got {label!r}, expected {expected}")
            if tests is not None and name not in tests:
                continue
            motion = upright(_keypoint(f"{where}, {name}", annotation, len(layout.joint_names)), unit=unit, up=up)
            yield Clip(
                file=file,
                name=name,
                label=names[label] if names else f"class_{label:03}",
                motion=without_empty_bodies(np.moveaxis(motion, 0, 1)),
                is_test=None if tests is None else tests[name],
            )

    return assemble(
        clips(),
        name=file.stem,
        skeleton=layout,
        fps=FPS,
        license="unknown: that of the data set that was annotated",
        persons=persons,
        class_order=names,
        notes=(f"{FPS:g} frames/s are assumed, as the file states no rate; --fps sets another",),
    )


def _keypoint(where: str, annotation: Mapping[str, Any], joints: int) -> FloatArray:
    """Return the joints (people, T, joints, 3) of an annotation."""
    held = annotation.get("keypoint")
    if not isinstance(held, np.ndarray):
        hint = "Kinetics has them in files of their own, in 2D"
        raise DataError(f"{where}: keypoint: missing, expected an array (people, frames, joints, 3); {hint}")
    if held.ndim == 4 and held.shape[-1] == 2:
        raise DataError(f"{where}: keypoint: got 2D joints, expected 3D: cameras move around joints in space")
    if held.dtype.kind != "f" or held.ndim != 4 or held.shape[2:] != (joints, 3) or 0 in held.shape:
        expected = f"expected floats (people, frames, {joints}, 3); --joints names another layout"
        raise DataError(f"{where}: keypoint: got {held.dtype} of shape {held.shape}, {expected}")
    if np.isinf(held).any():
        raise DataError(f"{where}: keypoint: got infinite, expected metres")
    return held.astype(np.float64)


def _sides(file: Path, splits: Any, split: str) -> dict[str, bool]:
    """Return whether each sequence of a split is for tests."""
    held = splits if isinstance(splits, dict) else {}
    train = held.get(f"{split}_train")
    test = held.get(f"{split}_val", held.get(f"{split}_test"))
    if not isinstance(train, list) or not isinstance(test, list):
        known = ", ".join(sorted(str(name) for name in held)) or "none"
        raise DataError(f"{file}: split: expected {split}_train, and {split}_val or {split}_test, got {known}")
    if not all(isinstance(name, str) for name in (*train, *test)):
        raise DataError(f"{file}: split: {split}: expected names of sequences only")
    return {**dict.fromkeys(train, False), **dict.fromkeys(test, True)}


def _class_names(file: Path | None) -> tuple[str, ...]:
    if file is None:
        return ()
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError) as error:
        raise DataError(f"{file}: expected a text file with a class a line, got {error}") from error
    names = tuple(line.strip() for line in lines if line.strip())
    if not names or len(set(names)) < len(names):
        raise DataError(f"{file}: got {len(names)} classes, expected at least one, and all different")
    return names
