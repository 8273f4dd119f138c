"""A user's own recognisers: loaded, made for the data, and run under planners."""

import json
from pathlib import Path
from typing import Any

import pytest

from ehar.data.motion_file import save_motion
from ehar.errors import EpisodeError, ModelError, UsageError
from ehar.plugins.own_class import Own
from ehar.recogniser import Recogniser
from ehar.world import PAPER
from eval.cli.main import main
from recognition.own_recogniser import resolve_recogniser
from tests.helpers.agents import save_untrained
from tests.helpers.fakes import CLASS_NAMES, FakeRecogniser, tiny_data
from tests.helpers.own_recogniser import OWN
from tests.helpers.tiny_benchmarks import Log
from tests.helpers.tiny_benchmarks import run as run_tiny

DATA = tiny_data(sequences=20)


pytestmark = pytest.mark.usefixtures("own_modules")


@pytest.fixture
def own(tmp_path: Path) -> Path:
    path = tmp_path / "mine.py"
    path.write_text(OWN)
    return path


def resolved(brought: str | Recogniser) -> Own:
    return resolve_recogniser(brought, DATA, PAPER)


def test_its_constructor_is_handed_what_it_asks_for_of_the_data(own: Path) -> None:
    made = resolved(f"{own}:Mine(gain='2')")
    recogniser: Any = made.made
    assert recogniser.given == (DATA.class_names, DATA.skeleton, DATA.persons, DATA.fps, 2.0)
    assert made.title == "Mine(gain=2)"
    assert made.spec == f"{own}:Mine(gain='2')"
    assert resolved(f"{own}:Mine").title == "Mine"


def test_the_hash_is_of_all_that_decides_what_it_says(own: Path) -> None:
    weights = own.parent / "weights.bin"
    weights.write_bytes(b"1")
    hashes = [resolved(f"{own}:Mine{given}").sha256 for given in ("", "", "(gain=2)", f"(weights={str(weights)!r})")]
    weights.write_bytes(b"2")
    hashes.append(resolved(f"{own}:Mine(weights={str(weights)!r})").sha256)
    own.write_text(OWN + "# changed\n")
    hashes.append(resolved(f"{own}:Mine").sha256)
    assert hashes[0] == hashes[1]
    assert len(set(hashes)) == 5
    objects = [FakeRecogniser(), FakeRecogniser()]
    objects[1].sha256 = "of weights"  # type: ignore[attr-defined]
    assert resolved(objects[0]).sha256 != resolved(objects[1]).sha256


def test_an_object_is_meant_as_it_is() -> None:
    mine = FakeRecogniser()
    made = resolved(mine)
    assert made.made is mine
    assert (made.title, made.spec) == ("FakeRecogniser", "tests.helpers.fakes.FakeRecogniser")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Nothing", "expected what ehar.recogniser.Recogniser has, missing: start, step"),
        ("Bodiless", "expected what ehar.recogniser.Recogniser has, missing: embedding_size"),
        ("Sized", "embedding_size: expected a number of at least 1, got 'large'"),
        ("Countless", f"class_names: expected those of tiny, {CLASS_NAMES}, got 4"),
        ("Foreign", f"class_names: expected those of tiny, {CLASS_NAMES}, got ('wave',)"),
        ("Mine(depth=3)", "unknown argument 'depth'; it takes "),
        ("Mine(gain='high')", "gain: expected float, got 'high'"),
        ("Needy", "expected its argument depth: int, got none; give it as --depth VALUE after it, or "),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_one_line(own: Path, name: str, message: str) -> None:
    with pytest.raises((UsageError, ModelError)) as error:
        resolved(f"{own}:{name}")
    assert str(error.value).startswith(f"recogniser {own}:{name.partition('(')[0]}: {message}")
    assert "\n" not in str(error.value)


def test_a_place_that_is_none() -> None:
    for spec in ("mine", "causal", "--x", ""):
        with pytest.raises(UsageError, match=r"^unknown recogniser .*; expected path/to/file.py:ClassName or package"):
            resolved(spec)
    with pytest.raises(UsageError, match=r"^recogniser file absent.py: no such file; expected "):
        resolved("absent.py:Mine")
    with pytest.raises(UsageError, match=r"^recogniser .*: expected a recogniser, got a class; make one: FakeRec"):
        resolved(FakeRecogniser)  # type: ignore[arg-type]


def run(planners: Any = None, **options: Any) -> Any:
    return run_tiny(planners, data=DATA, starts=1, **options)


def test_it_runs_under_every_planner_that_was_not_trained_for_ours(own: Path, tmp_path: Path) -> None:
    log = Log()
    summary = run(recogniser=f"{own}:Mine(gain=2)", out=tmp_path / "run", reporter=log).summary
    rules = ["no-act", "random", "towards", "h-rotate", "v-rotate", "near-level", "side", "front"]
    expected = [*rules, "oracle", "oracle-lookahead"]
    assert [planner.name for planner in summary.planners] == expected
    place, field, agents = log.notes
    assert place.startswith("left out: fixed-best: no ")
    assert field.startswith("left out: nbv-greedy, nbv-search, nbv: no gain field was trained for this recogniser: ")
    assert agents.startswith("left out: il, ppo, il-ppo, dagger: no agent was trained for this recogniser: expected ")
    config = json.loads((tmp_path / "run" / "config.json").read_text())
    assert config["recogniser"] == f"{own}:Mine(gain=2)"
    assert config["form"] == "Mine(gain=2)"
    assert config["recogniser_sha256"] == resolved(f"{own}:Mine(gain=2)").sha256
    assert summary.planner("oracle").acc_mean > summary.planner("no-act").acc_mean


def test_who_needs_ours_is_refused(tmp_path: Path) -> None:
    save_untrained(tmp_path, DATA, "il", seed=0)
    with pytest.raises(
        ModelError, match=r"^no gain field was trained for this recogniser: expected that of `ehar train gain-field "
    ):
        run(["no-act", "nbv"], recogniser=FakeRecogniser())
    with pytest.raises(
        ModelError, match=r"agent-il-perfect-moving-seed0.safetensors: trained for another recogniser: its sha256 was "
    ):
        run(["no-act", "il"], recogniser=FakeRecogniser(), models=tmp_path)
    with pytest.raises(ModelError, match=r"^no gain field was trained for this recogniser"):
        run(["no-act"], recogniser=FakeRecogniser(), readout="belief")
    with pytest.raises(UsageError, match=r"^form: expected none beside your own recogniser, got ctrgcn$"):
        run(["no-act"], recogniser=FakeRecogniser(), form="ctrgcn")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Wide", "recogniser Wide, frame 0: expected finite log-probabilities of shape (20, 3), got (20, 5)"),
        ("Endless", "recogniser Endless, frame 0: expected finite log-probabilities of shape (20, 3), "
            "got NaN or infinity"),
        ("Lists", "recogniser Lists, frame 0: log-probabilities: expected an array of floats, got list"),
        ("Logits", "recogniser Logits, frame 0: expected log-probabilities, whose probabilities sum to 1 within 0.001, "
            "got a sum of 3 in episode 0 of the batch"),
        ("Raising", "recogniser Raising, frame 0: RuntimeError: no weights ({own}, line 37)"),
    ],
)  # fmt: skip
def test_what_goes_wrong_in_a_run_is_one_line(own: Path, name: str, message: str) -> None:
    with pytest.raises(EpisodeError) as error:
        run(["no-act"], recogniser=f"{own}:{name}")
    assert str(error.value) == message.format(own=own)


@pytest.mark.slow
def test_two_workers_run_it_as_one_does(own: Path, tmp_path: Path) -> None:
    for workers in (1, 2):
        run(["no-act", "oracle"], recogniser=f"{own}:Mine", workers=workers, out=tmp_path / str(workers))
    written = [(tmp_path / str(workers) / "episodes.jsonl").read_bytes() for workers in (1, 2)]
    assert written[0] == written[1]


def test_the_commands(own: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_motion(own.parent / "tiny.npz", DATA)
    options = ["--data", str(own.parent / "tiny.npz")]
    main(["check", "recogniser", f"{own}:Mine", "--gain", "2", *options])
    assert "recogniser Mine(gain=2): 15 passed, 1 not checked" in capsys.readouterr().out
    with pytest.raises(SystemExit) as ended:
        main(["check", "recogniser", f"{own}:Wide", *options])
    assert ended.value.code == 1
    assert "  FAILED       recognises a batch of 7" in capsys.readouterr().out
    with pytest.raises(SystemExit) as ended:
        main(["check", "recogniser", f"{own}:Mine", "--gian", "2", *options])
    assert ended.value.code == 2
    assert "unknown argument 'gian'" in capsys.readouterr().err
