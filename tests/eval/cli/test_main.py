import json
import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from ehar.data.motion_file import save_motion
from ehar.data.readers import READERS
from eval.cli.main import COMMANDS, main
from tests.helpers.commands import fails_with
from tests.helpers.fakes import tiny_data
from tests.helpers.places import SHARED
from tests.helpers.tiny_benchmarks import HashedRecogniser


@pytest.fixture
def tiny(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setattr("recognition.storage.load_recogniser", lambda *_, **__: HashedRecogniser())
    path = tmp_path / "tiny.npz"
    save_motion(path, tiny_data(sequences=20))
    return path


def exit_code(arguments: list[str]) -> object:
    try:
        main(arguments)
    except SystemExit as ended:
        return ended.code
    return 0


def test_benchmark_prints_a_table_and_writes_a_run(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    options = ["--data", str(tiny), "--length", "10", "--workers", "1", "--out", str(out)]
    main(["benchmark", "no-act", "oracle", *options])
    printed = capsys.readouterr().out
    assert "tiny (synthetic)" in printed
    assert "oracle*" in printed
    assert "gap closed" in printed
    summary = json.loads((out / "summary.json").read_text())
    assert [planner["name"] for planner in summary["planners"]] == ["no-act", "oracle"]
    assert "another run" in fails_with(["benchmark", "no-act", *options], capsys)


def test_headroom_prints_its_tables(tiny: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(
        [
            "study",
            "headroom",
            "--data",
            str(tiny),
            "--length",
            "10",
            "--azimuths",
            "2",
            "--polars",
            "2",
            "--workers",
            "1",
        ]
    )
    assert "best fixed per sample" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["no-act", "teleport"], "unknown planner 'teleport'"),
        (["--data", "trio"], "unknown data 'trio'"),
        (["--data", "absent.npz"], "absent.npz: no such file"),
        (["--track", "rail"], "unknown track 'rail'"),
        (
            ["no-act", "--track", "px4-max", "--ideal", "absent"],
            "config.json: expected a run of ehar benchmark",
        ),
        (["no-act", "--ideal", "absent"], "the track is ideal; expected a vehicle"),
        (["--readout", "tarot"], "unknown readout 'tarot'; expected recogniser or belief"),
        (["--readout", "belief"], "expected a gain field, as made by `ehar train gain-field"),
        (["nbv"], "expected a gain field, as made by `ehar train gain-field"),
        (["--length", "1000"], "at least 1000 frames"),
        (["absent.py:Mine"], "planner file absent.py"),
    ],
)
def test_bad_input_ends_in_one_line(
    tiny: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    options = ["--data", str(tiny), "--length", "10", "--workers", "1"]
    assert message in fails_with(["benchmark", *options, *arguments], capsys)


def test_a_planner_file_that_returns_nan_is_named(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = """
        from ehar.planner import Planner
        class Lost(Planner):
            name = "lost"
            def reset(self, context): pass
            def act(self, observation): return observation.viewpoint * float("nan")
    """
    (tmp_path / "lost.py").write_text("\n".join(line[8:] for line in source.splitlines()))
    arguments = ["benchmark", f"{tmp_path}/lost.py:Lost", "--data", str(tiny), "--length", "10", "--workers", "1"]
    assert "planner 'lost', episode 'sequence-10 from frame 0', frame 0" in fails_with(arguments, capsys)


def test_ctrl_c_exits_with_130_and_says_what_was_kept(
    tiny: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("ehar.runner.rollout", interrupt)
    with pytest.raises(SystemExit) as ended:
        main(["benchmark", "no-act", "--data", str(tiny), "--length", "10", "--workers", "1"])
    assert ended.value.code == 130
    assert capsys.readouterr().err == "ehar: interrupted: nothing was written\n"


def test_data_describe_prints_classes(tiny: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["data", "describe", str(tiny)])
    printed = capsys.readouterr().out
    assert "nod" in printed


def test_data_prepare_bvh_reads_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = SHARED / "bvh_sample"
    if not source.is_dir():
        pytest.skip("the BVH samples of shared/data are not here")
    main(["data", "prepare", "bvh", str(source), str(tmp_path / "bvh.npz")])
    assert "6 sequences of 3 classes" in capsys.readouterr().out
    assert "ends in .npz" in fails_with(["data", "prepare", "bvh", str(source), str(tmp_path / "bvh")], capsys)


def test_version_and_help_answer_without_torch() -> None:
    code = "import sys; from eval.cli.main import main; main(['--version']); sys.exit('torch' in sys.modules)"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout.split()[0]) == (0, "ehar")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["bnchmark"], f"unknown command 'ehar bnchmark'; expected one of {', '.join(COMMANDS.commands)}"),
        (
            ["train", "agnt"],
            "unknown command 'ehar train agnt'; expected one of all, recogniser, gain-field, fixed-best, agent",
        ),
        (
            ["data", "prepare", "csv"],
            f"unknown command 'ehar data prepare csv'; expected one of {', '.join(READERS)}",
        ),
    ],
)
def test_an_unknown_command_names_those_that_there_are(
    capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert fails_with(arguments, capsys) == f"ehar: error: {message}\n"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], ["Expected one of {benchmark,", "ehar --help"]),
        (["train"], ["Expected one of {all, recogniser, gain-field, fixed-best, agent}.", "ehar train --help"]),
        (["train", "agent"], ["Missing from ehar train agent", "--data STR", "ehar train agent --help"]),
        (["report"], ["Missing from ehar report", "RUN", "ehar report --help"]),
        (["benchmark", "--lenght", "5"], ["Unrecognized options: --lenght", "--length INT", "ehar benchmark --help"]),
        (["benchmark", "--starts", "five"], ["--starts", "'five'", "INT", "ehar benchmark --help"]),
        (["benchmark", "--form", "tree"], ["'tree'", "'--form'", "('causal', 'ctrgcn')", "ehar benchmark --help"]),
        (["benchmark", "no-act", "--radius", "5"], ["--radius, 5", "ehar benchmark --help"]),
        (["--lenght", "5"], ["Unrecognized options: --lenght", "benchmark,", "ehar --help"]),
    ],
)
def test_a_refused_option_says_what_was_got_and_what_was_expected(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], arguments: list[str], said: list[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    out, lines = capsys.readouterr()
    assert out == ""
    assert lines.count("\n") <= 10
    for part in said:
        assert part in lines


OWN_PLANNER = """
from ehar.planner import Planner

class Mine(Planner):
    name = "mine"

    def __init__(self, *, radius: float = 5.0):
        self.radius = radius

    def act(self, observation):
        target = observation.viewpoint.copy()
        target[:, 0] = self.radius
        return target

class Peeping(Mine):
    def act(self, observation):
        return observation.viewpoint + observation.log_probs.mean()
"""


def test_flags_after_a_planner_of_one_s_own_are_its_arguments(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = tmp_path / "own.py"
    own.write_text(OWN_PLANNER)
    options = ["--data", str(tiny), "--length", "10", "--workers", "1"]
    planners = [f"{own}:Mine", "--radius", "6", f"{own}:Mine", "--radius=8", f"{own}:Mine(radius=9)", "no-act"]
    main(["benchmark", *planners, *options, "--out", str(tmp_path / "run")])
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    names = ["mine(radius=6)", "mine(radius=8)", "mine(radius=9)", "no-act"]
    assert [planner["name"] for planner in summary["planners"]] == names
    capsys.readouterr()
    for flags, message in (
        (["--radius", "six"], "Mine: radius: expected float, got 'six'"),
        (["--radius"], "Mine: expected a value after --radius, got --data"),
        (["--size", "6"], "Mine: unknown argument 'size'; it takes radius: float = 5.0"),
    ):
        assert message in fails_with(["benchmark", f"{own}:Mine", *flags, *options], capsys)


def test_check_planner_exits_with_1_where_a_check_fails(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = tmp_path / "own.py"
    own.write_text(OWN_PLANNER)
    for planner, code, said in (
        ([f"{own}:Mine", "--radius", "6"], 0, "planner mine(radius=6): 11 passed"),
        ([f"{own}:Peeping"], 1, "  FAILED       no row looks at another\n"),
    ):
        assert exit_code(["check", "planner", *planner, "--data", str(tiny)]) == code
        assert said in capsys.readouterr().out
    assert "unknown planner 'teleport'" in fails_with(["check", "planner", "teleport", "--data", str(tiny)], capsys)


def test_a_reader_that_has_read_enough_ends_it_without_a_word() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as nobody_reads:
        command = [sys.executable, "-m", "eval.cli.main", "train", "all", "--help"]
        ended = subprocess.run(command, stdout=nobody_reads, stderr=subprocess.PIPE, text=True, timeout=60)
    assert (ended.returncode, ended.stderr) == (128 + signal.SIGPIPE, "")


HELP = [sys.executable, "-m", "eval.cli.main", "--help"]


def test_an_output_that_was_closed_is_none() -> None:
    ended = subprocess.run(["sh", "-c", f"{shlex.join(HELP)} >&-"], stderr=subprocess.PIPE, text=True, timeout=60)
    assert (ended.returncode, ended.stderr) == (0, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="/dev/full is absent here")
def test_an_output_that_is_full_is_one_line() -> None:
    with open("/dev/full", "w") as full:
        ended = subprocess.run(HELP, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
    assert ended.returncode == 2
    assert ended.stderr == "ehar: error: standard output, or a file: cannot be written: No space left on device\n"


def test_a_pipe_of_another_kind_that_breaks_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def breaks(_: object) -> None:
        raise BrokenPipeError("to a worker")

    monkeypatch.setattr("eval.cli.main.parse", breaks)
    with pytest.raises(BrokenPipeError, match="to a worker"):
        main(["benchmark"])
