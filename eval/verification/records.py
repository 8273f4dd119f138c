"""Whether the records of a run are those of its episodes, each once, and do not contradict themselves."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from ehar.arrays import BoolArray
from ehar.viewpoint import Workspace
from eval.records.config import CONFIG, RunConfig
from eval.records.episodes import DIGITS, EpisodeRecords
from eval.records.run_files import EPISODES
from eval.running.episodes import Episodes, draw_starts


def contradiction(config: RunConfig, records: Mapping[str, EpisodeRecords], episodes: Episodes | None) -> str | None:
    """Return the first thing in the records that cannot be, where it is, and what was expected; None if all is well.

    Args:
        config: of the run.
        records: of planners that all have as many episodes.
        episodes: those of the run, made anew from its data; None where that is not here: then the sequences, their
            windows and labels only have to be the same for every planner, and in every round of start viewpoints.
    """
    known = {planner.name for planner in config.planners}
    reference = next(iter(records.values()))
    count, length = reference.predicted.shape
    scenarios, left = divmod(count, config.conditions.starts)
    for name, of in records.items():
        if name not in known:
            return f"{EPISODES}: {name}: got a planner that is not in {CONFIG}, expected {', '.join(sorted(known))}"
        if of.predicted.shape[1] != config.conditions.length:
            return f"{EPISODES}: {name}: got episodes of {length} frames, expected {config.conditions.length}"
    if left or (episodes is not None and len(episodes) != count):
        expected = f"a multiple of the {config.conditions.starts} starts" if episodes is None else str(len(episodes))
        return f"{EPISODES}: got {count} episodes of each planner, expected {expected}"
    if episodes is None:
        row = np.arange(count) % scenarios
        sequence, first, label = np.array(reference.sequence)[row], reference.first[row], reference.label[row]
        windows = list(zip(reference.sequence[:scenarios], reference.first[:scenarios].tolist(), strict=True))
        again = next((index for index, window in enumerate(windows) if window in windows[:index]), None)
        if again is not None:
            return f"{place(next(iter(records)), reference, again)}: got it twice, expected each window once a start"
    else:
        sequence, first, label = np.array(episodes.sequence_names), episodes.first, episodes.labels
    start = draw_starts(count, config.conditions.seed).round(DIGITS)
    for name, of in records.items():
        columns: tuple[tuple[str, Any, Any], ...] = (
            ("sequence", np.array(of.sequence), sequence),
            ("first", of.first, first),
            ("label", of.label, label),
            ("start", of.start, start),
            ("viewpoint", of.viewpoint[:, 0], of.start),
        )
        for field, got, expected in columns:
            off = got != expected if got.ndim == 1 else (got != expected).any(axis=1)
            if off.any():
                at = int(off.argmax())
                return f"{place(name, of, at)}: {field}: got {_text(got[at])}, expected {_text(expected[at])}"
        for problem in _frames(of, None if episodes is None else len(episodes.scenarios.data.class_names)):
            if problem.off.any():
                at, frame = (int(index) for index in np.argwhere(problem.off)[0])
                held = _text(getattr(of, problem.field)[at, frame])
                return f"{place(name, of, at, frame)}: {problem.field}: got {held}, expected {problem.expected}"
    return None


class _Problem(NamedTuple):
    off: BoolArray  # (N, L), where it is
    field: str
    expected: str


def _frames(of: EpisodeRecords, classes: int | None) -> Iterator[_Problem]:
    """Yield what single frames may be wrong in."""
    workspace = Workspace()
    yield _Problem(~workspace.contains(of.viewpoint, tolerance=10**-DIGITS), "viewpoint", f"one within {workspace}")
    if classes is not None:
        yield _Problem(of.predicted >= classes, "predicted", f"one of {classes} classes")
    yield _Problem(
        of.correct & (of.true_probability != of.top_probability),
        "true_probability",
        "the top_probability, as the class predicted is the true one",
    )
    yield _Problem(of.true_probability > of.top_probability, "true_probability", "at most the top_probability")


def place(name: str, of: EpisodeRecords, episode: int, frame: int | None = None) -> str:
    """Return where in a run something is: planner, episode and frame, all counted from 0."""
    window = f"{of.sequence[episode]!r} from frame {of.first[episode]}"
    return f"{EPISODES}: {name}, episode {episode} ({window})" + ("" if frame is None else f", frame {frame}")


def _text(value: Any) -> str:
    """Return a value of the records as the file has it."""
    return str(value.tolist())
