"""The records of episodes, from which every number in a report is computed."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray, in_brief
from ehar.data.streams.data import NO_ACTIVITY
from ehar.rollout import Record
from eval.records.contacts import ContactRecords, join_contacts
from eval.records.flights import FlightRecords, join_flights

DIGITS = 6  # decimals of recorded viewpoints and probabilities; metrics are computed from the rounded numbers


@dataclass(frozen=True, eq=False, repr=False)
class EpisodeRecords:
    """The records of N episodes of one planner.

    Args:
        sequence: N names.
        first: (N,) first frame, counted within the sequence.
        start: (N, 3) start viewpoints: distance [m], azimuth [rad], polar angle [rad].
        label: (N,) true class; of streams (N, L), the class of each frame, or -1 for no activity.
        subjects: (N, P), who performs, as numbers of the data; -1 is unknown.
        viewpoint: (N, L, 3), where the camera was in each frame.
        predicted: (N, L), the most probable class after each frame; -1 is no activity.
        true_probability: (N, L), the probability of the true class.
        top_probability: (N, L), the probability of the predicted class.
        flight: the demands of the flights on a vehicle; None on the ideal track. The file has them in the same lines.
        second_probability: (N, L), the probability of the second most probable class; None in a run from before it was
            recorded.
        contacts: the frames in which the camera was too near to obstacles; None in a world without any. The file has
            them in the same lines.
        tracking_error: (N, L) [m], how far the camera was from its planner's path in each frame; None for a planner
            that gave no paths.
    """

    sequence: tuple[str, ...]
    first: IntArray
    start: FloatArray
    label: IntArray
    subjects: IntArray
    viewpoint: FloatArray
    predicted: IntArray
    true_probability: FloatArray
    top_probability: FloatArray
    flight: FlightRecords | None = None
    second_probability: FloatArray | None = None
    contacts: ContactRecords | None = field(default=None, repr=False)
    tracking_error: FloatArray | None = field(default=None, repr=False)

    __repr__ = in_brief

    def __len__(self) -> int:
        """The number of episodes, N."""
        return len(self.sequence)

    def same_episodes(self, other: "EpisodeRecords") -> bool:
        """Return whether other records have the same windows, people and starts, in the same order."""
        return (
            self.sequence == other.sequence
            and self.predicted.shape == other.predicted.shape
            and all(
                np.array_equal(getattr(self, key), getattr(other, key))
                for key in ("first", "start", "label", "subjects")
            )
        )

    @property
    def of_streams(self) -> bool:
        """Whether one activity follows another in an episode."""
        return self.label.ndim == 2

    @property
    def correct(self) -> BoolArray:
        """Whether the predicted class is the true one, (N, L)."""
        right: BoolArray = self.predicted == (self.label if self.of_streams else self.label[:, None])
        return right


SECOND, TRACKING = "second_probability", "tracking_error"
OPTIONAL = (SECOND, TRACKING)  # columns that a run may not have
COLUMNS = tuple(
    field.name for field in fields(EpisodeRecords) if field.name not in ("flight", "contacts", *OPTIONAL)
)  # of every run


def record_episodes(
    record: Record,
    *,
    sequence: Sequence[str],
    first: IntArray,
    start: FloatArray,
    label: IntArray,
    subjects: IntArray,
    flight: FlightRecords | None = None,
    contacts: ContactRecords | None = None,
    tracking_error: FloatArray | None = None,
) -> EpisodeRecords:
    """Return the records of a rollout, rounded as in the file.

    Args:
        record: the rollout.
        sequence: N names.
        first: (N,) first frames.
        start: (N, 3) start viewpoints.
        label: (N,) true classes; of streams (N, L), where the class after all others is no activity.
        subjects: (N, P) who performs.
        flight: the demands of the flights.
        contacts: the frames too near to obstacles.
        tracking_error: (N, L) [m] from the planner's paths.
    """
    probabilities = np.exp(record.log_probs.astype(np.float64))
    every = np.broadcast_to(label if label.ndim == 2 else label[:, None], probabilities.shape[:2])
    true = np.take_along_axis(probabilities, every[..., None], axis=-1)[..., 0]
    second = np.sort(probabilities, axis=-1)[..., -2:-1].sum(axis=-1)  # nothing where there is one class
    predicted = record.log_probs.argmax(axis=-1)
    if label.ndim == 2:
        none = probabilities.shape[-1] - 1
        label, predicted = (as_recorded(classes, none) for classes in (label, predicted))
    return EpisodeRecords(
        sequence=tuple(sequence),
        first=first,
        start=start.round(DIGITS),
        label=label,
        subjects=subjects,
        viewpoint=record.viewpoints.round(DIGITS),
        predicted=predicted,
        true_probability=np.minimum(true, 1.0).round(DIGITS),
        top_probability=np.minimum(probabilities.max(axis=-1), 1.0).round(DIGITS),
        flight=flight,
        second_probability=second.round(DIGITS),
        contacts=contacts,
        tracking_error=None if tracking_error is None else tracking_error.round(DIGITS),
    )


def as_recorded(classes: IntArray, none: int) -> IntArray:
    """Return classes of streams as records name them: -1 for `none`, the class after all others."""
    return np.where(classes == none, NO_ACTIVITY, classes)


def join_records(pieces: Sequence[EpisodeRecords]) -> EpisodeRecords:
    """Return the records of several batches of one planner as one."""
    if len(pieces) == 1:
        return pieces[0]  # not a copy: records are large
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(piece, name) for piece in pieces]) for name in COLUMNS if name != "sequence"
    }
    contacts = [piece.contacts for piece in pieces if piece.contacts is not None]
    flights = [piece.flight for piece in pieces if piece.flight is not None]
    for name in OPTIONAL:
        parts = [getattr(piece, name) for piece in pieces]
        joined[name] = None if any(part is None for part in parts) else np.concatenate(parts)
    return EpisodeRecords(
        sequence=tuple(name for piece in pieces for name in piece.sequence),
        flight=join_flights(flights) if flights else None,
        contacts=join_contacts(contacts) if contacts else None,
        **joined,
    )
