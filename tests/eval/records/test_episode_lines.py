"""Test the file of episodes: it comes back as it was written, and lines that are off are named."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.errors import DataError
from ehar.files import write_text
from eval.records.contacts import CONTACTS, ContactRecords
from eval.records.episode_lines import episode_lines, read_episodes, stored_episodes
from eval.records.episodes import COLUMNS, DIGITS, SECOND, EpisodeRecords, join_records
from eval.records.flights import COSTS, KEYS, FlightRecords
from eval.records.run_files import EPISODES
from tests.helpers.made_records import flown, make_records, summary_of, three_planners


def test_records_read_back_are_the_records_written(tmp_path: Path) -> None:
    records = three_planners()
    write_text(tmp_path / EPISODES, episode_lines(records))
    back = read_episodes(tmp_path / EPISODES)
    assert list(back) == list(records)
    for name, episodes in records.items():
        assert back[name].sequence == episodes.sequence
        for field in (field for field in (*COLUMNS, SECOND) if field != "sequence"):
            np.testing.assert_array_equal(getattr(back[name], field), getattr(episodes, field))


def same(one: EpisodeRecords, other: EpisodeRecords) -> None:
    for name in (*COLUMNS, SECOND):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_records_that_are_read_a_few_at_a_time_are_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    records = {
        name: replace(
            flown(held),
            contacts=ContactRecords(*np.arange(len(CONTACTS) * len(held)).reshape(len(CONTACTS), -1)),
            tracking_error=held.top_probability,
        )
        for name, held in three_planners().items()
    }
    write_text(tmp_path / EPISODES, episode_lines(records))
    whole = read_episodes(tmp_path / EPISODES)
    monkeypatch.setattr("eval.records.episode_lines.LISTED", 3)
    for planner, found in read_episodes(tmp_path / EPISODES).items():
        same(found, whole[planner])
        assert found.flight is not None and found.contacts is not None and found.tracking_error is not None
        np.testing.assert_array_equal(found.tracking_error, records[planner].tracking_error)
        for name in CONTACTS:
            np.testing.assert_array_equal(getattr(found.contacts, name), getattr(records[planner].contacts, name))
        np.testing.assert_array_equal(found.flight.effort, records[planner].flight.effort)  # type: ignore[union-attr]
    lines = (tmp_path / EPISODES).read_text().splitlines()
    lines[3] = json.dumps(json.loads(lines[3]) | {"true_probability": [0.5]})
    write_text(tmp_path / EPISODES, "\n".join(lines))
    with pytest.raises(DataError, match=r"line 4: true_probability: .* as in the lines before"):
        read_episodes(tmp_path / EPISODES)


def test_stored_records_are_read_planner_by_planner(tmp_path: Path) -> None:
    records = three_planners()
    write_text(tmp_path / EPISODES, episode_lines(records))
    stored = stored_episodes(tmp_path / EPISODES)
    assert list(stored) == list(records)
    for planner in reversed(list(records)):
        same(stored[planner], records[planner])
    last = stored[planner]
    assert stored[planner] is last
    write_text(tmp_path / EPISODES, [])
    same(stored[next(iter(records))], records[next(iter(records))])  # put aside when they were read
    write_text(tmp_path / EPISODES, episode_lines(records))
    stored = stored_episodes(tmp_path / EPISODES)
    write_text(tmp_path / EPISODES, [])
    with pytest.raises(DataError, match=r"expected the episodes of .* where they were, got others"):
        dict(stored)
    write_text(tmp_path / EPISODES, episode_lines(records))
    lines = (tmp_path / EPISODES).read_text().splitlines(keepends=True)
    write_text(tmp_path / EPISODES, [*lines[1:], lines[0]])  # planners take turns
    assert isinstance(stored_episodes(tmp_path / EPISODES), dict)
    lines[20] = lines[20].replace('"first":', '"first":-')
    write_text(tmp_path / EPISODES, lines)
    with pytest.raises(DataError, match=r"episodes\.jsonl, line 21: first: expected whole numbers"):
        dict(stored_episodes(tmp_path / EPISODES))


def test_a_malformed_line_is_named(tmp_path: Path) -> None:
    lines = list(episode_lines({"mine": make_records(0)}))
    (tmp_path / EPISODES).write_text(lines[0] + '{"planner": "mine"}\n')
    with pytest.raises(DataError, match="line 2"):
        read_episodes(tmp_path / EPISODES)
    with pytest.raises(DataError, match="No such file"):
        read_episodes(tmp_path / "absent.jsonl")


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("label", -1, "label: expected whole numbers from 0, L = 4"),
        ("label", "1", "label: expected whole numbers"),
        ("label", 2**70, "label: expected whole numbers"),
        ("start", [1, 2], r"start: expected finite numbers, shape \(3\)"),
        ("predicted", [0, 1, 2], r"predicted: expected whole numbers from 0, shape \(L\), L = 4"),
        ("predicted", [0, 1, 2, 0.5], "predicted: expected whole numbers"),
        ("predicted", [], "predicted: expected a list of at least one frame"),
        ("viewpoint", [[1, 2, 3], [1, 2]], r"viewpoint: expected finite numbers, shape \(L, 3\)"),
        ("true_probability", [0, 0, 0, 1.5], r"true_probability: expected finite numbers from 0 to 1, shape \(L\)"),
        ("top_probability", [0, 0, 0, float("nan")], "top_probability: expected finite numbers from 0 to 1"),
        ("top_probability", None, "top_probability: expected finite numbers from 0 to 1"),
        ("subjects", [-2], r"subjects: expected whole numbers from -1, shape \(P\), P = 1"),
        ("subjects", [3, 4], r"subjects: expected whole numbers from -1, shape \(P\), P = 1"),
        ("subjects", [], "subjects: expected a list of at least one person"),
        ("sequence", 3, "sequence: expected a name, got 3"),
        ("planner", [], r"planner: expected a name, got \[\]"),
    ],
)
def test_a_field_that_is_off_is_named_with_its_line(tmp_path: Path, field: str, value: Any, message: str) -> None:
    lines = list(episode_lines({"mine": make_records(0)}))
    lines[2] = json.dumps({**json.loads(lines[2]), field: value}) + "\n"
    (tmp_path / EPISODES).write_text("".join(lines))
    with pytest.raises(DataError, match=rf"episodes\.jsonl, line 3: {message}"):
        read_episodes(tmp_path / EPISODES)


def test_a_file_that_is_cut_off_or_no_text_is_named(tmp_path: Path) -> None:
    lines = list(episode_lines({"mine": make_records(0)}))
    (tmp_path / EPISODES).write_text(lines[0] + lines[1][:100])
    with pytest.raises(DataError, match="line 2: expected one JSON object a line"):
        read_episodes(tmp_path / EPISODES)
    (tmp_path / EPISODES).write_bytes(b"\xff")
    with pytest.raises(DataError, match="expected text in UTF-8"):
        read_episodes(tmp_path / EPISODES)


def test_a_run_from_before_second_probabilities_is_read(tmp_path: Path) -> None:
    records = make_records(0)
    old = replace(records, second_probability=None)
    (tmp_path / EPISODES).write_text("".join(episode_lines({"mine": old})))
    assert read_episodes(tmp_path / EPISODES)["mine"].second_probability is None
    assert join_records([old, records]).second_probability is None
    both = [*list(episode_lines({"mine": old}))[:1], *list(episode_lines({"mine": records}))[1:]]
    (tmp_path / EPISODES).write_text("".join(both))
    with pytest.raises(DataError, match="line 2: some episodes have a second_probability, and others have none"):
        read_episodes(tmp_path / EPISODES)


def test_a_flight_from_before_costs_is_read_and_has_none(tmp_path: Path) -> None:
    now = flown(make_records(0))
    assert now.flight is not None
    old = replace(now, flight=FlightRecords(*(getattr(now.flight, key) for key in KEYS)))
    (tmp_path / EPISODES).write_text("".join(episode_lines({"mine": old})))
    read = read_episodes(tmp_path / EPISODES)["mine"]
    assert read.flight is not None and all(getattr(read.flight, key) is None for key in COSTS)
    together = join_records([old, now]).flight
    assert together is not None and together.energy is None
    both = [*list(episode_lines({"mine": old}))[:1], *list(episode_lines({"mine": now}))[1:]]
    (tmp_path / EPISODES).write_text("".join(both))
    with pytest.raises(DataError, match="line 2: some episodes have a distance, and others have none"):
        read_episodes(tmp_path / EPISODES)
    summary = summary_of({"no-act": old, "mine": old})
    assert not set(COSTS) & set(summary.to_json()["planners"][0])
    assert not {"flown [m]", "energy [kJ]"} & set(summary.tables()[0].header)


def test_half_of_a_flight_is_no_flight(tmp_path: Path) -> None:
    lines = list(episode_lines({"mine": flown(make_records(0))}))
    (tmp_path / EPISODES).write_text(lines[0].replace('"effort"', '"exertion"'))
    with pytest.raises(DataError, match="line 1: expected all of the fields"):
        read_episodes(tmp_path / EPISODES)
    (tmp_path / EPISODES).write_text(lines[0] + next(iter(episode_lines({"mine": make_records(0)}))))
    with pytest.raises(DataError, match="some episodes were flown, and others were not"):
        read_episodes(tmp_path / EPISODES)


def test_tracking_errors_come_back_and_are_none_where_a_batch_has_none(tmp_path: Path) -> None:
    records = make_records(0)
    errors = np.random.default_rng(0).random(records.predicted.shape).round(DIGITS)
    followed = replace(records, tracking_error=errors)
    (tmp_path / EPISODES).write_text("".join(episode_lines({"mine": followed})))
    read = read_episodes(tmp_path / EPISODES)["mine"].tracking_error
    assert read is not None
    np.testing.assert_array_equal(read, errors)
    assert join_records([followed, records]).tracking_error is None
    joined = join_records([followed, followed]).tracking_error
    assert joined is not None and joined.shape == (2 * len(errors), errors.shape[1])
