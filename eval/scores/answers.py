"""What is left of records when all planners have to be in memory side by side: episodes and answers."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ehar.errors import DataError
from eval.records.episodes import EpisodeRecords
from eval.scores.streams.activities import activities


def answers_of(records: Mapping[str, EpisodeRecords]) -> dict[str, EpisodeRecords]:
    """Return the answers of each planner; one planner's records are in memory at a time.

    Raises:
        DataError: planners ran different episodes.
    """
    found: dict[str, EpisodeRecords] = {}
    for name in records:
        found[name] = answers_only(name, records[name], next(iter(found.values()), None))
    return found


def answers_only(name: str, records: EpisodeRecords, reference: EpisodeRecords | None) -> EpisodeRecords:
    """Return records with nothing but episodes and answers, a byte or two a frame; of streams, those of activities.

    Args:
        name: name of the planner.
        records: its records.
        reference: what was returned for the planner before it, whose episodes are shared; None for the first.

    Raises:
        DataError: these are other episodes.
    """
    records = activities(records) if records.of_streams else records
    reference = records if reference is None else reference
    _check_same(name, records, reference)
    least = np.min_scalar_type(-max(int(records.predicted.max(initial=0)) + 1, 1))
    return replace(episodes_only(reference), predicted=records.predicted.astype(least))


def episodes_only(records: EpisodeRecords) -> EpisodeRecords:
    """Return records with nothing of what happened: which episodes there are."""
    nothing = np.empty((len(records), 0))
    return EpisodeRecords(
        sequence=records.sequence,
        first=records.first,
        start=records.start,
        label=records.label,
        subjects=records.subjects,
        viewpoint=np.empty((len(records), 0, 3)),
        predicted=np.empty((len(records), 0), dtype=np.int8),
        true_probability=nothing,
        top_probability=nothing,
    )


def _check_same(name: str, episodes: EpisodeRecords, reference: EpisodeRecords) -> None:
    """Raise a DataError unless a planner ran the reference's episodes, in the same order."""
    if not reference.same_episodes(episodes):
        raise DataError(f"planner {name!r}: expected the same {len(reference)} episodes as the planner before it")
