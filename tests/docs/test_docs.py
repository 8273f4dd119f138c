"""The pages of docs: all are in the site, which builds without a warning or a network; their commands and code work."""

import importlib.util
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium as gym
import pytest

from ehar.conditions import Conditions
from ehar.data.motion_file import load_motion
from ehar.flight.vehicle import VEHICLES
from eval import benchmark
from eval.cli.main import parse
from eval.conformance.data import check_data
from planners.registry import planner_names
from tests.helpers.pages import DOCS, PAGES, ROOT, commands, mentioned_commands, page_name, python_blocks, unknown_flags

NO_MKDOCS = "mkdocs is not installed: make docs installs it"


def test_every_page_is_in_the_navigation_once() -> None:
    named = re.findall(r": (\S+\.md)$", (ROOT / "mkdocs.yml").read_text(), flags=re.MULTILINE)
    assert sorted(named) == sorted(str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md"))


def test_relative_links_of_the_readme_lead_somewhere() -> None:
    links = re.findall(r"\]\(([^)#]+)", (ROOT / "README.md").read_text())
    assert len(links) >= 10
    assert [link for link in links if not (ROOT / link).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_the_commands_of_a_page_are_commands(page: Path) -> None:
    for words in commands(page):
        assert callable(parse(words))


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_the_commands_that_a_page_mentions_have_their_flags(page: Path) -> None:
    mentioned = mentioned_commands(page)
    assert {" ".join(words): unknown_flags(words) for words in mentioned if unknown_flags(words)} == {}


def test_commands_that_are_none_are_found() -> None:
    with pytest.raises(AssertionError, match="ehar frobnicate: no such command"):
        unknown_flags(["frobnicate", "RUN"])


def test_flags_that_are_none_are_found() -> None:
    assert unknown_flags(["study", "headroom", "--data", "duo", "--speed=3"]) == ["--speed"]
    assert unknown_flags(["benchmark", "./spiral.py:Spiral", "--radius", "6", "--track", "px4-max"]) == []


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_the_code_of_a_page_is_python(page: Path) -> None:
    for code in python_blocks(page):
        compile(code, page_name(page), "exec")


def test_the_data_that_a_page_writes_can_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    exec(python_blocks(DOCS / "data.md")[0], {})
    data = load_motion(tmp_path / "mine.npz")
    assert data.class_names == ("wave", "bow")
    assert list(data.skeleton.mirror) == [0, 2, 1, 4, 3]
    assert check_data(data).passed


@pytest.mark.slow
def test_the_environments_are_made() -> None:
    names: dict[str, Any] = {}
    exec(python_blocks(DOCS / "task.md")[0], names)
    assert isinstance(names["env"].action_space, gym.spaces.Discrete)
    assert names["envs"].num_envs == 64


@pytest.mark.slow
def test_a_planner_of_other_arguments_is_made_and_runs() -> None:
    names: dict[str, Any] = {}
    exec(python_blocks(DOCS / "planners" / "next-best-view.md")[0], names)
    summary = benchmark([names["patient"], "no-act"], Conditions(data="duo", part="validation")).summary
    solves = summary.planner("patient").solves
    assert solves is not None
    assert solves.total == 4 * summary.episodes  # frames 0, 15, 30 and 45


@pytest.mark.parametrize("page", sorted((DOCS / "results").glob("*.md")), ids=page_name)
def test_a_page_of_tables_begins_with_its_command_and_a_claim_leads_to_it(page: Path) -> None:
    head = page.read_text().split("|")[0]
    assert commands(page) and "```\nehar " in head
    assert re.search(r"Measured on \d{4}-\d\d-\d\d, at commit [0-9a-f]{7}", head)
    assert f"results/{page.name}" in (DOCS / "results.md").read_text()


def test_all_planners_are_listed() -> None:
    listed = re.findall(r"`([a-z-]+)`", (DOCS / "planners" / "index.md").read_text())
    assert set(planner_names()) <= set(listed)


def test_the_vehicles_are_listed_with_their_limits() -> None:
    rows = re.findall(r"^\| `(\S+)` \| (.+) \|$", (DOCS / "planners" / "flight.md").read_text(), flags=re.MULTILINE)
    listed = {name: [float(number) for number in re.split(r" \| |, ", numbers)] for name, numbers in rows}
    assert set(listed) == set(VEHICLES)
    for name, vehicle in VEHICLES.items():
        limits = [vehicle.speed, vehicle.acceleration, vehicle.jerk, vehicle.climb_speed, vehicle.descent_speed]
        assert listed[name] == pytest.approx([*limits, 57.29577951308232 * vehicle.yaw_rate])


def test_the_bodies_of_vehicles_are_listed() -> None:
    rows = re.findall(r"^\| .+: (`.+`) \| (.+) \|$", (DOCS / "planners" / "flight.md").read_text(), flags=re.MULTILINE)
    listed = {name: numbers.split(" | ") for names, numbers in rows for name in re.findall(r"`(\S+)`", names)}
    assert set(listed) == {name for name, vehicle in VEHICLES.items() if vehicle.body is not None}
    for name, numbers in listed.items():
        body = VEHICLES[name].body
        assert body is not None
        for number, value in zip(numbers, (*vars(body).values(), body.hover_power), strict=True):
            assert number == f"{value:.{len(number.partition('.')[2])}f}"


@pytest.fixture(scope="module")
def formulas() -> ModuleType:
    pytest.importorskip("mkdocs", reason=NO_MKDOCS)
    spec = importlib.util.spec_from_file_location("formulas", DOCS / "hooks" / "formulas.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("formula", ["x", r"\frac{a}{b}", r"\sum_{s \ge f} 1/s", r"\hat{y}_h = y"])
def test_a_formula_is_drawn_within_its_box(formulas: ModuleType, formula: str) -> None:
    drawn = formulas.svg(formula, 1.0, "page.md")
    left, top, width, height = map(float, re.search(r'viewBox="([^"]+)"', drawn)[1].split())  # type: ignore[index]
    numbers = [float(number) for number in re.findall(r"-?\d+", re.search(r' d="([^"]+)"', drawn)[1])]  # type: ignore[index]
    across, down = numbers[0::2], numbers[1::2]
    margin = 6  # of 100 in an em: slanted letters lean over
    assert left - margin <= min(across) and max(across) <= left + width + margin
    assert top - margin <= min(down) and max(down) <= top + height + margin
    assert max(across) - min(across) > 0.6 * width - margin


def test_a_formula_that_cannot_be_set_is_named_with_its_page(formulas: ModuleType) -> None:
    from mkdocs.exceptions import PluginError

    with pytest.raises(
        PluginError, match=r"^page\.md: expected a formula that matplotlib can set, got '\\\\nonsense': "
    ):
        formulas.svg(r"\nonsense", 1.0, "page.md")


def test_formulas_of_docstrings_become_those_of_pages(formulas: ModuleType) -> None:
    markdown = pytest.importorskip("markdown", reason=NO_MKDOCS)
    reader = markdown.Markdown(extensions=[formulas.SphinxFormulasExtension()])
    turned = reader.preprocessors["sphinx-formulas"].run(["With :math:`a_b` and", "", ".. math:: c^2 = d", ""])
    assert turned == [r"With \(a_b\) and", "", r"\[c^2 = d\]", ""]


class Elsewhere(HTMLParser):
    """Collects what a browser would fetch from another place."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            fetched = name == "src" or (tag == "link" and name == "href")
            if fetched and value is not None and re.match("(https?:)?//", value):
                self.found.append(value)


@pytest.mark.slow
def test_the_site_builds_without_a_warning_and_fetches_nothing(tmp_path: Path) -> None:
    for module in ("mkdocs", "material", "mkdocstrings_handlers.python"):
        if importlib.util.find_spec(module.partition(".")[0]) is None:
            pytest.skip(NO_MKDOCS)
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert built.returncode == 0, built.stderr[-3000:]
    pages = {path: path.read_text() for path in tmp_path.rglob("*.html")}
    assert len(pages) >= len(list(DOCS.rglob("*.md")))
    for path, text in pages.items():
        reader = Elsewhere()
        reader.feed(text)
        assert reader.found == [], path
        assert "\\(" not in text and ":math:" not in text and ".. math::" not in text, path
    assert pages[tmp_path / "planners" / "next-best-view.html"].count('<svg class="formula"') > 30
    assert "StreamingRecogniser" in pages[tmp_path / "api" / "recognition.html"]
