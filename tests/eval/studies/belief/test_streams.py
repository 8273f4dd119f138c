"""The study of the belief in streams: the same episodes for every reader."""

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from ehar.conditions import Conditions
from ehar.data.scenario import TEST
from ehar.data.streams.data import StreamData
from ehar.data.streams.file import save_streams
from ehar.errors import DataError, UsageError
from eval import Watcher
from eval.records.episodes import EpisodeRecords
from eval.scores.planner_metrics import NLL
from eval.scores.streams.alarms import alarms_per_minute
from eval.studies.belief.stream_report import StreamBeliefReport, read_report, write_report
from eval.studies.belief.study import belief_report
from eval.studies.folds import take_together
from eval.studies.trainings import trainings
from tests.helpers.other_people import with_others
from tests.helpers.stream_worlds import save_stream_world
from tests.helpers.streams import raising_streams
from tests.helpers.tiny_benchmarks import Log


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_stream_world(tmp_path_factory.mktemp("streams"))


def test_every_reader_is_scored_on_the_same_episodes(folder: Path, tmp_path: Path) -> None:
    conditions = Conditions(data=str(folder / "raising.npz"), models=folder / "models", length=50)
    report = belief_report(conditions, out=tmp_path, reporter=Log())
    assert isinstance(report, StreamBeliefReport)
    names = ["recogniser", "belief", "without transitions", "without durations", "without viewpoint"]
    assert [(reader.rollouts, reader.name) for reader in report.readers] == [
        (planner, name) for planner in ("no-act", "random") for name in names
    ]
    first = report.readers[0]
    for reader in report.readers[1:5]:
        np.testing.assert_array_equal(reader.records.label, first.records.label)
        np.testing.assert_array_equal(reader.records.viewpoint, first.records.viewpoint)
        lower = NLL.of_records(first.records) - NLL.of_records(reader.records)
        assert reader.better == pytest.approx(lower)
        assert reader.better_ci95 is not None
        assert reader.better_ci95[0] <= reader.better <= reader.better_ci95[1]
        assert reader.alarms == first.alarms
        assert reader.sooner_s == pytest.approx(first.delay_s - reader.delay_s)
    assert first.better == first.sooner_s == 0
    assert first.alarms == min(
        alarms_per_minute(reader.records.label, reader.records.predicted, report.fps) for reader in report.readers[:2]
    )
    told = str(report.tables()[0].footnotes)
    assert f"({first.alarms:.1f} with no-act, " in told and "not corrected together" in told
    # The recogniser has learned next to nothing. A second of each activity, and a second of none, is worth knowing.
    assert report.readers[1].better > 0
    assert "| no-act | belief |" in (tmp_path / "table.md").read_text()
    assert (tmp_path / "config.json").is_file()
    watcher = Watcher(models=folder / "models", sensor="perfect", belief=tmp_path / "belief.json")
    assert watcher.belief_model == report.model


def test_the_belief_does_not_know_who_is_tested(folder: Path, tmp_path: Path) -> None:
    models, found = [], []
    for part in (None, TEST, "policy"):
        data = raising_streams() if part is None else with_others(raising_streams(), part)
        assert isinstance(data, StreamData)
        save_streams(tmp_path / f"{part}.npz", data)
        conditions = Conditions(data=str(tmp_path / f"{part}.npz"), models=folder / "models", length=50)
        report = belief_report(conditions, reporter=Log())
        assert isinstance(report, StreamBeliefReport)
        models.append(asdict(report.model) if report.model else None)
        found.append(report.readers[1].nll)
    assert models[0] is not None and models[1] == models[0] and models[2] != models[0]
    assert found[1] != found[0]


def test_episodes_that_hold_no_activity_are_refused(folder: Path) -> None:
    told = Conditions(data=str(folder / "raising.npz"), models=folder / "models", length=3)
    with pytest.raises(DataError, match="expected an activity that begins and ends within an episode of 3 frames"):
        belief_report(told, reporter=Log())


def test_folds_are_one_report_of_all_their_people(folder: Path, tmp_path: Path) -> None:
    told = Conditions(data=str(folder / "raising.npz"), models=folder / "models", length=50)
    one = belief_report(told, out=tmp_path / "0", reporter=Log())
    assert isinstance(one, StreamBeliefReport)

    def other(records: EpisodeRecords) -> EpisodeRecords:
        names = tuple(f"{name} of others" for name in records.sequence)
        return replace(records, sequence=names, subjects=records.subjects + 100, predicted=records.predicted[::-1])

    second = replace(
        one,
        config=replace(one.config, recogniser_sha256="other"),
        records={name: other(held) for name, held in one.records.items()},
    )
    write_report(tmp_path / "1", second)
    (tmp_path / "1" / "belief.json").write_text("{}")
    both = take_together([tmp_path / "0", tmp_path / "1"], out=tmp_path / "both")
    assert isinstance(both, StreamBeliefReport) and both.basis.people == 2 * (one.basis.people or 0)
    for reader, alone in zip(both.readers, one.readers, strict=True):
        assert (reader.rollouts, reader.name) == (alone.rollouts, alone.name)
        assert len(reader.records) == 2 * len(alone.records)
        assert reader.better == pytest.approx(alone.better)  # the others' words are as probable
    assert "Intervals rest on" in (tmp_path / "both" / "table.md").read_text()
    with pytest.raises(UsageError, match="expected a recogniser of each, got the same"):
        take_together([tmp_path / "0", tmp_path / "0"])


def test_trainings_are_one_report_whose_figures_are_their_means(folder: Path, tmp_path: Path) -> None:
    told = Conditions(data=str(folder / "raising.npz"), models=folder / "models", length=50)
    one = belief_report(told, out=tmp_path / "0", reporter=Log())
    assert isinstance(one, StreamBeliefReport)

    def other(records: EpisodeRecords) -> EpisodeRecords:
        sure = np.sqrt(records.true_probability)
        return replace(records, true_probability=sure, predicted=np.roll(records.predicted, 7, axis=1))

    records = {name: other(held) for name, held in one.records.items()}
    for number in (1, 2):
        write_report(
            tmp_path / f"{number}",
            replace(one, config=replace(one.config, recogniser_sha256=f"{number}"), records=records),
        )
        (tmp_path / f"{number}" / "belief.json").write_text("{}")
    both = trainings([tmp_path / f"{number}" for number in range(3)], out=tmp_path / "all")
    alone = read_report(one.config, records, one.fps)
    assert isinstance(both, StreamBeliefReport) and both.basis == one.basis
    for reader, first, second in zip(both.readers, one.readers, alone.readers, strict=True):
        assert (reader.rollouts, reader.name) == (first.rollouts, first.name)
        assert reader.nll == pytest.approx((first.nll + 2 * second.nll) / 3)
        assert reader.better == pytest.approx((first.better + 2 * second.better) / 3)
        assert reader.delay_s == pytest.approx((first.delay_s + 2 * second.delay_s) / 3)
        assert reader.alarms == pytest.approx((first.alarms + 2 * second.alarms) / 3)
    assert "3 trainings" in (tmp_path / "all" / "table.md").read_text()
