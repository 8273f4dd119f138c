"""The file episodes.jsonl of a run, one line an episode: written, read back, and refused where a line is not one."""

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.recordings import UNKNOWN_SUBJECT
from ehar.data.streams.data import NO_ACTIVITY
from ehar.errors import DataError
from eval.records.contacts import CONTACTS, ContactRecords
from eval.records.episodes import COLUMNS, OPTIONAL, SECOND, TRACKING, EpisodeRecords, join_records
from eval.records.flights import COSTS, KEYS, FlightRecords, held_flight
from eval.records.one_by_one import OneByOne, put_aside

LISTED = 256  # episodes that become Python lists at once, which take many times the memory of arrays


def episode_lines(records: Mapping[str, EpisodeRecords]) -> Iterable[str]:
    """Yield the lines of episodes.jsonl: planner by planner, in the order given; keys are the fields' names."""
    for planner, episodes in records.items():
        columns = {name: getattr(episodes, name) for name in COLUMNS}
        columns |= {name: getattr(episodes, name) for name in OPTIONAL if getattr(episodes, name) is not None}
        if episodes.flight is not None:
            columns |= held_flight(episodes.flight)
        if episodes.contacts is not None:
            columns |= {key: getattr(episodes.contacts, key) for key in CONTACTS}
        for first in range(0, len(episodes), LISTED):
            some = {name: values[first : first + LISTED] for name, values in columns.items()}
            listed = {name: values if name == "sequence" else values.tolist() for name, values in some.items()}
            for row in zip(*listed.values(), strict=True):
                line = {"planner": planner, **dict(zip(listed, row, strict=True))}
                yield json.dumps(line, ensure_ascii=False, separators=(",", ":")) + "\n"


def read_episodes(path: Path) -> dict[str, EpisodeRecords]:
    """Read episodes.jsonl back: the records of each planner, in the order of the file.

    Raises:
        DataError: the file is missing, or a line is not an episode; the error names the line and the field.
    """
    try:
        with path.open(encoding="utf-8") as file:
            return _read_lines(file, path)
    except OSError as error:
        raise DataError(f"{path}: expected the episodes of a run, got {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: expected text in UTF-8, got {error}") from error


def stored_episodes(path: Path) -> Mapping[str, EpisodeRecords]:
    """Return the records of each planner in an episodes.jsonl; they stay on disk until asked for.

    What was read once is put aside as arrays, which are read many times faster than lines.

    A file in which planners take turns, or that `read_episodes` refuses, is read at once.

    Raises:
        DataError: as in `read_episodes`, now or later; or the file has changed.
    """
    ranges: dict[str, tuple[int, int, int]] = {}  # first and last byte, and number of the first line
    try:
        with path.open("rb") as file:
            begin, last = 0, None
            for number, line in enumerate(file, 1):
                name = json.loads(line.partition(b',"sequence":')[0] + b"}")["planner"]
                if name != last and name in ranges:
                    return read_episodes(path)
                first, _, at = ranges.get(name, (begin, begin, number))
                begin += len(line)
                ranges[name], last = (first, begin, at), name
    except (OSError, ValueError, KeyError, TypeError):
        return read_episodes(path)

    def read(name: str) -> EpisodeRecords:
        first, end, at = ranges[name]
        try:
            with path.open("rb") as file:
                file.seek(first)
                found = _read_lines((line.decode() for line in _lines_until(file, end)), path, at)
        except OSError as error:
            raise DataError(f"{path}: expected the episodes of a run, got {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise DataError(f"{path}: expected text in UTF-8, got {error}") from error
        if list(found) != [name]:
            raise DataError(f"{path}: expected the episodes of {name} where they were, got others")
        return found[name]

    return OneByOne(list(ranges), put_aside(read))


def _lines_until(file: IO[bytes], end: int) -> Iterator[bytes]:
    """Yield lines up to a place in the file."""
    while file.tell() < end and (line := file.readline()):
        yield line


def _read_lines(lines: Iterable[str], path: Path, begin: int = 1) -> dict[str, EpisodeRecords]:
    """Return the records of each planner from lines, numbered from `begin`; only a few rows are lists at a time."""
    first: dict[str, _Row] = {}
    rows: dict[str, list[_Row]] = {}
    pieces: dict[str, list[EpisodeRecords]] = {}

    def convert(planner: str) -> None:
        some = rows.pop(planner)
        anew = planner in pieces  # the first row of all says how large those that follow are
        piece = _episodes([first[planner], *some] if anew else some)
        pieces.setdefault(planner, []).append(_without_first(piece) if anew else piece)

    for number, line in enumerate(lines, begin):
        where = f"{path}, line {number}"
        row = _Row(where, _parsed_line(line, where))
        planner = row.fields["planner"]
        first.setdefault(planner, row)
        rows.setdefault(planner, []).append(row)
        if len(rows[planner]) == LISTED:
            convert(planner)
    for planner in list(rows):
        convert(planner)
    return {planner: join_records(pieces.pop(planner)) for planner in list(pieces)}


def _without_first(records: EpisodeRecords) -> EpisodeRecords:
    """Return records without their first episode."""

    def rest(held: Any) -> Any:
        if isinstance(held, FlightRecords | ContactRecords):
            return replace(held, **{name: values[1:] for name, values in vars(held).items() if values is not None})
        return None if held is None else held[1:]

    return EpisodeRecords(**{part.name: rest(getattr(records, part.name)) for part in fields(EpisodeRecords)})


class _Row(NamedTuple):
    where: str
    fields: dict[str, Any]


class _Kind(NamedTuple):
    """The values of a field: their shape, for L frames and P persons, and their least and greatest value."""

    shape: tuple[int | str, ...]
    whole: bool
    least: float = -math.inf
    greatest: float = math.inf

    def __str__(self) -> str:
        shape = f", shape ({', '.join(map(str, self.shape))})" if self.shape else ""
        among = f" from {self.least:g}" if math.isfinite(self.least) else ""
        among += f" to {self.greatest:g}" if math.isfinite(self.greatest) else ""
        return f"{'whole' if self.whole else 'finite'} numbers{among}{shape}"

    def array(self, values: Sequence[Any], sizes: Mapping[str, int]) -> FloatArray | None:
        """Return the values of N episodes of these sizes, L and P, (N, ...); None if they are not of this kind."""
        try:
            array = np.array(values)
        except (ValueError, OverflowError):
            return None  # the shapes differ, or a number does not fit 64 bits
        shape = (len(values), *(sizes[size] if isinstance(size, str) else size for size in self.shape))
        if array.shape != shape or array.dtype.kind not in ("iu" if self.whole else "iuf"):
            return None
        among = np.isfinite(array) & (array >= self.least) & (array <= self.greatest)
        return (array if self.whole else array.astype(np.float64, copy=False)) if among.all() else None


_KINDS = {
    "first": _Kind((), True, 0),
    "start": _Kind((3,), False),
    "label": _Kind((), True, 0),
    "subjects": _Kind(("P",), True, UNKNOWN_SUBJECT),
    "viewpoint": _Kind(("L", 3), False),
    "predicted": _Kind(("L",), True, 0),
    "true_probability": _Kind(("L",), False, 0, 1),
    "top_probability": _Kind(("L",), False, 0, 1),
    SECOND: _Kind(("L",), False, 0, 1),
    TRACKING: _Kind(("L",), False, 0),
    **dict.fromkeys((*KEYS, *COSTS), _Kind((), False, 0)),
    "noise": _Kind((), False),
    **dict.fromkeys(CONTACTS, _Kind((), True, 0)),
}
_OF_STREAMS = _KINDS | dict.fromkeys(("label", "predicted"), _Kind(("L",), True, NO_ACTIVITY))


def _parsed_line(line: str, where: str) -> dict[str, Any]:
    """Return the fields of an episode, or raise a DataError."""
    try:
        row = json.loads(line)
    except ValueError as error:
        raise DataError(f"{where}: expected one JSON object a line: {error}") from error
    if not isinstance(row, dict) or not {"planner", *COLUMNS} <= row.keys():
        raise DataError(f"{where}: expected an episode with the fields planner, {', '.join(COLUMNS)}")
    for name in ("planner", "sequence"):
        if not isinstance(row[name], str):
            raise DataError(f"{where}: {name}: expected a name, got {row[name]!r}")
    for name, what in (("predicted", "frame"), ("subjects", "person")):
        if not isinstance(row[name], list) or not row[name]:
            raise DataError(f"{where}: {name}: expected a list of at least one {what}")
    for together in (KEYS, CONTACTS):
        if 0 < len(row.keys() & set(together)) < len(together):
            raise DataError(f"{where}: expected all of the fields {', '.join(together)}, or none")
    return row


def _episodes(rows: Sequence[_Row]) -> EpisodeRecords:
    """Return the records of one planner from its lines, or raise a DataError if they do not fit together."""
    flown, near = (name in rows[0].fields for name in (KEYS[0], CONTACTS[0]))
    held, costs = ([name for name in names if name in rows[0].fields] for names in (OPTIONAL, COSTS))
    for row in rows:
        if (KEYS[0] in row.fields) != flown:
            raise DataError(f"{row.where}: some episodes were flown, and others were not")
        if (CONTACTS[0] in row.fields) != near:
            raise DataError(f"{row.where}: some episodes have {', '.join(CONTACTS)}, and others have none")
        for name in (*OPTIONAL, *COSTS):
            if (name in row.fields) != (name in (*held, *costs)):
                raise DataError(f"{row.where}: some episodes have a {name}, and others have none")
    columns: dict[str, Any] = {name: _column(name, rows) for name in (*COLUMNS, *held) if name != "sequence"}
    flight = FlightRecords(**{key: _column(key, rows) for key in (*KEYS, *costs)}) if flown else None
    return EpisodeRecords(
        sequence=tuple(row.fields["sequence"] for row in rows),
        flight=flight,
        contacts=ContactRecords(**{key: _column(key, rows) for key in CONTACTS}) if near else None,
        **columns,
    )


def _column(name: str, rows: Sequence[_Row]) -> Any:
    """Return one field of all episodes, (N, ...), or raise a DataError that names the first line that is off."""
    kind = (_OF_STREAMS if isinstance(rows[0].fields["label"], list) else _KINDS)[name]
    sizes = {"L": len(rows[0].fields["predicted"]), "P": len(rows[0].fields["subjects"])}
    array = kind.array([row.fields[name] for row in rows], sizes)
    if array is None:
        off = next(row for row in rows if kind.array([row.fields[name]], sizes) is None)
        size = next((axis for axis in kind.shape if isinstance(axis, str)), "L")
        raise DataError(f"{off.where}: {name}: expected {kind}, {size} = {sizes[size]} as in the lines before")
    return array
