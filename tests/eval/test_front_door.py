"""What a new user meets in `eval`: its functions, a notebook, `python -c`, a script without a main guard, messages."""

import re
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from jupyter_client import KernelManager
from nbclient import NotebookClient

import eval as ours
from ehar import Conditions, EharError, MotionData, Planner, load_data, save_motion
from ehar.files import write_text
from eval.conformance.data import check_data
from eval.conformance.motion import check_motion
from eval.conformance.planner import check_planner
from eval.conformance.recogniser import check_recogniser
from eval.conformance.sensor import check_sensor
from eval.reports.page import make_report
from eval.running.benchmark import benchmark
from eval.running.run import Run, read_run
from eval.studies.compare import compare
from eval.studies.headroom.study import headroom
from eval.verification.verify import verify
from recognition.setting import load_setting

ROOT = Path(__file__).parents[2]
CHECKS = [check_motion, check_planner, check_recogniser, check_sensor]
FUNCTIONS = [benchmark, check_data, *CHECKS, compare, headroom, make_report, read_run, verify]
SHORT = Conditions(data="duo", length=10, part="validation")
NOTEBOOK = ROOT / "docs" / "examples" / "first_steps.ipynb"


class Stay(Planner):
    name = "stay"

    def act(self, observation):  # type: ignore[no-untyped-def]
        return observation.viewpoint


@pytest.fixture(scope="module")
def run() -> Run:
    return benchmark([Stay(), "no-act"], SHORT)


def python(*arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        timeout=90,
    )


@pytest.mark.parametrize("function", FUNCTIONS)
def test_a_function_is_found_where_its_module_was_imported_before(function: object) -> None:
    assert getattr(ours, function.__name__) is function


def test_the_functions_are_listed_and_a_wrong_name_says_which_there_are() -> None:
    assert dir(ours) == sorted(["Watcher", *(function.__name__ for function in FUNCTIONS)])
    with pytest.raises(AttributeError, match="eval has no 'benchmrk'; it has: Watcher, benchmark, check_data, "):
        _ = ours.benchmrk


def test_a_planner_of_no_file_runs_and_is_read_again_and_verified(tmp_path: Path) -> None:
    done = python(
        "-c",
        "from ehar import Planner, Conditions\n"
        "from eval import benchmark, read_run, verify\n"
        "class Mine(Planner):\n"
        "    name = 'mine'\n"
        "    def act(self, observation): return observation.viewpoint\n"
        "if __name__ == '__main__':\n"
        "    run = benchmark([Mine(), 'no-act'], Conditions(part='validation'), workers=2)\n"
        "    run.save('run')\n"
        "    print(repr(read_run('run')))\n"
        "    print(verify('run').verdict)\n",
        folder=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    line, verdict = done.stdout.splitlines()
    assert line.endswith(": 2 planners, 46 episodes each)")
    assert verdict.startswith("verified")


def test_a_script_without_a_main_guard_says_what_to_do(tmp_path: Path) -> None:
    script = [
        "from ehar import Conditions\n",
        "from eval import benchmark\n",
        "benchmark(['no-act', 'random'], Conditions(part='validation'), workers=2)\n",
    ]
    write_text(tmp_path / "script.py", script)
    done = python("script.py", folder=tmp_path)  # it ends, where it once waited for ever
    assert done.returncode == 1
    last = done.stderr.rstrip().splitlines()[-1]
    assert last.startswith("ehar.errors.UsageError: workers: no worker process could start; in a script, ")
    assert '`if __name__ == "__main__":`' in last
    assert done.stderr.count("Traceback") == 1, "the workers end without a word"


def test_paths_are_text_too(tmp_path: Path, run: Run) -> None:
    folder = str(tmp_path / "run")
    run.save(folder)
    assert read_run(folder).records.keys() == {"stay", "no-act"}
    assert verify(folder).difference is None
    assert len(compare(folder, folder).planners) == 2
    assert make_report(folder, out=str(tmp_path / "report.html")).is_file()


def test_a_comparison_is_a_table_in_words_and_in_a_notebook(tmp_path: Path, run: Run) -> None:
    found = compare(run.save(tmp_path / "a"), run.save(tmp_path / "b"))
    assert "A - B [95 %]" in str(found)
    assert "<table" in found._repr_html_()
    assert len(repr(found)) < 300


def test_what_a_notebook_prints_is_short(run: Run) -> None:
    setting = load_setting(Conditions(sensor="estimator", track="px4-auto"))
    for shown in (run, setting, setting.runner, Conditions(data=setting.data), run.records["stay"]):
        assert len(repr(shown)) <= 300, repr(shown)


def tiny_file(folder: Path) -> tuple[Path, MotionData]:
    """Save motion for which nothing was trained, under a name with a space in it."""
    path, data = folder / "my motion.npz", load_data("duo")
    save_motion(str(path), data)
    return path, data


def suggested(error: EharError) -> str:
    """Return the command that an error suggests."""
    found = re.search(r"`(ehar [^`]*)`", str(error))
    assert found is not None, error
    return found[1]


def test_errors_suggest_commands_with_the_data_as_given(tmp_path: Path) -> None:
    path, data = tiny_file(tmp_path)
    given = f"--data '{path}' --sensor perfect --views moving"
    with pytest.raises(EharError) as error:
        benchmark("no-act", Conditions(data=path, models=tmp_path))
    assert suggested(error.value) == f"ehar train recogniser {given} --out {tmp_path}"
    with pytest.raises(EharError) as error:
        benchmark("no-act", Conditions(data=data, models=tmp_path, fps=12.5, length=30))
    command = suggested(error.value)
    assert command.startswith(
        "ehar train recogniser --data X.npz --sensor perfect --views moving --length 30 --fps 12.5"
    )
    with pytest.raises(EharError) as error:
        benchmark("nbv", Conditions(data="duo", sensor="estimator", views="paper"))
    assert suggested(error.value).startswith("ehar train ")


def test_a_data_frame_without_pandas_says_what_to_install(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(EharError, match=r"pip install -e '\.\[notebook\]'"):
        run.to_dataframe()


@pytest.mark.slow
def test_the_first_notebook_runs_in_a_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "none are stored"
    kernel = KernelManager()
    kernel.kernel_cmd = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
    NotebookClient(notebook, km=kernel, timeout=300, resources={"metadata": {"path": str(ROOT)}}).execute()
    shown = [output.get("data", {}) for cell in notebook.cells for output in cell.get("outputs", [])]
    assert sum("text/html" in data for data in shown) >= 4, "two runs, a data frame and a comparison"
    assert sum("image/png" in data for data in shown) == 1
    texts = [data["text/plain"] for data in shown if "text/plain" in data]
    assert any(text.startswith("MotionData(duo (synthetic): ") for text in texts)
