"""A command is the function that it runs: parameters are flags, and so are the fields of what it takes whole."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import pytest

from ehar.conditions import Conditions
from ehar.errors import UsageError
from ehar.processes import cores
from ehar.recogniser import Recogniser
from eval.cli.command import REQUIRED, Command, Flag
from eval.cli.commands.every import COMMANDS
from eval.cli.commands.flags import RUN
from eval.cli.commands.group import CommandGroup
from eval.cli.main import parse
from eval.running.progress import Reporter
from eval.running.sweep import SweepConfig
from eval.running.training import Trained
from planners.agents.config import AgentTrainingConfig


@dataclass(frozen=True, kw_only=True)
class Setting:
    """How it is trained.

    Args:
        conditions: of the training.
        out: folder to write to.
        batches: of 32 episodes.
        workers: processes.
    """

    conditions: Conditions
    out: Path
    batches: int = 24
    workers: int = 1


def run(
    names: str | list[str] | None = None,
    conditions: Conditions | None = None,
    *,
    size: Literal["small", "large"] = "small",
    out: str | Path | None = None,
    recogniser: str | Recogniser | None = None,
    workers: int = 1,
    quick: bool = False,
    reporter: Reporter | None = None,
) -> dict[str, Any]:
    """Run.

    Args:
        names: who runs, from Python
            objects too.
        conditions: of all.
        size: of the networks.
        out: folder for records.
        recogniser: which one.
        workers: processes.
        quick: leave out what is slow.
        reporter: hears of progress.
    """
    return dict(locals())


def train(config: Setting) -> dict[str, Any]:
    """Train it.

    For example:
        ehar train --data duo

    Args:
        config: how.

    Raises:
        EharError: in one line.
    """
    return {"config": config}


SHOWN: list[dict[str, Any]] = []


def show(found: dict[str, Any], *, report: bool = True) -> int:
    """Show.

    Args:
        found: what was found.
        report: write a report too.
    """
    SHOWN.append({**found, "report": report})
    return 1 if found.get("quick") else 0


def show_all(found: dict[str, Any]) -> None:
    SHOWN.append(found)


RUNS = Command(
    f"{__name__}:run",
    show,
    text="""Run it.

    For example:
        ehar run --length 5
    """,
    conditions=("models", "data", "length", "fps"),
    flags={"names": Flag("who runs.", kind=tuple[str, ...], default=(), positional=True, metavar="NAME ...")},
)
TRAINS = Command(
    f"{__name__}:train",
    show_all,
    conditions=("data", "length"),
    flags={"data": Flag(default=REQUIRED), "length": Flag("of a clip.", hint="60")},
)


def called(command: Command, *words: str) -> tuple[int | None, dict[str, Any]]:
    """Return the exit code, and what was shown."""
    SHOWN.clear()
    code = command.parse("ehar it", words)()
    (found,) = SHOWN
    return code, found


def help_of(command: Command, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("COLUMNS", "100")
    with pytest.raises(SystemExit) as ended:
        command.parse("ehar it", ["--help"])
    assert ended.value.code == 0
    return " ".join(capsys.readouterr().out.replace("│", " ").split())


def refused(command: Command, *words: str) -> None:
    with pytest.raises(SystemExit) as ended:
        command.parse("ehar it", words)
    assert ended.value.code == 2


def test_without_words_the_function_gets_its_defaults_and_every_core() -> None:
    code, found = called(RUNS)
    assert code == 0
    assert found == {
        "names": (),
        "conditions": Conditions(),
        "size": "small",
        "out": None,
        "recogniser": None,
        "workers": cores(),
        "quick": False,
        "reporter": None,
        "report": True,
    }


def test_words_become_the_functions_arguments_conditions_whole() -> None:
    words = ["a", "b", "--length", "5", "--data", "solo", "--models", "m", "--fps", "12.5", "--size", "large"]
    code, found = called(RUNS, *words, "--out", "o", "--recogniser", "mine.py:Mine", "--workers", "3", "--quick")
    assert code == 1  # what show returns
    assert found["conditions"] == Conditions(data="solo", models="m", length=5, fps=12.5)
    del found["conditions"]
    assert found == {
        "names": ("a", "b"),
        "size": "large",
        "out": Path("o"),
        "recogniser": "mine.py:Mine",
        "workers": 3,
        "quick": True,
        "reporter": None,
        "report": True,
    }
    assert called(RUNS, "--no-report")[1]["report"] is False


@pytest.mark.parametrize(
    "words",
    [
        ["--seed", "1"],  # a condition that this command does not have
        ["--reporter", "x"],  # for Python alone
        ["--conditions.length", "5"],
        ["--length", "five"],
        ["--size", "tiny"],
        ["--no-quick"],  # is so anyway
        ["--out", "None", "--fps", "None"],
    ],
)
def test_what_it_does_not_have_is_refused(words: list[str]) -> None:
    refused(RUNS, *words)


def test_conditions_that_make_no_sense_are_refused_before_anything_runs() -> None:
    with pytest.raises(UsageError, match=r"^length: expected a whole number of at least 1, got 0$"):
        RUNS.parse("ehar it", ["--length", "0"])


def test_a_data_class_of_a_training_is_made_with_its_conditions() -> None:
    code, found = called(TRAINS, "--data", "mine.npz", "--out", "models/mine", "--length", "30", "--batches", "2")
    assert code is None
    assert found["config"] == Setting(
        conditions=Conditions(data="mine.npz", length=30), out=Path("models/mine"), batches=2, workers=cores()
    )
    usual = called(TRAINS, "--data", "duo", "--out", "o")[1]["config"]
    assert usual == Setting(conditions=Conditions(), out=Path("o"), workers=cores())


@pytest.mark.parametrize("words", [["--out", "o"], ["--data", "duo"]])
def test_what_a_training_needs_has_to_be_given(words: list[str]) -> None:
    refused(TRAINS, *words)


def test_its_options_say_whether_a_value_follows() -> None:
    values = dict.fromkeys(
        ["--names", "--data", "--models", "--length", "--fps", "--size", "--out", "--recogniser", "--workers"], True
    )
    flags = dict.fromkeys(["--help", "--quick", "--no-quick", "--report", "--no-report"], False)
    assert RUNS.options() == {**values, **flags}
    training = dict.fromkeys(["--data", "--length", "--out", "--batches", "--workers"], True)
    assert TRAINS.options() == {"--help": False, **training}


def test_help_says_what_docstrings_and_flags_say(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = help_of(RUNS, capsys, monkeypatch)
    for line in (
        "Run it. For example: ehar run --length 5",
        "NAME ... who runs. (default: )",
        "--data STR duo, solo, duo-stream, solo-stream, or a prepared .npz. (default: duo)",
        "--models PATH folder of weights. (default: those that ship)",
        "--out PATH folder for records. (default: none)",
        "--fps FLOAT frame rate to resample to [Hz]. (default: the data's)",
        "--recogniser STR your own: file.py:Class, then --argument value. (default: ours)",
        "--size {small,large} of the networks. (default: small)",
        f"--workers INT processes. (default: {cores()})",
        "--report, --no-report write a report too. (default: True)",
    ):
        assert line in shown
    for text in ("Args:", "hears of progress", "from Python", "--no-quick"):
        assert text not in shown
    shown = help_of(TRAINS, capsys, monkeypatch)
    assert "Train it. For example: ehar train --data duo " in shown  # its docstring, up to the arguments
    for text in ("Args:", "config: how", "Raises:"):
        assert text not in shown
    assert "--data STR duo, solo, duo-stream, solo-stream, or a prepared .npz. (required)" in shown
    assert "--length INT of a clip. (default: 60)" in shown


def test_data_models_and_out_stand_first_and_the_others_as_they_come(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def order(command: Command) -> list[str]:
        _, _, shown = help_of(command, capsys, monkeypatch).partition("show this help")
        named = [word for word in command.options() if f"{word} " in shown or f"{word}," in shown]
        return sorted(named, key=shown.index)

    first = ["--data", "--models", "--out", "--report", "--no-report"]
    assert order(RUNS) == [*first, "--length", "--fps", "--size", "--recogniser", "--workers", "--quick"]
    assert order(TRAINS) == ["--data", "--out", "--length", "--batches", "--workers"]


def test_a_hint_stands_for_what_is_required(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    named = Flag("runs.", kind=tuple[Path, ...], default=REQUIRED, positional=True, metavar="RUN ...")
    command = replace(RUNS, flags={"names": replace(named, hint="at least one")})
    assert "RUN ... runs. (at least one)" in help_of(command, capsys, monkeypatch)
    assert called(command, "a", "b")[1]["names"] == (Path("a"), Path("b"))


def test_a_hint_stands_for_any_default(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    shown = help_of(replace(TRAINS, flags={"batches": Flag(hint="as many as help")}), capsys, monkeypatch)
    assert "--batches INT of 32 episodes. (default: as many as help)" in shown
    shown = help_of(EVERY["study published"], capsys, monkeypatch)
    assert "--threads INT CPU threads of torch. (default: torch decides)" in shown
    assert "(default: estimator)" in help_of(EVERY["live"], capsys, monkeypatch)


def commands(group: CommandGroup = COMMANDS, words: tuple[str, ...] = ()) -> dict[str, Command]:
    found = {}
    for name, command in group.commands.items():
        found |= (
            commands(command, (*words, name))
            if isinstance(command, CommandGroup)
            else {" ".join((*words, name)): command}
        )
    return found


EVERY = commands()


def test_a_default_on_the_command_line_is_that_of_the_function() -> None:
    others = [
        (name, flag)
        for name, command in EVERY.items()
        for flag, held in command.flags.items()
        if held.default is not None and held.default is not REQUIRED
        if command.leaves()[flag].parameter.default != held.default
    ]
    assert others == [("study explain", "out")]  # on the command line its picture is a file


@pytest.mark.parametrize("name", EVERY)
def test_flags_and_conditions_are_those_of_its_function(name: str) -> None:
    command = EVERY[name]
    leaves = command.leaves()
    assert set(command.flags) <= set(leaves)
    assert set(command.conditions) <= set(leaves)
    for leaf in leaves.values():
        assert leaf.parameter.annotation is not REQUIRED


@pytest.mark.parametrize("name", [name for name in EVERY if name.startswith("train")])
def test_trainings_need_data_and_take_what_else_they_are_told(name: str) -> None:
    words = ["--data", "mine.npz", "--out", "o", "--length", "30", "--sensor", "estimator", "--views", "paper"]
    refused(EVERY[name], *words[2:])
    made: list[Any] = []
    parse = _recorded(EVERY[name], made)
    parse.parse("ehar it", words)()
    config, *_ = made
    told = Conditions(data="mine.npz", length=30, sensor="estimator", views="paper")
    (one,) = config.sets.values() if isinstance(config, SweepConfig) else (config,)
    assert (one.conditions, one.out) == (told, Path("o"))


def _recorded(command: Command, made: list[Any]) -> Command:
    """Return a command with the same flags that only remembers what it would run with."""
    function = command.function

    def record(*args: Any, **given: Any) -> None:
        made.extend((*args, *given.values()))

    record.__signature__ = inspect.signature(function)  # type: ignore[attr-defined]
    record.__doc__ = function.__doc__

    @dataclass(frozen=True)
    class Recorded(Command):
        @property
        def function(self) -> Callable[..., Any]:
            return record

    return Recorded(command.place, lambda _: None, command.text, command.conditions, command.flags)


@pytest.mark.parametrize("name", ["report", "replay", "verify", "study analyse"])
def test_a_finished_run_is_named_without_a_flag(name: str) -> None:
    assert EVERY[name].flags["run"] == RUN
    refused(EVERY[name])


def test_seeds_are_named_one_by_one(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    told: list[AgentTrainingConfig] = []

    def train(config: AgentTrainingConfig) -> Trained:
        """Train."""
        told.append(config)
        return Trained((), ())

    monkeypatch.setattr("eval.running.training.train_agents", train)
    words = ["train", "agent", "--data", "duo", "--models", str(tmp_path)]
    for seeds in ([], ["--seeds", "7"], ["--seeds", "7", "8", "9", "--stages", "il"]):
        parse([*words, *seeds])()
    assert [config.seeds for config in told] == [(0,), (7,), (7, 8, 9)]
    assert told[2].stages == "il"
