"""The conformance kit of motions, which carry cameras: it uses random starts and targets."""

import time
from collections.abc import Callable
from copy import deepcopy
from functools import partial
from pathlib import Path
from typing import NamedTuple

import cloudpickle
import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.conditions import Conditions
from ehar.flight.vehicle import Vehicle
from ehar.motion import Motion
from ehar.plugins.blame import blamed
from ehar.rollout import finite_rates, finite_viewpoints
from ehar.track import load_track
from ehar.viewpoint import AZIMUTH, Workspace, wrap_difference
from ehar.world import World, load_world
from eval.conformance.checks import Conformance, ContractCheck, attempt, first_difference
from eval.conformance.world import BATCH
from recognition.setting import load_motion_of

TOLERANCE = 1e-6  # [m], [rad]: batches of another size may differ by rounding
LENGTH = 40  # frames
HELD = 10  # frames for which a target is held
ALL, OTHERS = np.arange(BATCH), np.arange(BATCH, 2 * BATCH)
_RESET = "create in `reset` everything that `advance` changes"
_ROWS = "compute every row from its own row: no statistics over axis 0"
_SHAPES = "finite arrays (B, 3): distance [m], azimuth [rad], polar angle [rad], and their rates"


class Way(NamedTuple):
    """The viewpoints and rates of cameras in each frame, (T, B, 3) each."""

    viewpoint: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


class Errand(NamedTuple):
    """The starts (B, 3) and the targets (T, B, 3) of cameras."""

    starts: FloatArray
    targets: FloatArray

    def rows(self, rows: IntArray) -> "Errand":
        """Return some of the episodes."""
        return Errand(self.starts[rows], self.targets[:, rows])


def check_motion(motion: str | Path | Vehicle | Motion, conditions: Conditions | None = None) -> Conformance:
    """Check that a motion keeps the contract of `ehar.motion`.

    Args:
        motion: an object, or a value of `ehar benchmark --track`.
        conditions: conditions whose data give the duration of a frame, and their world; None takes the defaults.

    Raises:
        EharError: the motion cannot be made, or data cannot be loaded.
    """
    conditions = conditions or Conditions()
    world = load_world(conditions.world)
    track = load_track(motion, world.workspace)
    frame_time = 1 / load_motion_of(conditions).fps
    make = partial(track.new_motion, world.workspace)
    errand = _errand(make().workspace, world)
    return Conformance(f"motion {track.named}", tuple(_checks(make, errand, frame_time)))


def _errand(workspace: Workspace, world: World) -> Errand:
    """Return random starts in the workspace, and random targets, held for some frames each; some are outside of it."""
    rng = np.random.default_rng(0)
    count = 2 * BATCH
    low = [workspace.distance_min, 0.0, workspace.polar_min]
    high = [workspace.distance_max, 2 * np.pi, workspace.polar_max]
    goals = rng.uniform(low, high, (LENGTH // HELD, count, 3))
    goals[:, ::3, 0] += 5.0  # [m]; planners may ask for viewpoints outside of the workspace
    return Errand(workspace.clip(world.sample_starts(rng, count)), np.repeat(goals, HELD, axis=0))


def _checks(make: Callable[[], Motion], errand: Errand, frame_time: float) -> list[ContractCheck]:
    """Return all checks; all others need the first one."""
    changed: set[str] = set()
    mine = errand.rows(ALL)

    def begin(motion: Motion, starts: FloatArray) -> FloatArray:
        handed = starts.copy()
        with blamed(motion, "reset"):
            motion.reset(handed, frame_time)
        if not np.array_equal(handed, starts):
            changed.add("the viewpoints of reset")
        return handed

    def advance(motion: Motion, target: FloatArray, frame: int) -> FloatArray:
        handed = target.copy()
        with blamed(motion, f"advance, frame {frame}"):
            reached = motion.advance(handed)
        if not np.array_equal(handed, target):
            changed.add("the targets of advance")
        return finite_viewpoints(reached, len(target), f"frame {frame}")

    def move(motion: Motion, targets: FloatArray) -> Way:
        """Move for T frames; return arrays (T, B, 3)."""
        seen = []
        for frame, target in enumerate(targets):
            reached = advance(motion, target, frame)
            seen.append((reached, *(finite_rates(motion, name, len(target), frame) for name in _RATES)))
        return Way(*(np.stack(arrays) for arrays in zip(*seen, strict=True)))

    def run(rows: Errand, motion: Motion | None = None) -> Way:
        body = make() if motion is None else motion
        begin(body, rows.starts)
        return move(body, rows.targets)

    ways: list[Way] = []
    first = attempt(
        f"carries a batch of {BATCH} to viewpoints ({BATCH}, 3), with velocities and accelerations",
        lambda: ways.append(run(mine)),
        expected=_SHAPES,
        mend="return where the cameras are after the frame, one row an episode; a rate may be 0 for all",
    )
    if not ways:
        return [first, ContractCheck("all else", None, "as it does not run")]
    way, workspace = ways[0], make().workspace

    def at_rest() -> str | None:
        motion = make()
        starts = begin(motion, mine.starts)
        for name in _RATES:
            rates = finite_rates(motion, name, BATCH, 0)
            if np.abs(rates).max() > TOLERANCE:
                return f"{name} of up to {np.abs(rates).max():.4g} after reset"
        reached = advance(motion, starts, 0)
        off, step = _errors(reached, starts), motion.workspace.step
        worst = int((off / step).max(axis=1).argmax())
        if (off[worst] <= step / 2 + TOLERANCE).all():
            return None
        return f"row {worst} moved from {_text(starts[worst])} to {_text(reached[worst])}, told to stay there"

    def inside() -> str | None:
        outside = ~workspace.contains(way.viewpoint)
        if not outside.any():
            return None
        frame, row = (int(index) for index in np.argwhere(outside)[0])
        return f"{_text(way.viewpoint[frame, row])} in row {row} after frame {frame}"

    def approached() -> str | None:
        motion = make()
        starts = begin(motion, mine.starts)
        goal = workspace.clip(mine.targets[0])
        reached = move(motion, np.repeat(goal[None], LENGTH, axis=0)).viewpoint[-1]
        span = np.array([workspace.distance_max - workspace.distance_min, np.pi, workspace.polar_max])
        before, after = ((_errors(views, goal) / span).sum(axis=1) for views in (starts, reached))
        near = (_errors(reached, goal) <= workspace.step / 2 + TOLERANCE).all(axis=1)
        astray = ~near & (after >= before)
        if not astray.any():
            return None
        row = int(astray.argmax())
        return f"row {row} went from {_text(starts[row])} to {_text(reached[row])} in {LENGTH} frames"

    def second_time() -> str | None:
        motion = make()
        run(errand.rows(OTHERS), motion)
        return _difference(way, run(mine, motion), ("when new", "after it ran other episodes"), 0.0)

    def rows_alone() -> str | None:
        names = (f"in a batch of {BATCH}", "in another order")
        backwards = run(mine.rows(ALL[::-1]))
        difference = _difference(way, _rows(backwards, ALL[::-1]), names, TOLERANCE)
        if difference is None:
            mixed = run(errand.rows(np.where(ALL % 2 == 0, ALL, OTHERS)))
            even = ALL[::2]
            others = ("beside some episodes", "beside others")
            difference = _difference(_rows(way, even), _rows(mixed, even), others, TOLERANCE)
        return difference or _difference(_rows(way, ALL[:1]), run(mine.rows(ALL[:1])), (names[0], "alone"), TOLERANCE)

    def copied() -> str | None:
        for name, copy_of in _COPIES.items():
            motion = make()
            begin(motion, mine.starts)
            half = LENGTH // 2
            move(motion, mine.targets[:half])
            try:
                copy = copy_of(motion)
            except (Exception, SystemExit) as error:
                return f"{name}: {type(error).__name__}: {error}"
            move(motion, mine.targets[:half])  # this must not move the copy
            rest = Way(*(array[half:] for array in way))
            names = ("by itself", f"as a copy, by {name}, of the first half")
            difference = _difference(rest, move(copy, mine.targets[half:]), names, TOLERANCE)
            if difference is not None:
                return difference
        return None

    def alone() -> None:
        run(mine.rows(ALL[:1]))

    return [
        first,
        attempt(
            "carries a batch of 1",
            alone,
            expected=_SHAPES,
            mend="do not squeeze arrays: a batch of one episode has a leading 1",
        ),
        attempt(
            "begins at rest at the start, and stays where it is told to stay",
            at_rest,
            expected="velocity and acceleration 0 after reset, then at most half a step of the grid from the start",
            mend="in `reset`, keep a copy of the viewpoints, and begin at rest",
        ),
        attempt(
            "stays within its workspace",
            inside,
            expected=f"viewpoints within {workspace}",
            mend="`self.workspace.clip(target)` brings targets into it",
        ),
        attempt(
            "approaches a target that is held",
            approached,
            expected=f"nearer to the target after {LENGTH} frames, or within half a step of the grid",
            mend="azimuths are angles: `ehar.viewpoint.wrap_difference` gives the short way round",
        ),
        attempt(
            "does the same twice",
            lambda: _difference(way, run(mine), ("at first", "the second time"), 0.0),
            expected="equal viewpoints from two new motions",
            mend="draw nothing at random, and do not look at the time",
        ),
        attempt(
            "forgets all in reset",
            second_time,
            expected="the same viewpoints when one motion runs the same episodes again",
            mend=_RESET,
        ),
        attempt(
            "rows alone, beside others, and in another order, move the same",
            rows_alone,
            expected=f"the same within {TOLERANCE}",
            mend=_ROWS,
        ),
        attempt(
            "leaves what it is handed as it is",
            lambda: f"{' and '.join(sorted(changed))} changed" if changed else None,
            expected="starts and targets that nobody changes",
            mend="work on a copy: `np.array(viewpoint)`",
        ),
        attempt(
            "can be copied, and sent to a worker process",
            copied,
            expected="an object that copy.deepcopy and cloudpickle can copy, and copies that move as the original does",
            mend="hold no open files, locks or generators, and nothing that copies share",
        ),
        _time(make, mine, frame_time),
    ]


_RATES = ("velocity", "acceleration")
_COPIES: dict[str, Callable[[Motion], Motion]] = {
    "copy.deepcopy": deepcopy,
    "cloudpickle": lambda motion: cloudpickle.loads(cloudpickle.dumps(motion)),
}


def _errors(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the differences of viewpoints in each coordinate, (B, 3); those of azimuths go the short way round."""
    errors = one - other
    errors[..., AZIMUTH] = wrap_difference(errors[..., AZIMUTH])
    return np.asarray(np.abs(errors))


def _rows(way: Way, rows: IntArray) -> Way:
    return Way(*(array[:, rows] for array in way))


def _difference(one: Way, other: Way, names: tuple[str, str], tolerance: float) -> str | None:
    """Return in words where two ways first differ; None if they do not."""
    for what, a, b in zip(Way._fields, one, other, strict=True):
        difference = first_difference(a, b, names, tolerance=tolerance, what=what)
        if difference is not None:
            return difference
    return None


def _text(viewpoint: FloatArray) -> str:
    return np.array2string(viewpoint, precision=4)


def _time(make: Callable[[], Motion], errand: Errand, frame_time: float) -> ContractCheck:
    motion = make()
    motion.reset(errand.starts.copy(), frame_time)
    begin = time.perf_counter()
    for target in errand.targets:
        motion.advance(target.copy())
    milliseconds = 1000 * (time.perf_counter() - begin) / errand.targets[..., 0].size
    return ContractCheck(f"takes {milliseconds:.3g} ms for one frame of one episode, {BATCH} at a time", True)
