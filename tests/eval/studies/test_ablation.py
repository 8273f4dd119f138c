import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.conditions import Conditions
from ehar.data.motion_file import save_motion
from ehar.data.streams.file import save_streams
from ehar.errors import DataError, UsageError
from ehar.localisation import Localisation
from eval.cli.main import main
from eval.records.episode_lines import read_episodes
from eval.running.run import read_run
from eval.scores.metrics import mean_acc
from eval.studies.ablation import GROUPS, Ablation, ablation, ablation_tables, variants
from planners.search.next_best_view import NextBestView
from planners.value.belief.streams import StreamBeliefModel
from planners.value.fit import VARIANTS
from planners.value.model import GainModel
from tests.helpers.fakes import tiny_data
from tests.helpers.gain_models import model_of, peak_weights
from tests.helpers.stream_runs import FRAMES, forgetful
from tests.helpers.streams import raising_streams
from tests.helpers.tiny_benchmarks import HashedRecogniser, Log

LEVEL = np.array([8.0, 0.0, np.pi / 2])  # where the fake recogniser sees best


def model() -> GainModel:
    made = model_of(peak_weights(LEVEL))
    return replace(made, fields=dict.fromkeys(VARIANTS, made.fields["full"]))


@pytest.fixture(autouse=True)
def known_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("recognition.storage.load_recogniser", lambda *_, **__: HashedRecogniser())
    monkeypatch.setattr("eval.running.choice.ModelPlace.load_gain_model", lambda _: model())


def ablated(**options: Any) -> Ablation:
    conditions = Conditions(data=tiny_data(sequences=20), length=10, seed=options.pop("seed", 0))
    return ablation(conditions, **{"reporter": Log(), "groups": ["search"], **options})


def test_every_group_has_variants_that_differ_from_nbv_in_one_thing() -> None:
    groups = variants(model())
    assert tuple(groups) == GROUPS
    names = [planner.name for planners in groups.values() for planner in planners]
    assert len(set(names)) == len(names)
    nbv = NextBestView(model=model())
    for group, option in (("horizon", "horizon"), ("replan", "replan"), ("effort", "effort_weight")):
        for planner in groups[group]:
            changed = [
                name for name in ("horizon", "replan", "effort_weight") if getattr(planner, name) != getattr(nbv, name)
            ]
            assert changed == [option]
            assert planner.name.endswith(f" {getattr(planner, option):g}")


def test_rows_stand_beside_nbv_on_the_same_episodes(tmp_path: Path) -> None:
    result = ablated(out=tmp_path / "out")
    assert result.groups == {"search": ("nbv-search", "nbv-greedy")}
    (table,) = ablation_tables(result)
    assert [row[:2] for row in table.rows] == [
        ("no-act", ""),
        ("nbv", ""),
        ("nbv-search", "search"),
        ("nbv-greedy", "search"),
        ("oracle*", ""),
    ]
    cells = {row[0]: dict(zip(table.header, row, strict=True)) for row in table.rows}
    assert cells["nbv"]["minus nbv [95 %]"] == cells["oracle*"]["minus nbv [95 %]"] == "-"
    assert cells["nbv"]["fallbacks"].endswith(" of 20")  # a plan for each of 2 windows of 10 test sequences
    records = read_episodes(tmp_path / "out" / "episodes.jsonl")
    difference = 100 * (mean_acc(records["no-act"].correct) - mean_acc(records["nbv"].correct)).mean()
    assert cells["no-act"]["minus nbv [95 %]"].startswith(f"{difference:+.1f} [")
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["groups"] == {
        "search": ["nbv-search", "nbv-greedy"]
    }
    assert r"oracle\*" in (tmp_path / "out" / "table.md").read_text()
    with pytest.raises(UsageError, match="another run"):
        ablated(out=tmp_path / "out", seed=1)


def test_flights_are_compared_with_nbv_on_the_ideal_track() -> None:
    result = ablated(groups=[], tracks=["px4-max"])
    grid, flights = ablation_tables(result)
    assert [row[0] for row in grid.rows] == ["no-act", "nbv", "oracle*"]
    assert [row[0] for row in flights.rows] == ["ideal", "px4-max"]
    cells = dict(zip(flights.header, flights.rows[1], strict=True))
    assert 0 < float(cells["peak [m/s]"]) <= 12
    assert cells["minus nbv [95 %]"] != "-"


def test_streams_are_watched_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    forgetful(monkeypatch)
    exact = Localisation(noise=0.0, delay=0.0)
    in_streams = replace(model(), belief=StreamBeliefModel.believing((0.25,) * 4), localisation=exact)
    monkeypatch.setattr("eval.running.choice.ModelPlace.load_gain_model", lambda _: in_streams)
    path = tmp_path / "raising.npz"
    save_streams(path, raising_streams())
    conditions = Conditions(data=path, length=FRAMES, world="room")
    (table,) = ablation(conditions, groups=["knowledge"], out=tmp_path / "out", reporter=Log()).tables()
    assert [row[0] for row in table.rows] == [
        "no-act",
        "nbv",
        "without belief",
        "without embedding",
        "without facing",
        "oracle*",
    ]
    assert "activities in 4 episodes" in table.title
    # The field was made where people are localised without an error, and is used where they are not.
    assert read_run(tmp_path / "out").config.trained_localisations == {"gain field": exact}
    assert set(read_run(tmp_path / "out").records) == {row[0].rstrip("*") for row in table.rows}
    with pytest.raises(DataError, match="expected an activity that begins and ends within an episode of 2 frames"):
        ablation(replace(conditions, length=2), reporter=Log())


def test_missing_intervals_are_said_to_be_missing() -> None:
    result = ablated(groups=[])
    without = tuple(replace(difference, ci95_corrected=None) for difference in result.summary.differences)
    (table,) = ablation_tables(
        result._replace(summary=replace(result.summary, differences=without, no_intervals="why"))
    )
    assert table.rows[0][table.header.index("minus nbv [95 %]")].endswith(" [-]")
    assert table.footnotes[-1] == "[-] No intervals: why."


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"groups": ["colour"]}, "unknown group 'colour'"),
        ({"tracks": ["ideal"]}, "expected vehicles"),
        ({"tracks": ["px4-max", "px4-max"]}, "each once"),
        ({"tracks": ["rail"]}, "unknown track 'rail'"),
    ],
)
def test_bad_input_is_named(options: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        ablated(**options)


def test_the_command_prints_its_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "tiny.npz"
    save_motion(path, tiny_data(sequences=20))
    main(["study", "ablation", "--data", str(path), "--length", "10", "--groups", "horizon", "--workers", "1"])
    printed = capsys.readouterr().out
    assert "horizon 30" in printed
    assert "minus nbv" in printed
