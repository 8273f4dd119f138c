"""A sweep trains several sets as one graph: what fails stops nothing else, and what is done is kept."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ehar.conditions import Conditions
from ehar.errors import DataError, UsageError
from ehar.processes import Engine, Processes
from eval.cli.main import main, parse
from eval.running import sweep
from eval.running.cost import Steps, duration, predicted, steps_of
from eval.running.sweep import Stage, SweepConfig, stages_of, train_sets
from eval.running.training import TrainAllConfig, Trained
from planners.agents.config import AgentTrainingConfig
from tests.helpers.fakes import tiny_data
from tests.helpers.streams import raising_streams

SHORT = Conditions(length=10)


def config(out: Path, **changes: Any) -> SweepConfig:
    sets = tuple(replace(tiny_data(sequences=40), name=name) for name in ("one", "two"))
    return SweepConfig(**{"conditions": SHORT, "data": sets, "out": out, "workers": 1, **changes})


@pytest.fixture
def trained(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Replace trainings by notes of their names; the gain field of the first set fails, and il of the second."""
    heard: list[str] = []

    def train(stage: Stage, config: TrainAllConfig, inside: Engine, note: Callable[[str], None]) -> bool:
        heard.append(str(stage))
        note("warning: cut short" if stage.kind == "recogniser" else "it had learned")
        if (stage.data, stage.kind) == ("one", "gain field"):
            raise DataError("one: expected more")
        if (stage.data, stage.kind, stage.seed) == ("two", "il", 7):
            raise ZeroDivisionError("nothing\nthere")
        return stage.kind == "fixed-best"

    monkeypatch.setattr(sweep, "_train", train)
    monkeypatch.setattr("eval.running.sweep.step_seconds", lambda _: 0.5)
    return heard


def test_each_stage_waits_for_those_that_it_needs(tmp_path: Path) -> None:
    graph = stages_of(config(tmp_path, seeds=(7, 8)).sets)
    assert len(graph) == 2 * (3 + 2 + 4 * 2)
    assert graph[Stage("two", "recogniser")] == ()
    assert graph[Stage("two", "gain field")] == graph[Stage("two", "ppo", 7)] == (Stage("two", "recogniser"),)
    assert graph[Stage("two", "il-ppo", 8)] == (Stage("two", "il", 8),)
    assert graph[Stage("two", "dagger", 8)] == (Stage("two", "demonstrations", agent="dagger"),)


def test_the_papers_agents_draw_their_own_demonstrations_and_need_no_field(tmp_path: Path) -> None:
    paper = config(tmp_path, setting="paper", conditions=replace(SHORT, views="paper"))
    assert {stage.kind for stage in stages_of(paper.sets)} == {"recogniser", "il", "ppo", "il-ppo"}
    tiny = config(tmp_path, setting="tiny")
    assert {stage.kind for stage in stages_of(tiny.sets)} == {"recogniser", "gain field", "demonstrations", "il"}


def test_a_first_try_is_for_every_place_that_takes_settings(tmp_path: Path) -> None:
    tiny = config(tmp_path, setting="tiny").sets
    assert {stage.kind for stage in stages_of(tiny)} == {"recogniser", "gain field", "demonstrations", "il"}
    least, most = steps_of(tiny["one"], tiny_data(sequences=40), "recogniser")
    assert least == most == 20
    with pytest.raises(SystemExit):
        main(["train", "all", "--data", "duo", "--setting", "tinier", "--out", str(tmp_path)])
    assert callable(parse(["train", "all", "--data", "duo", "--setting", "tiny", "--out", str(tmp_path)]))


def test_what_fails_stops_nothing_but_what_needs_it(
    tmp_path: Path, trained: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    done = train_sets(config(tmp_path, seeds=(7, 8)))
    assert done.failed
    assert done.lines == (
        "one, gain field failed: one: expected more",
        "two, il seed 7 failed: ZeroDivisionError: nothing there",
        "left out, as they need these: 1 stage",
    )
    assert len(trained) == 26 - 1
    assert "two, il-ppo seed 7" not in trained
    for first, then in (("one, recogniser", "one, ppo seed 8"), ("two, il seed 8", "two, il-ppo seed 8")):
        assert trained.index(first) < trained.index(then)
    heard = capsys.readouterr()
    assert "two, fixed-best: kept" in heard.err
    assert heard.err.count("warning: cut short") == 2 and "it had learned" not in heard.err
    assert "26 stages" in heard.out


def test_a_sweep_says_what_follows_and_ends_with_1_if_something_failed(
    tmp_path: Path, trained: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    line, failed = train_sets(config(tmp_path, seeds=(8,))).lines
    assert line.startswith("next: ehar benchmark --data ")
    assert line.endswith(f"--models {tmp_path / 'two'} --length 10")
    assert failed.startswith("one, gain field failed")

    def failing(config: SweepConfig) -> Trained:
        """Train."""
        return Trained((), ("one failed",), failed=len(config.data) > 1)

    monkeypatch.setattr(sweep, "train_sets", failing)
    main(["train", "all", "--data", "duo", "--setting", "tiny", "--out", str(tmp_path)])
    with pytest.raises(SystemExit) as exit_code:
        main(["train", "all", "--data", "duo", "solo", "--out", str(tmp_path)])
    assert exit_code.value.code == 1


def test_one_set_on_this_machine_is_trained_as_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[TrainAllConfig] = []
    monkeypatch.setattr(sweep, "train_all", lambda config, foretell: told.append(config) or Trained((), (foretell(),)))
    monkeypatch.setattr(sweep, "step_seconds", lambda _: 0.5)
    begun = train_sets(config(tmp_path, data=("duo",), seeds=(7, 8), workers=3)).lines
    assert begun[0].startswith("13 stages on 1 set: ") and begun[0].endswith(" on 3")
    kept, heard = [Stage("duo", kind) for kind in ("recogniser", "gain field")], list[Any]()
    monkeypatch.setattr(sweep, "_is_kept", lambda stage, _: stage in kept)
    monkeypatch.setattr(sweep, "predicted", lambda graph, costs, cores: heard.append(costs) or Steps(1, 2))
    train_sets(config(tmp_path, data=("duo",), seeds=(7, 8), workers=3))
    assert [stage for stage, cost in heard[0].items() if cost.most == 0] == kept, "what is done costs nothing"
    assert told.pop() == told[0]
    assert told == [TrainAllConfig(conditions=replace(SHORT, data="duo"), out=tmp_path, seeds=(7, 8), workers=3)]


def test_sets_share_the_processes(tmp_path: Path) -> None:
    four = config(tmp_path, workers=4)
    assert (four.machines, four.inside) == (Processes(2), Processes(2))
    assert {name: (one.out, one.workers) for name, one in four.sets.items()} == {
        name: (tmp_path / name, 2) for name in ("one", "two")
    }
    assert config(tmp_path, workers=1).machines == Processes(1)


def test_what_cannot_be_trained_is_told_before_anything_begins(tmp_path: Path, trained: list[str]) -> None:
    with pytest.raises(UsageError, match=r"^--data: expected sets with different names, got duo twice$"):
        train_sets(config(tmp_path, data=("duo", "a/duo.npz")))
    with pytest.raises(DataError, match=r"^one: the recogniser could not be trained: expected 1 training sequence"):
        train_sets(config(tmp_path, conditions=Conditions(length=60)))
    assert trained == []


def test_costs_are_those_of_the_stages_on_so_many_cores(tmp_path: Path) -> None:
    (one, _) = config(tmp_path, seeds=(7, 8)).sets.values()
    data = tiny_data()
    least, most = steps_of(one, data, "recogniser")
    assert (least, most) == (20_000 / 32, 400_000 / 32)
    for kind in ("gain field", "il", "ppo"):
        least, most = steps_of(one, data, kind)
        assert 0 < least < most
    a, b, c = Stage("one", "recogniser"), Stage("one", "ppo", 0), Stage("one", "ppo", 1)
    costs = {a: Steps(10, 20), b: Steps(4, 8), c: Steps(6, 9)}
    graph = {a: (), b: (a,), c: (a,)}
    assert predicted(graph, costs, 1) == Steps(20, 37)
    assert predicted(graph, costs, 2) == predicted(graph, costs, 50) == Steps(16, 29)
    assert [duration(seconds) for seconds in (40, 720, 12_600)] == ["40 s", "12 min", "3.5 h"]


def test_stages_on_streams_cost_as_many_steps_more_as_their_windows_are_longer(tmp_path: Path) -> None:
    clips = TrainAllConfig(conditions=Conditions(length=60), out=tmp_path)
    streams = replace(clips, conditions=Conditions())
    data, flown = tiny_data(frames=60), raising_streams(people=20)
    assert steps_of(streams, flown, "recogniser") == steps_of(clips, data, "recogniser")
    for kind, times in (("gain field", 8 / 4), ("ppo", 60 / 40)):  # windows of 8 s and 4 s; 4 s are 40 frames
        one, other = steps_of(streams, flown, kind), steps_of(clips, data, kind)
        assert one == pytest.approx([times * steps for steps in other])
    assert steps_of(streams, flown, "fixed-best").most > 0


def test_a_stage_on_a_machine_without_the_folder_says_so(tmp_path: Path) -> None:
    sets = config(tmp_path).sets
    task = sweep._Task(sets, Processes(), tmp_path / "elsewhere")
    error = sweep.run_stage(task, Stage("one", "recogniser")).error
    assert error.startswith(f"{tmp_path / 'elsewhere'}: machine ") and error.endswith(
        "cannot open it: No such file or directory; expected a folder that all machines share"
    )


def test_a_warning_of_an_agents_training_names_it_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def train(config: AgentTrainingConfig, report: Any, note: Callable[[str], None]) -> None:
        note(f"{config.stages} seed {config.seeds[0]}: warning: cut short")

    monkeypatch.setattr("planners.agents.training.train_agents", train)
    task = sweep._Task(config(tmp_path).sets, Processes(), tmp_path)
    assert sweep.run_stage(task, Stage("one", "il", 7)).warnings == ("warning: cut short",)
