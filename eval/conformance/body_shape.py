"""Whether bodies have a person's size, and bones keep their lengths."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import shortest_path

from ehar.arrays import FloatArray
from ehar.data.preparing.axes import UNITS, metres
from ehar.data.recordings import Recordings
from eval.conformance.advice import ReadWith
from eval.conformance.checks import FEW, ContractCheck

SHORTEST, LONGEST = 0.5, 4.0  # [m] the longest way along bones; a child of 5 has 1.4, a tall adult 2.7
PERSON = (0.9, 3.0)  # [m] the same, for naming the unit that files have
NOISY, BROKEN = 0.3, 0.8  # how far bones spread, relative to their lengths; depth cameras have up to 0.4
_UNIT_NAMES: Mapping[str, str] = {"m": "metres", "cm": "centimetres", "mm": "millimetres"}


@dataclass(frozen=True, eq=False)
class Bodies:
    """The measures of each body: each person of each sequence.

    Args:
        size: (sequences, P) the longest way along bones, of median lengths [m].
        spread: (sequences, P, bones) from the 5th to the 95th percentile of a bone's length [m].
        length: (sequences, P, bones) median lengths [m].
    """

    size: FloatArray
    spread: FloatArray
    length: FloatArray


def measured(data: Recordings) -> Bodies:
    """Measure bodies sequence by sequence, which also keeps memory low."""
    start, end = data.skeleton.bone_indices.T
    joints = len(data.skeleton.joint_names)
    sizes, spreads, lengths = [], [], []
    for index in range(len(data.lengths)):
        motion = data.sequence(index)
        bones = np.linalg.norm(motion[:, :, start] - motion[:, :, end], axis=-1)
        low, median, high = np.percentile(bones, [5, 50, 95], axis=0)
        graph = np.zeros((data.persons, joints, joints))
        graph[:, start, end] = np.maximum(median, 1e-9)  # 0 would be no bone
        ways = np.array([shortest_path(person, directed=False) for person in graph])
        sizes.append(np.where(np.isfinite(ways), ways, 0).max(axis=(1, 2)))
        spreads.append(high - low)
        lengths.append(median)
    return Bodies(np.array(sizes), np.array(spreads), np.array(lengths))


def check_size(data: Recordings, bodies: Bodies, given: ReadWith) -> ContractCheck:
    """Check that bodies are as large as people, and else name the unit in which they would be."""
    name = "bones of human size"
    there = bodies.size > 1e-6
    if not there.any():
        return ContractCheck(name, None, "as nobody is there")
    typical = float(np.median(bodies.size[there]))
    outside = np.asarray((there & ((bodies.size < SHORTEST) | (bodies.size > LONGEST))).any(axis=1))
    others = int(outside.sum()) - 1
    told = f"{typical:.3g} m along the bones from end to end"
    if outside.mean() > 1 - FEW:
        raw = typical / metres(given.unit)
        fitting = [unit for unit, length in UNITS.items() if PERSON[0] <= raw * length <= PERSON[1]]
        mend = given.mend(f"--unit {fitting[0]}") if fitting else given.mend("--unit METRES, the unit in metres")
        named = f": lengths look like {_UNIT_NAMES[fitting[0]]}" if fitting else ""
        return ContractCheck(name, False, f"{told}{named}", f"{SHORTEST:g} to {LONGEST:g} m", mend)
    if outside.any():
        sequence = int(outside.argmax())
        got = f"{bodies.size[sequence].max():.3g} m in sequence {data.sequence_names[sequence]!r}"
        got += f", and {others} more sequences" if others else ""
        if outside.mean() > FEW:
            expected = f"{SHORTEST:g} to {LONGEST:g} m, as in {len(outside) - others - 1} sequences"
            return ContractCheck(name, False, got, expected, "prepare files of different units one by one")
        return ContractCheck(f"{name}: {told}", True, got, doubtful=True)
    return ContractCheck(f"{name}: {told}", True)


def check_steadiness(data: Recordings, bodies: Bodies) -> ContractCheck:
    """Check that bones keep their lengths in a sequence; else axes or joints are in another order."""
    total = bodies.length.sum(axis=-1)
    spread = np.median((bodies.spread.sum(axis=-1) / np.maximum(total, 1e-9))[total > 1e-6]) if total.any() else 0.0
    relative = np.median(bodies.spread / np.maximum(bodies.length, 1e-9), axis=(0, 1))
    bone = data.skeleton.bones[int(relative.argmax())]
    worst = " to ".join(data.skeleton.joint_names[joint] for joint in bone)
    name = f"bones keep their lengths: they vary by {100 * spread:.0f} % within a sequence"
    got = f"most from {worst}, by {100 * relative.max():.0f} %"
    if spread > BROKEN:
        mend = "look at the order of axes and joints, and at `bones`: `ehar data describe --figure` draws them"
        return ContractCheck(
            "bones keep their lengths",
            False,
            f"they vary by {100 * spread:.0f} % within a sequence, {got}",
            f"at most {100 * BROKEN:.0f} %",
            mend,
        )
    return ContractCheck(name, True, f"noisy tracking, {got}" if spread > NOISY else "", doubtful=bool(spread > NOISY))
