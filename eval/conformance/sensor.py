"""The conformance kit of sensors: it uses a few episodes."""

import time
from collections.abc import Callable
from typing import NamedTuple

import cloudpickle
import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.batch import Batch
from ehar.conditions import Conditions
from ehar.data.motion_data import MotionData
from ehar.sensors.registry import load_sensor
from ehar.sensors.sensing import sense
from ehar.sensors.sensor import Sensed, Sensor, SensorNoise
from ehar.world import World, load_world
from eval.conformance.checks import Conformance, ContractCheck, attempt, first_difference
from eval.conformance.world import BATCH, other_future, small_batch
from recognition.setting import load_motion_of

TOLERANCE = 0.01  # [px], and for confidence too: batches of another size may differ by rounding
FORKS = 3
ALL = np.arange(BATCH)
_NOISE = "use the draws in `noise` alone, not np.random or your own generator, and keep nothing in `self`"
_ROWS = "compute every row from its own row: no statistics over leading axes"
_FUTURE = "compute every frame from its own joints, viewpoint and draws: nothing that lies ahead or was seen before"


class Shown(NamedTuple):
    """The inputs of a sensor."""

    positions: FloatArray  # (..., P, J, 3)
    viewpoint: FloatArray  # (..., 3)
    noise: SensorNoise

    def at(self, index: object) -> "Shown":
        """Return copies of a part, by an index of the leading axes."""
        arrays = (self.positions, self.viewpoint, *self.noise)
        positions, viewpoint, *noise = (array[index].copy() for array in arrays)  # type: ignore[call-overload]
        return Shown(positions, viewpoint, SensorNoise(*noise))

    def arrays(self) -> dict[str, FloatArray]:
        """Return all arrays by name."""
        return {"positions": self.positions, "viewpoint": self.viewpoint, **self.noise._asdict()}


def check_sensor(sensor: str | Sensor, conditions: Conditions | None = None) -> Conformance:
    """Check that a sensor keeps the contract of `ehar.sensors.sensor`.

    Args:
        sensor: an object, or a value of `ehar benchmark --sensor`.
        conditions: conditions of the test episodes; None takes the defaults.

    Raises:
        EharError: the sensor cannot be made, or data cannot be loaded.
    """
    conditions = conditions or Conditions()
    data, world = load_motion_of(conditions), load_world(conditions.world)
    loaded = load_sensor(sensor, data, world)
    return Conformance(f"sensor {loaded.named}", tuple(_checks(loaded.sensor, _episodes(data, world))))


def _episodes(data: MotionData, world: World) -> Shown:
    """Return 7 episodes (B, T, ...) of people, from cameras that move at random."""
    from recognition.training.views import training_viewpoints  # brings torch

    batch: Batch = small_batch(data, world).select(ALL)
    episodes, length = batch.positions.shape[:2]
    viewpoints = training_viewpoints("moving", world, np.random.default_rng(0), episodes, length)
    return Shown(batch.positions, viewpoints, batch.noise)


def _checks(sensor: Sensor, clip: Shown) -> list[ContractCheck]:
    """Return all checks; all others need the first one."""
    changed: set[str] = set()
    _, length, persons, joints, _ = clip.positions.shape
    half = length // 2

    def see(shown: Shown, by: Sensor = sensor) -> Sensed:
        handed = Shown(shown.positions.copy(), shown.viewpoint.copy(), SensorNoise(*(d.copy() for d in shown.noise)))
        seen = sense(by, *handed)
        pairs = zip(handed.arrays().items(), shown.arrays().values(), strict=True)
        changed.update(name for (name, after), before in pairs if not np.array_equal(after, before))
        return Sensed(seen.joints_2d.copy(), seen.confidence.copy())

    def frames(shown: Shown, by: Sensor = sensor) -> Sensed:
        """Sense clips (B, T, ...) frame by frame; return arrays (T, B, ...)."""
        return _stacked([see(shown.at((slice(None), frame)), by) for frame in range(shown.positions.shape[1])])

    seen: list[Sensed] = []
    arrays = "finite float arrays: joints_2d (..., P, J, 2) [px] and confidence (..., P, J), from 0 to 1"
    first = attempt(
        f"senses a batch of {BATCH}: joints_2d ({BATCH}, {persons}, {joints}, 2), "
        f"confidence ({BATCH}, {persons}, {joints})",
        lambda: seen.append(frames(clip)),
        expected=arrays,
        mend="return Sensed(joints_2d, confidence); a joint that is missing has finite pixels and confidence 0",
    )
    if not seen:
        return [first, ContractCheck("all else", None, "as it does not run")]
    stream = seen[0]

    def compared(get: Callable[[], Sensed], expected: Sensed, names: tuple[str, str], tolerance: float) -> str | None:
        return _difference(expected, get(), names, tolerance)

    def rows_alone() -> str | None:
        names = (f"in a batch of {BATCH}", "in another order")
        backwards = frames(clip.at(ALL[::-1]))
        difference = _difference(stream, _rows(backwards, ALL[::-1]), names, TOLERANCE)
        alone = frames(clip.at(ALL[:1]))
        return difference or _difference(_rows(stream, ALL[:1]), alone, (names[0], "alone"), TOLERANCE)

    def future() -> str | None:
        views = clip.viewpoint.copy()
        views[:, half:] = views[:, half:][:, ::-1]
        positions, noise = other_future(clip.positions, clip.noise, half)
        other, names = Shown(positions, views, noise), ("at first", "with another future")
        difference = _difference(_cut(stream, half), _cut(frames(other), half), names, TOLERANCE)
        if difference is not None:
            return difference
        whole, changed = (_by_frame(see(shown)) for shown in (clip, other))
        names = ("in a clip at once", names[1])
        return _difference(_cut(whole, half), _cut(changed, half), names, TOLERANCE)

    def forks() -> str | None:
        for frame in (0, length - 1):
            shown = clip.at((slice(None), frame))
            views = np.stack([np.roll(shown.viewpoint, way, axis=0) for way in range(FORKS)], axis=1)  # (B, F, 3)
            together = see(Shown(shown.positions[:, None], views, shown.noise.forked()))
            for way in range(FORKS):
                apart = see(Shown(shown.positions, views[:, way].copy(), shown.noise))
                mine = Sensed(*(array[None, :, way] for array in together))
                names = (f"from viewpoint {way} by itself", f"beside {FORKS - 1} others")
                difference = _difference(Sensed(*(array[None] for array in apart)), mine, names, TOLERANCE)
                if difference is not None:
                    return difference
        return None

    def pickled() -> str | None:
        try:
            copy = cloudpickle.loads(cloudpickle.dumps(sensor))
        except (Exception, SystemExit) as error:
            return f"{type(error).__name__}: {error}"
        return _difference(stream, frames(clip, copy), ("here", "from the copy"), TOLERANCE)

    def alone() -> None:
        frames(clip.at(ALL[:1]))

    same = f"the same within {TOLERANCE} px"
    return [
        first,
        attempt(
            "senses a batch of 1",
            alone,
            expected=arrays,
            mend="do not squeeze arrays: a batch of one episode has a leading 1",
        ),
        attempt(
            "does the same twice with the same noise",
            lambda: compared(lambda: frames(clip), stream, ("at first", "the second time"), 0.0),
            expected="equal numbers for equal joints, viewpoints and draws",
            mend=_NOISE,
        ),
        attempt(
            "rows alone, and in another order, are sensed the same",
            rows_alone,
            expected=same,
            mend=_ROWS,
        ),
        attempt(
            "a clip (B, T, ...) at once is sensed as its frames are",
            lambda: compared(lambda: _by_frame(see(clip)), stream, ("frame by frame", "at once"), TOLERANCE),
            expected=same,
            mend="let all axes before (P, J, 3) be leading axes; recognisers are trained on whole clips",
        ),
        attempt("the past does not see the future", future, expected=same, mend=_FUTURE),
        attempt(
            f"leading axes broadcast: {FORKS} viewpoints of one frame",
            forks,
            expected=f"{same} as one viewpoint at a time",
            mend="joints (B, 1, P, J, 3), viewpoints (B, F, 3) and noise (B, 1, ...) give (B, F, ...), as oracles need",
        ),
        attempt(
            "leaves what it is shown as it is",
            lambda: f"{', '.join(sorted(changed))} changed" if changed else None,
            expected="joints, viewpoints and draws that nobody changes",
            mend="work on a copy",
        ),
        attempt(
            "can be sent to a worker process",
            pickled,
            expected=f"an object that cloudpickle can pickle, and {same} from its copy",
            mend="hold no open files, locks or generators",
        ),
        _time(see, clip),
    ]


def _stacked(seen: list[Sensed]) -> Sensed:
    return Sensed(*(np.stack(arrays) for arrays in zip(*seen, strict=True)))


def _by_frame(seen: Sensed) -> Sensed:
    """Turn arrays (B, T, ...) into (T, B, ...)."""
    return Sensed(*(array.swapaxes(0, 1) for array in seen))


def _rows(seen: Sensed, rows: IntArray) -> Sensed:
    return Sensed(*(array[:, rows] for array in seen))


def _cut(seen: Sensed, frames: int) -> Sensed:
    return Sensed(*(array[:frames] for array in seen))


def _difference(one: Sensed, other: Sensed, names: tuple[str, str], tolerance: float) -> str | None:
    """Return in words where arrays (T, B, ...) first differ; None if they do not."""
    for what, a, b in zip(Sensed._fields, one, other, strict=True):
        difference = first_difference(a, b, names, tolerance=tolerance, what=what)
        if difference is not None:
            return difference
    return None


def _time(see: Callable[[Shown], Sensed], clip: Shown) -> ContractCheck:
    length = clip.positions.shape[1]
    begin = time.perf_counter()
    for frame in range(length):
        see(clip.at((slice(None), frame)))
    milliseconds = 1000 * (time.perf_counter() - begin) / (length * BATCH)
    return ContractCheck(f"takes {milliseconds:.3g} ms for one frame of one episode, {BATCH} at a time", True)
