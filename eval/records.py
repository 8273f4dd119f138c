"""The records of a run, from which every number in a report is computed: episodes.jsonl, one line an episode."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.errors import DataError
from ehar.rollout import Record
from eval.flight_records import KEYS, FlightRecords, join_flights

DIGITS = 6  # decimals that are recorded of viewpoints and probabilities; metrics are computed from these


@dataclass(frozen=True, eq=False)
class EpisodeRecords:
    """What happened in N episodes of one planner.

    Args:
        sequence: N names.
        first: (N,) first frame, counted within the sequence.
        start: (N, 3) start viewpoints: distance [m], azimuth [rad], polar angle [rad].
        label: (N,) true class.
        viewpoint: (N, L, 3), where the camera was in each frame.
        predicted: (N, L), the most probable class after each frame.
        true_probability: (N, L), the probability of the true class.
        top_probability: (N, L), the probability of the predicted class.
        flight: what the flights demanded of a vehicle; None on the ideal track. A line of the file has its numbers
            beside the others.
    """

    sequence: tuple[str, ...]
    first: IntArray
    start: FloatArray
    label: IntArray
    viewpoint: FloatArray
    predicted: IntArray
    true_probability: FloatArray
    top_probability: FloatArray
    flight: FlightRecords | None = None

    def __len__(self) -> int:
        """The number of episodes, N."""
        return len(self.sequence)

    @property
    def correct(self) -> BoolArray:
        """Whether the predicted class is the true one, (N, L)."""
        right: BoolArray = self.predicted == self.label[:, None]
        return right


COLUMNS = tuple(field.name for field in fields(EpisodeRecords) if field.name != "flight")


def record_episodes(
    record: Record,
    *,
    sequence: Sequence[str],
    first: IntArray,
    start: FloatArray,
    label: IntArray,
    flight: FlightRecords | None = None,
) -> EpisodeRecords:
    """Return what is kept of a rollout, rounded as it is written."""
    probabilities = np.exp(record.log_probs.astype(np.float64))
    true = np.take_along_axis(probabilities, label[:, None, None], axis=-1)[..., 0]
    return EpisodeRecords(
        sequence=tuple(sequence),
        first=first,
        start=start.round(DIGITS),
        label=label,
        viewpoint=record.viewpoints.round(DIGITS),
        predicted=record.log_probs.argmax(axis=-1),
        true_probability=np.minimum(true, 1.0).round(DIGITS),
        top_probability=np.minimum(probabilities.max(axis=-1), 1.0).round(DIGITS),
        flight=flight,
    )


def join_records(pieces: Sequence[EpisodeRecords]) -> EpisodeRecords:
    """Return the records of several batches of one planner as one."""
    joined = {
        name: np.concatenate([getattr(piece, name) for piece in pieces]) for name in COLUMNS if name != "sequence"
    }
    flights = [piece.flight for piece in pieces if piece.flight is not None]
    return EpisodeRecords(
        sequence=tuple(name for piece in pieces for name in piece.sequence),
        flight=join_flights(flights) if flights else None,
        **joined,
    )


def episode_lines(records: Mapping[str, EpisodeRecords]) -> Iterable[str]:
    """Yield the lines of episodes.jsonl: planner by planner, in the order given; keys are the fields' names."""
    for planner, episodes in records.items():
        columns = {name: getattr(episodes, name) for name in COLUMNS}
        if episodes.flight is not None:
            columns |= {key: getattr(episodes.flight, key) for key in KEYS}
        listed = {name: values if name == "sequence" else values.tolist() for name, values in columns.items()}
        for row in zip(*listed.values(), strict=True):
            line = {"planner": planner, **dict(zip(listed, row, strict=True))}
            yield json.dumps(line, ensure_ascii=False, separators=(",", ":")) + "\n"


def read_episodes(path: Path) -> dict[str, EpisodeRecords]:
    """Read episodes.jsonl back: the records of each planner, in the order of the file.

    Raises:
        DataError: the file is missing, or a line is not an episode.
    """
    rows: dict[str, list[dict[str, Any]]] = {}
    try:
        with path.open(encoding="utf-8") as file:
            for number, line in enumerate(file, 1):
                row = json.loads(line)
                if not isinstance(row, dict) or not {"planner", *COLUMNS} <= row.keys():
                    raise DataError(f"{path}, line {number}: expected an episode with the fields planner, {COLUMNS}")
                flown = row.keys() & set(KEYS)
                if flown and len(flown) < len(KEYS):
                    raise DataError(f"{path}, line {number}: expected all of the fields {KEYS}, or none")
                rows.setdefault(row["planner"], []).append(row)
        return {planner: _episodes(lines) for planner, lines in rows.items()}
    except OSError as error:
        raise DataError(f"{path}: expected the episodes of a run, got {error.strerror}") from error
    except ValueError as error:
        raise DataError(f"{path}: expected one JSON object a line, all with as many frames: {error}") from error


def _episodes(rows: Sequence[Mapping[str, Any]]) -> EpisodeRecords:
    """Return the records of one planner from its lines, or raise ValueError where they do not fit together."""
    flown = [KEYS[0] in row for row in rows]
    if any(flown) and not all(flown):
        raise ValueError("some episodes were flown, and others were not")
    columns = {name: np.array([row[name] for row in rows]) for name in COLUMNS if name != "sequence"}
    flights = {key: np.array([row[key] for row in rows]) for key in KEYS} if all(flown) else None
    return EpisodeRecords(
        sequence=tuple(str(row["sequence"]) for row in rows),
        flight=None if flights is None else FlightRecords(**flights),
        **columns,
    )
