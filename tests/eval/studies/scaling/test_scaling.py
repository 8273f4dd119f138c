"""How long commands take: what is read of them, what waits for what, and the arithmetic of machines."""

import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from ehar.data.motion_file import save_motion
from ehar.errors import ModelError, UsageError
from ehar.files import write_text
from eval.cli.main import main
from eval.records.job_times import JobTime, write_job_times
from eval.records.run_files import EPISODES
from eval.studies.scaling import engines as module
from eval.studies.scaling.commands import needs_of, read_commands
from eval.studies.scaling.costs import ALL, ALONE, PLANNED, WATCHED, Costs, Work, rates_of
from eval.studies.scaling.engines import engines
from eval.studies.scaling.forecast import BACK, LINK, SENT, scaling
from recognition.training.config import TrainingConfig
from recognition.training.stopping import LEAST_CLIPS
from tests.helpers.commands import fails_with
from tests.helpers.fakes import tiny_data
from tests.helpers.made_records import three_planners, write_finished
from tests.helpers.places import ROOT
from tests.helpers.tiny_benchmarks import Log, run

STEP = 0.5
TEXT = r"""
.venv/bin/ehar train recogniser --data {data} --length 10 --out models/a
.venv/bin/ehar train gain-field --data {data} --length 10 --models models/a
srun --ntasks=1 .venv/bin/ehar train fixed-best --data {data} --length 10 --models models/a/
.venv/bin/ehar benchmark no-act oracle --data {data} --length 10 \
  --models models/a --starts 4 --out runs/a
touch models/a/done
.venv/bin/ehar study overview runs/a --planner nbv --out runs/b && {{ printf '%s\n' 'ehar study overview runs/a'; }}
for part in time vision; do .venv/bin/ehar train agent --data {data} --models models/b \
  --without $part --device cuda || exit 1; done
"""


def test_commands_and_what_each_waits_for() -> None:
    found = read_commands(TEXT.format(data="x.npz"))
    assert [one.kind for one in found] == [
        *("train recogniser", "train gain-field", "train fixed-best", "benchmark", "study overview"),
        *("train agent", "train agent"),
    ]
    assert found[3].places == ("no-act", "oracle") and found[3].option("starts") == "4"
    assert [one.option("without") for one in found[5:]] == ["time", "vision"]
    assert needs_of(found) == {0: (), 1: (0,), 2: (0,), 3: (0, 1, 2), 4: (3,), 5: (), 6: ()}


@pytest.fixture
def data(tmp_path: Path) -> Path:
    save_motion(tmp_path / "tiny.npz", tiny_data(sequences=40))
    return tmp_path / "tiny.npz"


def test_a_benchmark_takes_what_its_frames_take_and_a_training_its_steps(data: Path) -> None:
    training, *_, benchmark, overview, agent, _ = read_commands(TEXT.format(data=data))
    costs = Costs(STEP, {"no-act": 0.2})
    work = costs.work_of(benchmark)
    windows = 160  # from 4 starts
    oracle = STEP * (WATCHED + PLANNED["oracle"])
    assert work is not None and work.anywhere and work.jobs == 2 * windows // 32
    assert work.total.least == pytest.approx(ALONE + windows * 10 / 1000 * (0.2 + oracle))
    assert work.alone.most == pytest.approx(ALONE + 0.32 * oracle)
    learned = costs.work_of(training)
    assert learned is not None and learned.total == learned.alone
    assert learned.total.least == pytest.approx(ALONE + STEP * LEAST_CLIPS / TrainingConfig.batch)
    assert learned.total.most == pytest.approx(ALONE + STEP * TrainingConfig.clips / TrainingConfig.batch)
    assert costs.work_of(overview) == ((ALONE, ALONE), (ALONE, ALONE), False, 0)
    assert costs.work_of(agent) is None, "it asks for a GPU"
    assert costs.work_of(replace(benchmark, options={"data": ("absent.npz",)})) is None


def test_train_all_takes_what_its_trainings_take(data: Path) -> None:
    costs = Costs(STEP, {})

    def work(line: str) -> Work:
        found = costs.work_of(*read_commands(f"bin/ehar {line} --data {data}"))
        assert found is not None
        return found

    recogniser, *others = (work(kind) for kind in ALL)
    everything = work("train all")
    assert everything.total.least == pytest.approx(recogniser.total.least + sum(one.total.least for one in others))
    assert everything.alone.most == pytest.approx(recogniser.alone.most + max(one.alone.most for one in others))


@pytest.mark.parametrize(("options", "places"), [("", 72), (" --azimuths 6 --polars 3", 18)])
def test_a_headroom_study_takes_as_long_as_its_map_is_large(data: Path, options: str, places: int) -> None:
    costs = Costs(STEP, dict.fromkeys(("no-act", "oracle", "oracle-lookahead"), 1.0))
    work = costs.work_of(*read_commands(f"bin/ehar study headroom --data {data} --length 10{options}"))
    assert work is not None and work.total.least == pytest.approx(ALONE + 40 * 10 / 1000 * (places + 3))


def test_machines_share_the_work_but_not_the_chain(data: Path, tmp_path: Path) -> None:
    write_text(tmp_path / "commands", [TEXT.format(data=data)])
    found = scaling(commands=tmp_path / "commands", machines=(1, 8), cores=4, step=STEP)
    works = dict(one for one in found.works or () if one[1] is not None)
    assert len(found.works or ()) == 7 and len(works) == 5
    total = sum(work.total.most for work in works.values() if work)
    slowest = 0.0
    for kind in ("train recogniser", "train gain-field", "benchmark", "study overview"):
        work = works[kind]
        assert work is not None
        width = 4 * (8 if kind == "benchmark" else 1)
        slowest += work.alone.most + (work.total.most - work.alone.most) / width
    one, eight = found.times
    assert eight.shared.most == pytest.approx(total / 32) and one.shared.most == pytest.approx(total / 4)
    assert eight.chain.most == pytest.approx(slowest)
    assert eight.transfers == pytest.approx((8 * SENT + works["benchmark"].jobs * BACK) / LINK)  # type: ignore[union-attr]
    assert eight.predicted.most == pytest.approx(total / 32 + slowest + eight.transfers)
    assert eight.predicted.least == max(eight.shared.least, eight.chain.least)
    assert found.stops_at[0] <= total / slowest <= found.stops_at[1]
    _, machines = found.tables()
    assert [row[:2] for row in machines.rows] == [("1", "4"), ("8", "32")]


def test_finished_runs_tell_what_planners_take(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write_finished(tmp_path / "run", three_planners())
    jobs = [
        JobTime("no-act", 32, 50, 0.8, 1000),
        JobTime("il/0", 16, 50, 0.8, 3000),
        JobTime("il/1", 16, 50, 1.6, 3000),
    ]
    write_job_times(folder / "jobs.json", jobs)
    assert rates_of({folder: (tuple(jobs), 2)}) == pytest.approx({"no-act": 0.25, "il": 0.75})
    main(["study", "scaling", str(folder)])
    shown = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["no-act", "1", "0.80", "0.80", "0.500", "1"] in shown and [
        "il/1",
        "1",
        "1.60",
        "1.60",
        "2.000",
        "3",
    ] in shown


def test_nothing_is_left_and_nothing_is_asked(tmp_path: Path) -> None:
    write_text(tmp_path / "none", ["make: Nothing to be done for 'pages'.\n"])
    (table,) = scaling(commands=tmp_path / "none").tables()
    assert (table.title, [row[:2] for row in table.rows], table.footnotes) == ("Nothing is left", [("all", "0")], ())
    with pytest.raises(UsageError, match=r"^scaling: expected a run, or --commands FILE, got neither$"):
        scaling()
    with pytest.raises(UsageError, match="expected at least 1 machine and 1 core"):
        scaling([tmp_path], machines=(0,))
    with pytest.raises(UsageError, match="expected commands, as `make -n` prints them, got No such file"):
        scaling(commands=tmp_path / "absent")


@pytest.mark.usefixtures("fake_weights")
def test_both_engines_run_the_same_benchmark_in_turn(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    asked: list[str] = []
    benchmark = module.benchmark

    def one_process(*told: object, engine: str, **more: object) -> object:
        asked.append(engine)
        return benchmark(*told, **{**more, "workers": 1})  # type: ignore[arg-type]

    monkeypatch.setattr(module, "benchmark", one_process)
    conditions = replace(run("no-act").conditions, data=tiny_data(sequences=40), models=None)
    found = engines(["no-act", "random"], conditions, rounds=2, workers=3, reporter=Log())
    assert asked == ["processes", "ray"] * 2
    assert found.ratio > 0 and found.sent_bytes > 10_000
    assert len(found.jobs["ray"]) == len(found.jobs["processes"]) == 10
    (table,) = found.tables()
    assert table.footnotes[0].startswith(f"Ray / processes: {found.ratio:.2f} (aim: at most 1.3).")

    def other(*told: object, engine: str, out: Path, **more: object) -> object:
        made = one_process(*told, engine=engine, out=out, **more)
        write_text(out / EPISODES, [engine])
        return made

    monkeypatch.setattr(module, "benchmark", other)
    with pytest.raises(ModelError, match="expected the same episodes from processes and from Ray, got others"):
        engines(["no-act"], conditions, rounds=1, reporter=Log())


def test_the_commands_of_make_results_are_found() -> None:
    """And `make results` says what is left before it begins."""
    told = subprocess.run(["make", "-n", "-B", "pages"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    found = read_commands(told)
    assert len(found) == told.count("bin/ehar ") + 2 * 4 + 1 + 2, "two loops over five words, one over two, and three"
    assert {one.kind.partition(" ")[0] for one in found} == {"data", "train", "benchmark", "study", "compare"}
    assert sum(map(len, needs_of(found).values())) > len(found)
    rules = (ROOT / "Makefile").read_text()
    assert "\nresults: left\n\t@$(MAKE) --no-print-directory pages\n" in rules


def test_a_quote_that_does_not_end_is_one_line() -> None:
    with pytest.raises(UsageError, match=r"got the command \".*it's\.npz\", expected quotes that end"):
        read_commands("bin/ehar benchmark --data it's.npz")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("train recogniser --clips abc", "--clips and a whole number of at least 1, got 'abc'"),
        ("benchmark --length x", "--length and a whole number of at least 1, got 'x'"),
        ("benchmark --starts 0", "--starts and a whole number of at least 1, got '0'"),
        ("train agent --seeds 0 -1", "--seeds and whole numbers of at least 0, got '-1'"),
        ("benchmark --fps nan", "--fps and a number above 0, got 'nan'"),
    ],
)
def test_a_number_that_is_none_is_one_line(
    words: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_text(tmp_path / "commands", [f".venv/bin/ehar {words}\n"])
    line = fails_with(["study", "scaling", "--commands", str(tmp_path / "commands"), "--step", "1"], capsys)
    assert f"got the command '.venv/bin/ehar {words}', expected {expected}" in line


def test_a_step_that_takes_no_time_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    write_text(tmp_path / "commands", [TEXT])
    for step in ("nan", "-1", "0"):
        line = fails_with(["study", "scaling", "--commands", str(tmp_path / "commands"), "--step", step], capsys)
        assert f"expected a step above 0 s, got {step}" in line


def test_commands_that_are_no_text_are_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "commands").write_bytes(b"bin/ehar benchmark --out r\xe9sum\xe9")
    line = fails_with(["study", "scaling", "--commands", str(tmp_path / "commands"), "--step", "1"], capsys)
    assert "commands: expected commands as text in UTF-8, got 'utf-8' codec can't decode" in line
