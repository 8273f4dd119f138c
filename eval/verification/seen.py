"""What was seen again: the recognition in each frame against the records, from the side of an edge that fits them."""

from collections.abc import Callable, Iterator
from itertools import islice, product
from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.batch import Batch
from ehar.data.streams.data import NO_ACTIVITY
from ehar.rollout import Record
from ehar.sensors.sensor import Sensor
from eval.records.episodes import DIGITS, SECOND, EpisodeRecords
from eval.verification.records import place

PROBABILITY = 1e-3
JUMP = 1.0  # [px], farther than a joint moves in the image then, unless sides change
CORNERS = 10.0**-DIGITS * np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T  # [m], [rad], of what rounding hides
TRIES = 64  # ways that are tried for an episode, as each edge doubles them


class Mismatch(NamedTuple):
    """The first frame in which something else was seen again than recorded."""

    episode: int  # of those that ran again
    frame: int
    field: str
    got: float
    expected: float


def seen_difference(
    name: str,
    recorded: EpisodeRecords,
    rows: IntArray,
    record: Record,
    batch: Batch,
    sensor: Sensor,
    look: Callable[[FloatArray], Record],
) -> tuple[str | None, FloatArray]:
    """Return the first frame in which the recognition differs from the records, and from which side edges were seen.

    A recorded viewpoint is rounded, and a joint on the edge of what hides it is seen from one side of a millionth of a
    metre. So an episode that differs is looked at from the other sides of the edges before: one has to be as recorded.

    Args:
        name: name of the planner.
        recorded: records of all its episodes.
        rows: (B,) indices of the episodes that ran again.
        record: record of these episodes.
        batch: these episodes.
        sensor: the sensor that saw them.
        look: runs them on the recorded way, moved by (B, L, 3) [m], [rad].

    Returns:
        the difference, None if there is none; and (B, L, 3), by how much the way was moved.
    """
    nudges = np.zeros(record.viewpoints.shape)
    while (found := first_mismatch(recorded, rows, record)) is not None:
        sides = _sides(batch, sensor, recorded.viewpoint[rows], found.episode, found.frame)
        for moved in islice(product(*sides.values()), 1, TRIES):
            other = nudges.copy()
            other[found.episode, list(sides)] = moved
            again = look(other)
            then = first_mismatch(recorded, rows, again, only=found.episode)
            if then is None or then.frame > found.frame:
                nudges, record = other, again
                break
        else:
            where = place(name, recorded, int(rows[found.episode]), found.frame)
            return f"{where}: {found.field}: got {found.got:.6g}, expected {found.expected:.6g}", nudges
    return None, nudges


def first_mismatch(
    recorded: EpisodeRecords, rows: IntArray, record: Record, only: int | None = None
) -> Mismatch | None:
    """Return the first frame that was seen otherwise, of one episode or of all; None if none was."""
    looked = slice(None) if only is None else slice(only, only + 1)
    found = []
    for rank, compared in enumerate(_compared(recorded, rows, record)):
        off = ~compared.same[looked]
        if off.any():
            at, frame = (int(index) for index in np.argwhere(off)[0])
            at += only or 0
            got, expected = compared.got[at, frame], compared.expected[at, frame]
            found.append((rank, Mismatch(at, frame, compared.field, got, expected)))
    return min(found, key=lambda one: (*one[1][:2], one[0]))[1] if found else None


def _sides(batch: Batch, sensor: Sensor, way: FloatArray, episode: int, last: int) -> dict[int, list[FloatArray]]:
    """Return the frames, up to a last one, in which a camera sees other joints if it moves by what rounding hides.

    Args:
        batch: B episodes.
        sensor: the sensor.
        way: (B, L, 3) recorded viewpoints.
        episode: the episode, of the B.
        last: the last frame.

    Returns:
        for each of these frames, moves (3,) [m], [rad] after which different joints are seen, the first of them none.
    """
    moves = np.concatenate([np.zeros((1, 3)), CORNERS])
    sides = {}
    for frame in range(last + 1):
        around = way[:, frame, None] + moves
        joints, confidence = batch.sense(sensor, frame, around, f"frame {frame}, near the recorded viewpoint")
        kept: list[int] = []
        for side in range(len(moves)):
            if not any(
                np.array_equal(confidence[episode, side], confidence[episode, other])
                and np.abs(joints[episode, side] - joints[episode, other]).max() <= JUMP
                for other in kept
            ):
                kept.append(side)
        if len(kept) > 1:
            sides[frame] = [moves[side] for side in kept]
    return sides


class _Compared(NamedTuple):
    field: str
    got: FloatArray | IntArray
    expected: FloatArray | IntArray
    same: BoolArray  # (B, L)


def _compared(recorded: EpisodeRecords, rows: IntArray, record: Record) -> Iterator[_Compared]:
    """Yield the values that are compared in each frame."""
    probabilities = np.exp(record.log_probs.astype(np.float64))
    top, predicted = probabilities.max(axis=-1), recorded.predicted[rows]
    label = (
        recorded.label[rows] if recorded.of_streams else np.broadcast_to(recorded.label[rows, None], predicted.shape)
    )
    if recorded.of_streams:
        none = probabilities.shape[-1] - 1
        label, predicted = (np.where(classes == NO_ACTIVITY, none, classes) for classes in (label, predicted))
    of_predicted, true = (
        np.take_along_axis(probabilities, chosen[..., None], axis=-1)[..., 0] for chosen in (predicted, label)
    )
    # If two classes are nearly as probable, either may be the predicted one.
    yield _Compared("predicted", predicted, probabilities.argmax(axis=-1), of_predicted >= top - PROBABILITY)
    compared = [("true_probability", true), ("top_probability", top)]
    if recorded.second_probability is not None:
        compared.append((SECOND, np.sort(probabilities, axis=-1)[..., -2:-1].sum(axis=-1)))
    for field, expected in compared:
        got = getattr(recorded, field)[rows]
        yield _Compared(field, got, expected, np.abs(got - expected) <= PROBABILITY)
