"""Checks that a run has one record for each of its episodes, and that records do not contradict themselves."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from ehar.arrays import BoolArray
from ehar.viewpoint import Workspace
from eval.records.config import CONFIG, RunConfig
from eval.records.contacts import CONTACTS
from eval.records.episodes import DIGITS, SECOND, EpisodeRecords, as_recorded
from eval.records.run_files import EPISODES
from eval.running.episodes import Episodes, draw_starts

LONGEST = 120  # characters of a value in an error


def contradiction(config: RunConfig, records: Mapping[str, EpisodeRecords], episodes: Episodes | None) -> str | None:
    """Return the first impossible value in the records, its place, and what was expected; None if there is none.

    Args:
        config: configuration of the run.
        records: records of planners; all have the same number of episodes.
        episodes: episodes of the run, made again from its data; None if the data are not here. Without them, sequences,
            windows, labels and people only have to be the same for every planner and in every round of starts.
    """
    known = {planner.name for planner in config.planners}
    reference = next(iter(records.values()))
    count = len(reference.label)
    scenarios, left = divmod(count, config.conditions.starts)
    for name, held in records.items():
        if name not in known:
            return f"{EPISODES}: {name}: got a planner that is not in {CONFIG}, expected {', '.join(sorted(known))}"
        length = held.predicted.shape[1]
        if length != config.conditions.frames:
            return f"{EPISODES}: {name}: got episodes of {length} frames, expected {config.conditions.frames}"
    if left or (episodes is not None and len(episodes) != count):
        expected = f"a multiple of the {config.conditions.starts} starts" if episodes is None else str(len(episodes))
        return f"{EPISODES}: got {count} episodes of each planner, expected {expected}"
    if episodes is None:
        row = np.arange(count) % scenarios
        sequence, first, label = np.array(reference.sequence)[row], reference.first[row], reference.label[row]
        windows = list(zip(reference.sequence[:scenarios], reference.first[:scenarios].tolist(), strict=True))
        _, once, of_sequence = np.unique(sequence, return_index=True, return_inverse=True)
        subjects = reference.subjects[once[of_sequence]]  # a sequence has the same people in all of its windows
        again = next((index for index, window in enumerate(windows) if window in windows[:index]), None)
        if again is not None:
            return f"{place(next(iter(records)), reference, again)}: got it twice, expected each window once a start"
    else:
        sequence, first, label = np.array(episodes.sequence_names), episodes.first, episodes.labels
        if label.ndim == 2:
            label = as_recorded(label, len(episodes.scenarios.data.class_names))
        subjects = episodes.subjects
    start = draw_starts(count, config.conditions.seed, config.world).round(DIGITS)
    for name, held in records.items():
        columns: tuple[tuple[str, Any, Any], ...] = (
            ("sequence", np.array(held.sequence), sequence),
            ("first", held.first, first),
            ("label", held.label, label),
            ("subjects", held.subjects, subjects),
            ("start", held.start, start),
            ("viewpoint", held.viewpoint[:, 0], held.start),
        )
        for field, got, expected in columns:
            if got.shape != expected.shape:
                return f"{place(name, held, 0)}: {field}: got {_text(got[0])}, expected {_text(expected[0])}"
            off = got != expected if got.ndim == 1 else (got != expected).any(axis=1)
            if off.any():
                at = int(off.argmax())
                if field == "label" and got.ndim == 2:  # of a stream, whose every frame has one
                    frame = int((got[at] != expected[at]).argmax())
                    classes = f"got {_text(got[at, frame])}, expected {_text(expected[at, frame])}"
                    return f"{place(name, held, at, frame)}: label: {classes}"
                return f"{place(name, held, at)}: {field}: got {_text(got[at])}, expected {_text(expected[at])}"
        for problem in _frames(
            held, config.world.workspace, None if episodes is None else len(episodes.scenarios.data.class_names)
        ):
            if problem.off.any():
                at, frame = (int(index) for index in np.argwhere(problem.off)[0])
                got = _text(getattr(held, problem.field)[at, frame])
                return f"{place(name, held, at, frame)}: {problem.field}: got {got}, expected {problem.expected}"
        difference = _contacts(name, held, config)
        if difference is not None:
            return difference
    return None


def _contacts(name: str, held: EpisodeRecords, config: RunConfig) -> str | None:
    """Return the first impossible number of frames too near to obstacles; None if there is none."""
    near = held.contacts
    if near is None or not config.world.can_be_hit:
        got, expected = ("none" if near is None else "some"), ("some" if config.world.can_be_hit else "none")
        where = f"{EPISODES}: {name}: {', '.join(CONTACTS)}"
        return None if got == expected else f"{where}: got {got}, expected {expected} in the world {config.world.name}"
    length = np.full(len(held), held.predicted.shape[1])
    for field, most, what in (("near_frames", length, "frames"), ("hit_frames", near.near_frames, "near_frames")):
        got = getattr(near, field)
        if (got > most).any():
            at = int((got > most).argmax())
            return f"{place(name, held, at)}: {field}: got {got[at]}, expected at most the {most[at]} {what}"
    return None


class _Problem(NamedTuple):
    off: BoolArray  # (N, L), the frames that have the problem
    field: str
    expected: str


def _frames(held: EpisodeRecords, workspace: Workspace, classes: int | None) -> Iterator[_Problem]:
    """Yield the problems that single frames may have."""
    yield _Problem(~workspace.contains(held.viewpoint, tolerance=10**-DIGITS), "viewpoint", f"one within {workspace}")
    if classes is not None:
        yield _Problem(held.predicted >= classes, "predicted", f"one of {classes} classes")
    yield _Problem(
        held.correct & (held.true_probability != held.top_probability),
        "true_probability",
        "the top_probability, as the class predicted is the true one",
    )
    yield _Problem(held.true_probability > held.top_probability, "true_probability", "at most the top_probability")
    second = held.second_probability
    if second is not None:
        yield _Problem(second > held.top_probability, SECOND, "at most the top_probability")
        expected = "at least the true_probability, as the class predicted is another one"
        yield _Problem(~held.correct & (held.true_probability > second), SECOND, expected)


def place(name: str, records: EpisodeRecords, episode: int, frame: int | None = None) -> str:
    """Return a place in a run for errors: planner, episode and frame; episodes and frames count from 0."""
    window = f"{records.sequence[episode]!r} from frame {records.first[episode]}"
    return f"{EPISODES}: {name}, episode {episode} ({window})" + ("" if frame is None else f", frame {frame}")


def _text(value: Any) -> str:
    """Return a value of the records as the file writes it; long ones, such as the labels of a stream, are cut off."""
    text = str(value.tolist())
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
