"""The records of a run, from which every number in a report is computed: episodes.jsonl, one line an episode."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.errors import DataError
from ehar.rollout import Record

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
    """

    sequence: tuple[str, ...]
    first: IntArray
    start: FloatArray
    label: IntArray
    viewpoint: FloatArray
    predicted: IntArray
    true_probability: FloatArray
    top_probability: FloatArray

    def __len__(self) -> int:
        """The number of episodes, N."""
        return len(self.sequence)

    @property
    def correct(self) -> BoolArray:
        """Whether the predicted class is the true one, (N, L)."""
        right: BoolArray = self.predicted == self.label[:, None]
        return right


def record_episodes(
    record: Record, *, sequence: Sequence[str], first: IntArray, start: FloatArray, label: IntArray
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
    )


def join_records(pieces: Sequence[EpisodeRecords]) -> EpisodeRecords:
    """Return the records of several batches of one planner as one."""
    joined = {
        field.name: np.concatenate([getattr(piece, field.name) for piece in pieces])
        for field in fields(EpisodeRecords)
        if field.name != "sequence"
    }
    return EpisodeRecords(sequence=tuple(name for piece in pieces for name in piece.sequence), **joined)


def episode_lines(records: Mapping[str, EpisodeRecords]) -> Iterable[str]:
    """Yield the lines of episodes.jsonl: planner by planner, in the order given; keys are the fields' names."""
    for planner, episodes in records.items():
        columns = {field.name: getattr(episodes, field.name) for field in fields(EpisodeRecords)}
        listed = {name: values if name == "sequence" else values.tolist() for name, values in columns.items()}
        for row in zip(*listed.values(), strict=True):
            line = {"planner": planner, **dict(zip(listed, row, strict=True))}
            yield json.dumps(line, ensure_ascii=False, separators=(",", ":")) + "\n"


def read_episodes(path: Path) -> dict[str, EpisodeRecords]:
    """Read episodes.jsonl back: the records of each planner, in the order of the file.

    Raises:
        DataError: the file is missing, or a line is not an episode.
    """
    names = [field.name for field in fields(EpisodeRecords)]
    rows: dict[str, list[dict[str, object]]] = {}
    try:
        with path.open(encoding="utf-8") as file:
            for number, line in enumerate(file, 1):
                row = json.loads(line)
                if not isinstance(row, dict) or not {"planner", *names} <= row.keys():
                    raise DataError(f"{path}, line {number}: expected an episode with the fields planner, {names}")
                rows.setdefault(row["planner"], []).append(row)
        return {
            planner: EpisodeRecords(
                sequence=tuple(str(row["sequence"]) for row in episodes),
                **{name: np.array([row[name] for row in episodes]) for name in names if name != "sequence"},
            )
            for planner, episodes in rows.items()
        }
    except OSError as error:
        raise DataError(f"{path}: expected the episodes of a run, got {error.strerror}") from error
    except ValueError as error:
        raise DataError(f"{path}: expected one JSON object a line, all with as many frames: {error}") from error
