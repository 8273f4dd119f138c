"""Describes a data set: a table of its classes, and a picture of a few skeletons of each class."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ehar.arrays import BoolArray, IntArray
from ehar.conditions import Conditions
from ehar.data.copies import copied
from ehar.data.motion_data import MotionData
from ehar.data.recordings import UNKNOWN_SUBJECT
from ehar.data.scenario import PARTS, TEST, advised_length, part_of, show_known, split_parts, windows
from ehar.data.streams.data import NO_ACTIVITY, NO_ACTIVITY_NAME, StreamData
from eval.render.tables import NONE, Table
from eval.running.outlook import Needed
from eval.scores.streams.activities import activity_frames
from eval.studies.describe_figure import activities, describe_figure, title_of
from recognition.setting import load_recordings_of


def describe(
    data: str | Path | MotionData | StreamData,
    *,
    fps: float | None = None,
    length: int | None = None,
    figure: str | Path | None = None,
) -> Table:
    """Return a table of the classes: how many activities of each there are, how long, and in which parts.

    A trimmed sequence is one activity. The last column counts what an episode's length leaves of the test part: windows
    of sequences, and activities of streams that lie within an episode, as no others are scored. Footnotes say what
    else the data hold, and advise a shorter length if many sequences or streams are shorter than an episode.

    Args:
        data: a built-in set, or a prepared .npz of sequences or of streams.
        fps: frame rate to resample to [Hz].
        length: frames of an episode; None means 60, of streams as many as 30 s have.
        figure: picture to write, with a few skeletons of each class: .png, .svg or .pdf.

    Raises:
        EharError: one line that says what was got and what was expected.
    """
    held = load_recordings_of(Conditions(data=data, fps=fps, length=length))
    if figure is not None:
        describe_figure(held, Path(figure))
    needed = Needed.of(held, length)
    header, rows = _stream_rows(held, needed) if isinstance(held, StreamData) else _clip_rows(held, needed)
    whole = next(index for index, row in enumerate(rows) if row[0] == "all")
    return Table(
        title=title_of(held),
        header=header,
        rows=tuple(rows),
        footnotes=(*_footnotes(held, needed), *([f"A picture of skeletons: {figure}"] if figure is not None else [])),
        bold=frozenset((whole, column) for column in range(len(header))),
    )


Rows = tuple[tuple[str, ...], list[tuple[str, ...]]]  # header and rows


def _clip_rows(data: MotionData, needed: Needed) -> Rows:
    test = split_parts(data).test
    is_test = np.isin(np.arange(len(data.labels)), test)
    tested = windows(data, test, needed.benchmark, needed.benchmark).labels
    header = ("class", "sequences", "train", "test", "frames min", "median", "max")
    in_parts = {"train": ~is_test, "test": is_test}
    rows = [
        _row(name, data.lengths, data.labels == label, in_parts, int((tested == label).sum()))
        for label, name in enumerate(data.class_names)
    ]
    rows.append(_row("all", data.lengths, np.ones(len(data.labels), dtype=bool), in_parts, len(tested)))
    return (*header, f"test windows L={needed.benchmark}"), rows


def _stream_rows(data: StreamData, needed: Needed) -> Rows:
    bounds, labels = activities(data)
    scored = np.bincount(_scored(data, needed.benchmark), minlength=len(data.class_names))
    parts = {part: part_of(data, part) for part in PARTS}

    def row(name: str, shown: IntArray, scored: int | None) -> tuple[str, ...]:
        stream = np.searchsorted(data.offsets, shown[:, 0], side="right") - 1
        in_parts = {part: np.isin(stream, streams) for part, streams in parts.items()}
        seconds = (shown[:, 1] - shown[:, 0]) / data.fps
        return _row(name, seconds, np.ones(len(shown), dtype=bool), in_parts, scored, digits=1)

    rows = [row(name, bounds[labels == label], int(scored[label])) for label, name in enumerate(data.class_names)]
    rows += [row("all", bounds, int(scored.sum())), row(NO_ACTIVITY_NAME, _between(data), None)]
    header = ("class", "activities", *PARTS, "seconds min", "median", "max")
    return (*header, f"scored in test L={needed.benchmark}"), rows


def _row(
    name: str,
    lengths: np.ndarray,
    members: BoolArray,
    in_parts: Mapping[str, BoolArray],
    scored: int | None,
    digits: int = 0,
) -> tuple[str, ...]:
    """Return a row: how many activities there are, in all and in each part, how long, and how many are scored."""
    counts = [int(members.sum()), *(int((members & part).sum()) for part in in_parts.values())]
    of_class = lengths[members]
    spread = (of_class.min(), np.median(of_class), of_class.max()) if len(of_class) else ()
    lengths_told = [f"{value:.{digits}f}" for value in spread] or [NONE] * 3
    return (name, *map(str, counts), *lengths_told, NONE if scored is None else str(scored))


def _between(data: StreamData) -> IntArray:
    """Return the first and the end frame of each stretch that shows no activity, (n, 2)."""
    first = np.sort(np.concatenate([data.offsets[:-1], data.segments[:, 1]]))
    end = np.sort(np.concatenate([data.segments[:, 0], data.offsets[1:]]))
    stretches = np.stack([first, end], axis=1)
    found: IntArray = stretches[end > first]
    return found


def _scored(data: StreamData, length: int) -> IntArray:
    """Return the class of each activity that is scored: it lies within an episode of the test part."""
    labels = windows(data, part_of(data, TEST), length, length).labels
    labels = np.where(labels == len(data.class_names), NO_ACTIVITY, labels)
    episode, begin, _ = activity_frames(labels)
    found: IntArray = labels[episode, begin]
    return found


def _footnotes(data: MotionData | StreamData, needed: Needed) -> list[str]:
    minutes = len(data.positions) / data.fps / 60
    length = needed.benchmark
    short = int((data.lengths < length).sum())
    advised = advised_length(data, length)
    test = split_parts(data).test
    copies, known = int(copied(data, test).sum()), int(show_known(data, test).sum())
    in_streams = isinstance(data, StreamData)
    one = "stream" if in_streams else "sequence"
    notes = [f"warning: {copies} test {one}s are copies of training {one}s"] if copies else []
    notes += [f"warning: {known} test {one}s show people from whom the recogniser learns"] if known else []
    notes += [f"warning: {line}" for line in data.notes] if isinstance(data, StreamData) else []
    return [
        *notes,
        f"{'synthetic motion' if data.synthetic else 'recorded motion'}, {minutes:.1f} minutes, "
        f"{short} of {len(data.lengths)} {one}s shorter than {length} frames",
        *([f"--length {advised} is advised: few {one}s are shorter"] if advised < length else []),
        *(_stream_notes(data, needed) if isinstance(data, StreamData) else []),
        f"split: {'as in the data' if data.is_test is not None else 'none in the data; held out from a fixed seed'}",
        f"licence: {data.license or 'not stated'}",
    ]


def _stream_notes(data: StreamData, needed: Needed) -> list[str]:
    parts = {part: part_of(data, part) for part in PARTS}
    people = {part: {tuple(sorted(row)) for row in data.subjects[streams].tolist()} for part, streams in parts.items()}
    named = bool((data.subjects != UNKNOWN_SUBJECT).all())
    who = "people" if data.persons == 1 else "groups of people"

    def part_note(part: str, streams: IntArray) -> str:
        shown_by = f" of {_counted(len(people[part]), who)}" if named else ""
        return f"{part} {_counted(len(streams), 'streams')}{shown_by}, {_minutes(data, streams):.1f} minutes"

    shared = len(people["recogniser"] & people["policy"]) if named else 0
    sharing = f"; recogniser and policy share {_counted(shared, who)}, in other streams" if shared else ""
    seconds = (data.segments[:, 1] - data.segments[:, 0]) / data.fps
    gaps = _runs(data)
    told = [
        "; ".join(part_note(part, streams) for part, streams in parts.items()) + sharing,
        f"no activity in {100 * (data.labels < 0).mean():.0f} % of the frames",
        f"an episode has {needed.benchmark} frames, {needed.benchmark / data.fps:g} s; windows have "
        f"{needed.recogniser} for the recogniser, {needed.planners} for planners: {needed.recogniser / data.fps:g} "
        f"and {needed.planners / data.fps:g} s, where an activity has {np.median(seconds):.1f} s in the median",
    ]
    if len(gaps):
        told.append(
            f"nobody is seen in {100 * data.missing.mean():.1f} % of the frames: {_counted(len(gaps), 'gaps')}, "
            f"the longest of {max(gaps) / data.fps:.1f} s"
        )
    return told


def _counted(count: int, what: str) -> str:
    """Return a number of things, of one in the singular."""
    singular = {"people": "person", "groups of people": "group of people"}.get(what, what.removesuffix("s"))
    return f"{count} {singular if count == 1 else what}"


def _minutes(data: StreamData, streams: IntArray) -> float:
    return float(data.lengths[streams].sum() / data.fps / 60)


def _runs(data: StreamData) -> Sequence[int]:
    """Return the frames of each gap: frames in a row, of one stream, in which nobody is seen."""
    runs: list[int] = []
    for missing in np.split(data.missing, data.offsets[1:-1]):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], missing.astype(np.int64), [0]])))
        runs += (edges[1::2] - edges[::2]).tolist()
    return runs
