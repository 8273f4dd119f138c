"""Whether bodies move as fast as people do, and no joint jumps."""

import numpy as np

from ehar.data.recordings import Recordings
from eval.conformance.advice import ReadWith
from eval.conformance.checks import ContractCheck

SLOWEST, FASTEST = 0.1, 15.0  # [m/s] of the fastest joint in the fastest tenth of frames; sets have 1.7 to 3.7
RATES = (4.0, 250.0)  # [1/s]
JUMP = 1.0  # [m] from a joint to the middle of where it is a frame before and a frame after; in sets up to 0.8
HARDEST = 100.0  # [m/s^2], which allows more than that below 8 frames a second


def check_rate(data: Recordings, given: ReadWith) -> ContractCheck:
    """Check the speed of the fastest joint, which a wrong rate or unit changes."""
    name = "people move as fast as people do"
    speeds = []
    for index in range(len(data.lengths)):
        motion = data.sequence(index)
        if len(motion) > 1:
            steps = np.linalg.norm(np.diff(motion, axis=0), axis=-1).max(axis=(1, 2))
            speeds.append(float(np.percentile(steps, 90)) * data.fps)
    if not speeds:
        return ContractCheck(name, None, "no sequence has two frames")
    speed = float(np.median(speeds))
    told = f"the fastest joint moves at {speed:.2g} m/s at {data.fps:g} frames/s"
    if SLOWEST <= speed <= FASTEST and RATES[0] <= data.fps <= RATES[1]:
        return ContractCheck(f"{name}: {told}", True)
    expected = f"{SLOWEST:g} to {FASTEST:g} m/s, and {RATES[0]:g} to {RATES[1]:g} frames/s"
    return ContractCheck(name, False, told, expected, given.mend("--fps RATE, once the unit is right"))


def check_jumps(data: Recordings) -> ContractCheck:
    """Check that no joint is elsewhere for a single frame, as where a tracker took something else for it."""
    limit = max(JUMP, HARDEST / data.fps**2 / 2)
    frames, farthest, told = 0, limit, ""
    for index in range(len(data.lengths)):
        motion = data.sequence(index)
        if len(motion) < 3:
            continue
        off = np.linalg.norm(motion[1:-1] - (motion[:-2] + motion[2:]) / 2, axis=-1)  # (T - 2, P, J)
        around = np.pad(off, ((1, 1), (0, 0), (0, 0)))  # a jump shows half in the frames around it, which do not count
        jumps = (off > limit) & (off >= np.maximum(around[:-2], around[2:]))
        frames += int(jumps.any(axis=(1, 2)).sum())
        if off.max() > farthest:
            farthest = float(off.max())
            frame, _, joint = np.unravel_index(int(off.argmax()), off.shape)
            sequence, name = data.sequence_names[index], data.skeleton.joint_names[int(joint)]
            told = f"{name} by {farthest:.2g} m in frame {int(frame) + 1} of sequence {sequence!r}"
    if not frames:
        return ContractCheck("no joint is elsewhere for a single frame", True)
    share = frames / len(data.positions)
    return ContractCheck(f"joints jump in {100 * share:.2g} % of frames", True, f"farthest {told}", doubtful=True)
