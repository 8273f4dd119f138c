import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest

from ehar.data.motion_file import save_motion
from ehar.errors import DataError, UsageError
from ehar.files import write_text
from eval.cli.main import main
from eval.records.config import CONFIG, PlannerConfig
from eval.records.episode_lines import episode_lines
from eval.records.episodes import EpisodeRecords
from eval.records.run_files import EPISODES, SUMMARY
from eval.running.run import read_run
from eval.studies.behaviour.agent_states import Purity
from eval.studies.behaviour.analyse import analyse
from eval.studies.behaviour.figure import draw_states
from planners.agents.network import STATE
from tests.helpers.agents import save_untrained
from tests.helpers.fakes import CLASS_NAMES, tiny_data
from tests.helpers.made_records import CONFIG_OF_RUN, flown, make_records, write_finished
from tests.helpers.seeing import Seeing
from tests.helpers.stream_runs import forgetful, stream_run
from tests.helpers.tiny_benchmarks import Log
from tests.helpers.tiny_benchmarks import run as run_tiny

pytestmark = pytest.mark.usefixtures("fake_weights")


def planner(seed: int, skill: float = 0.0) -> EpisodeRecords:
    """Return records of a camera that hovers."""
    records = make_records(seed, skill=skill, episodes=20, length=12)
    start = np.tile([6.0, 0.0, 0.0], (20, 1))
    return replace(records, start=start, viewpoint=np.tile(start[:, None], (1, 12, 1)))


def written(directory: Path, records: dict[str, EpisodeRecords], **options: Any) -> Path:
    return write_finished(directory, records, length=12, **options)


def test_a_run_from_its_folder_to_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_motion(tmp_path / "tiny.npz", tiny_data(sequences=40))
    directory = tmp_path / "run"
    run_tiny(["no-act", "v-rotate", "oracle"], starts=1, data=tmp_path / "tiny.npz", out=directory)
    main(["study", "analyse", str(directory), "--planners", "v-rotate", "oracle"])
    found = {path.name for path in (directory / "analysis").iterdir()}
    assert found == {"analysis.json", "analysis.md", "positions.png", "moves.png"}
    result = json.loads((directory / "analysis" / "analysis.json").read_text())
    assert list(result["table_4"]) == ["no-act", "v-rotate", "oracle"]
    assert set(result["table_4"]["no-act"]["by_class"]) == set(CLASS_NAMES)
    assert list(result["figure_7"]) == ["v-rotate", "oracle"]
    for shares in result["figure_7"].values():
        assert sum(shares["whole episode"].values()) == pytest.approx(1)
    # V-Rotate only changes the polar angle.
    assert {name for name, share in result["figure_7"]["v-rotate"]["whole episode"].items() if share} <= {
        "polar+",
        "polar-",
        "hover",
    }
    assert result["states"] is None
    for name in ("positions.png", "moves.png"):
        assert matplotlib.image.imread(directory / "analysis" / name).std() > 0.05
    tables = (directory / "analysis" / "analysis.md").read_text()
    assert "v-rotate (embodied)" in tables and "no-act (passive)" in tables and "nod" in tables
    printed = capsys.readouterr()
    assert "Moves (Fig. 7a-d)" in printed.out
    assert printed.err.endswith(f"written to {directory / 'analysis'}\n")


def test_the_states_of_a_learned_planner_are_drawn(tmp_path: Path) -> None:
    save_motion(tmp_path / "tiny.npz", tiny_data(sequences=30))
    directory = tmp_path / "run"
    run_tiny(["no-act", Seeing()], starts=1, data=tmp_path / "tiny.npz", out=directory)
    analysis = analyse(
        directory,
        planners=["seeing"],
        states="seeing",
        out=tmp_path / "out",
        load=lambda run, name: Seeing(),
        reporter=Log(),
    )
    assert analysis.states is not None
    assert analysis.states.mapped.shape == (2 * analysis.episodes, 2)  # frames 0 and 5 of 9
    assert 0 <= analysis.states.purity.purity <= 1
    assert matplotlib.image.imread(tmp_path / "out" / "states.png").std() > 0.02
    assert "by chance [%]" in (tmp_path / "out" / "analysis.md").read_text()
    with pytest.raises(UsageError, match="planner 'seeing': expected a learned one"):
        analyse(directory, planners=["seeing"], states="seeing", reporter=Log())


def test_nothing_is_cut_off_beside_long_names_of_classes(tmp_path: Path) -> None:
    mapped = np.random.default_rng(0).normal(size=(40, 2))
    names = ("exchanging_something", "shaking_both_hands")
    purity = Purity(neighbours=10, purity=0.278, chance=0.117)
    draw_states(mapped, np.arange(40) % 2, names, "a run", purity, tmp_path / "states.png")
    assert matplotlib.image.imread(tmp_path / "states.png")[:, [0, 1, -2, -1], :3].min() > 0.95


def test_the_states_of_an_agent_are_drawn_by_its_record_name(tmp_path: Path) -> None:
    data = tiny_data(sequences=30)
    save_motion(tmp_path / "tiny.npz", data)
    save_untrained(tmp_path, data, "il-ppo", seed=1)
    directory = tmp_path / "run"
    source = tmp_path / "tiny.npz"
    run_tiny(["no-act", "il-ppo"], starts=1, data=source, models=tmp_path, out=directory)
    main(["study", "analyse", str(directory), "--states", "il-ppo/1"])
    result = json.loads((directory / "analysis" / "analysis.json").read_text())
    assert result["states"]["planner"] == "il-ppo/1"
    assert result["states"]["size"] == STATE
    assert [row["name"] for row in result["table_3"]] == ["il-ppo"]
    assert (directory / "analysis" / "states.png").exists()


def test_training_seeds_are_taken_together(tmp_path: Path) -> None:
    seeds = {"il-ppo/0": planner(1, 1.0), "il-ppo/1": planner(2, 2.0)}
    parts = {"il-ppo-no-vision/0": planner(3), "il-ppo-no-vision/1": planner(4), "il-ppo-no-position/0": planner(5)}
    directory = written(tmp_path / "run", {"no-act": planner(0), **seeds, **parts})
    log = Log()
    analysis = analyse(directory, reporter=log)
    assert [(row.name, row.seeds) for row in analysis.seed_accuracy] == [
        ("il-ppo-no-vision", 2),
        ("il-ppo-no-position", 1),
        ("il-ppo", 2),
    ]
    assert list(analysis.predictable) == ["no-act", "il-ppo"]
    accuracy = np.mean([record.correct[:, -1].mean() for record in seeds.values()])
    assert 1 - analysis.predictable["il-ppo"].total[3] == pytest.approx(accuracy)
    # The data of this run are nowhere to be read.
    assert analysis.class_names == ("class 0", "class 1", "class 2") and "numbered" in log.notes[0]
    tables = (directory / "analysis" / "analysis.md").read_text()
    assert "Table 3" in tables and "±" in tables


def test_no_act_is_shown_of_a_run_of_trainings_too(tmp_path: Path) -> None:
    records = {
        f"{name}@{training}": planner(2 * row + training)
        for row, name in enumerate(("no-act", "nbv"))
        for training in range(2)
    }
    analysis = analyse(written(tmp_path / "run", records), reporter=Log())
    assert list(analysis.predictable) == list(analysis.positions) == ["no-act", "nbv"]


def test_a_flight_has_no_moves(tmp_path: Path) -> None:
    directory = written(tmp_path / "run", {"nbv": flown(planner(0))}, track="px4-max")
    log = Log()
    analysis = analyse(directory, reporter=log)
    assert analysis.moves is None and list(analysis.positions) == ["nbv"]
    assert not (directory / "analysis" / "moves.png").exists()
    assert any("px4-max" in note for note in log.notes)


@pytest.mark.parametrize(
    ("planners", "expected"),
    [
        (["nbv"], "no planner 'nbv'; expected one of: no-act, il"),
        (["no-act"], "expected some beside no-act"),
        ([], "neither il-ppo nor nbv ran"),
    ],
)
def test_planners_that_did_not_run_are_refused(tmp_path: Path, planners: list[str], expected: str) -> None:
    directory = written(tmp_path / "run", {"no-act": planner(0), "il": planner(1)})
    with pytest.raises(UsageError, match=expected):
        analyse(directory, planners=planners, reporter=Log())


def test_streams_are_analysed_but_for_states_of_agents(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    forgetful(monkeypatch)
    run = stream_run(tmp_path, ("no-act", "h-rotate"))
    with pytest.raises(UsageError, match="expected no --states, as states of streams are not mapped"):
        analyse(run, states="h-rotate", reporter=Log())
    assert list(analyse(run, planners=["h-rotate"], reporter=Log()).predictable) == ["no-act", "h-rotate"]


def test_what_is_no_finished_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"config\.json: expected a run of ehar benchmark, got: No such file"):
        read_run(tmp_path)
    (tmp_path / CONFIG).write_text('{"source": "duo"}')
    with pytest.raises(UsageError, match="data_sha256"):
        read_run(tmp_path)
    (tmp_path / CONFIG).write_text(json.dumps({**CONFIG_OF_RUN.to_json(), "seed": "none"}))
    with pytest.raises(DataError, match="seed: expected a whole number, got 'none'"):
        read_run(tmp_path)


def test_an_incomplete_run_is_called_so(tmp_path: Path) -> None:
    short = make_records(1, episodes=5, length=12)
    cut = written(tmp_path / "cut", {"no-act": short})
    write_episodes(cut, {"no-act": planner(0), "nbv": short})
    with pytest.raises(DataError, match="this one is incomplete: nbv has 5 of 20 episodes"):
        read_run(cut)
    missing = written(tmp_path / "missing", {"no-act": short}, planners=(PlannerConfig("nbv", False, ""),))
    with pytest.raises(DataError, match="this one is incomplete: no episodes of nbv"):
        read_run(missing)
    whole = written(tmp_path / "whole", {"no-act": planner(0)})
    assert list(read_run(whole).records) == ["no-act"]
    (whole / SUMMARY).unlink()
    with pytest.raises(DataError, match=r"this one is incomplete: no summary\.json"):
        read_run(whole)
    empty = written(tmp_path / "empty", {"no-act": planner(0)})
    (empty / EPISODES).write_text("")
    with pytest.raises(DataError, match="this one is incomplete: no episodes of any planner"):
        read_run(empty)
    other = {"no-act": short, "nbv": replace(short, first=short.first + 1)}
    write_episodes(cut, other)
    with pytest.raises(DataError, match="expected the same episodes for every planner, those of nbv are not no-act's"):
        read_run(cut)


def write_episodes(directory: Path, records: dict[str, EpisodeRecords]) -> None:
    write_text(directory / EPISODES, episode_lines(records))
