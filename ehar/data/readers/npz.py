"""A prepared .npz, read again: to mend its unit, its axes or its gaps, or to map its joints."""

from itertools import pairwise
from pathlib import Path

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.file_fields import BOOL, FLOAT, INTEGER, Array, Fields, read_arrays
from ehar.data.motion_data import MotionData
from ehar.data.motion_file import SCHEMA, parse_motion
from ehar.data.preparing.axes import Up, upright
from ehar.data.preparing.gaps import without_empty_bodies
from ehar.data.preparing.layouts import Layout, layout_of
from ehar.data.readers.bodies import most_moving
from ehar.errors import DataError, UsageError


def prepare_npz(
    source: str | Path,
    *,
    unit: str = "m",
    up: Up = "z",
    joints: Layout | None = None,
    persons: int | None = None,
) -> MotionData:
    """Read a prepared .npz again, to mend it.

    NaN becomes gaps that are filled, and so do bodies whose joints are all 0.

    For example:
        ehar data prepare npz mine.npz mended.npz --unit mm --up y
        ehar data prepare npz mine.npz body12.npz --skeleton body12

    Args:
        source: the file.
        unit: unit of length in the file: m, cm, mm, or a number of metres.
        up: axis that points up in the file.
        joints: layout whose names and bones its joints have, in order.
        persons: number of people to keep in a sequence: those who move most. Sequences with fewer are left out.

    Raises:
        UsageError: an option has a wrong value.
        DataError: the file breaks the format in another way.
    """
    path = Path(source)
    arrays = read_arrays(path, SCHEMA)
    fields = Fields(str(path), arrays)
    held = fields.get("positions", FLOAT, "total_frames", "persons", "joints", 3)
    positions = without_empty_bodies(upright(held, unit=unit, up=up, of_camera="views" in arrays))
    arrays["positions"] = positions
    if "missing" in arrays:
        fields.get("missing", BOOL, len(positions))
    notes: tuple[str, ...] = ()
    if joints is not None:
        layout = layout_of(joints)
        if positions.shape[2] != len(layout.joint_names):
            expected = f"expected {len(layout.joint_names)} of {joints}"
            raise DataError(f"{path}: positions: got {positions.shape[2]} joints, {expected}")
        arrays |= {"joint_names": np.array(layout.joint_names), "bones": layout.bone_indices}
    if persons is not None:
        if persons < 1:
            raise UsageError(f"persons: got {persons}, expected at least 1")
        notes = _keep_persons(fields, arrays, positions, persons)
    lost = np.logical_not(np.isfinite(arrays["positions"]).all(axis=(1, 2, 3)))
    if lost.any():
        arrays["missing"] = lost | arrays.get("missing", False)
    return parse_motion(Fields(str(path), arrays), name=path.stem, notes=notes)


def _keep_persons(fields: Fields, arrays: dict[str, Array], positions: FloatArray, persons: int) -> tuple[str, ...]:
    """Keep some people of each sequence in the arrays, and return what to tell of it."""
    offsets = fields.get("offsets", INTEGER, "sequences")
    count = len(offsets) - 1
    if not (offsets[0] == 0 and (np.diff(offsets) > 0).all() and offsets[-1] == len(positions)):
        return ()  # parse_motion tells what is wrong
    found = [most_moving(positions[a:b], persons) for a, b in pairwise(offsets)]
    kept = np.array([motion is not None for motion in found])
    motions = [motion for motion in found if motion is not None]
    if not motions:
        raise DataError(f"{fields.where}: positions: got no sequence of {persons} people")
    if persons < positions.shape[1] and np.ndim(arrays.get("subjects", 0)) == 2:
        del arrays["subjects"]  # nobody says who of them was kept
    for name in ("labels", "sequence_names", "split", "subjects", "views", "recorded_ms"):
        if name in arrays and arrays[name].shape[:1] == (count,):
            arrays[name] = arrays[name][kept]
    if "missing" in arrays:
        arrays["missing"] = arrays["missing"][np.repeat(kept, np.diff(offsets))]
    arrays["positions"] = np.concatenate(motions)
    arrays["offsets"] = np.cumsum([0, *map(len, motions)])
    left_out = count - int(kept.sum())
    return (f"{left_out} of {count} sequences show fewer than {persons} people, and are left out",) if left_out else ()
