"""A report in a real browser: Debian's chromium, headless. Skipped, aloud, where there is none."""

import shutil
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest

from ehar.data.motion_file import save_motion
from ehar.world import CROWD
from tests.helpers.fakes import tiny_data
from tests.helpers.reports import report_of, tiny_run
from tests.helpers.stream_runs import forgetful, stream_run
from tests.helpers.tiny_benchmarks import HashedRecogniser
from tests.helpers.tiny_benchmarks import run as run_tiny

playwright = pytest.importorskip("playwright.sync_api", reason="the browser test needs playwright, of ehar[dev]")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
LAPTOP, PHONE = {"width": 1280, "height": 800}, {"width": 390, "height": 844}

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="NO BROWSER TEST: no chromium (apt-get install chromium)"),
]


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("recognition.storage.load_recogniser", lambda *_, **__: HashedRecogniser())
        run = tiny_run(tmp_path_factory.mktemp("report"))
        report_of(run)
    return run / "report.html"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as running:
        started = running.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield started
        started.close()


@pytest.fixture
def opened(browser: Any, report: Path) -> Iterator[Any]:
    """Return what opens the report, and check at the end that no page has complained or asked the network."""
    complaints: list[str] = []
    pages = []

    def open_page(path: Path = report, **options: Any) -> Any:
        page = browser.new_page(**{"viewport": LAPTOP, **options})
        page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda asked: complaints.append(asked.url) if asked.url.startswith("http") else None)
        page.goto(path.as_uri(), timeout=120_000)  # a busy machine takes its time
        pages.append(page)
        return page

    yield open_page
    for page in pages:
        page.close()
    assert complaints == []


def pixels(image: bytes) -> Any:
    return matplotlib.image.imread(BytesIO(image), format="png")[..., :3]


def painted(page: Any, selector: str) -> Any:
    """Return a screenshot of an element, (H, W, 3), after it came into view and was drawn."""
    page.locator(selector).scroll_into_view_if_needed()
    page.wait_for_timeout(300)
    return pixels(page.locator(selector).screenshot())


def test_every_figure_is_drawn(opened: Any) -> None:
    page = opened()
    figures = page.locator(".figure").all()
    assert len(figures) == 14
    for figure in figures:
        figure.scroll_into_view_if_needed()
        figure.locator(".main-svg").first.wait_for(timeout=30_000)
    assert painted(page, "[data-figure=accuracy]").std() > 0.02


def test_the_table_is_sorted_by_mouse_and_by_keyboard(opened: Any) -> None:
    page = opened()

    def column(index: int) -> list[float]:
        cells = page.locator(f"#table tbody td:nth-child({index + 1})").all()
        return [float(cell.get_attribute("data-value") or "nan") for cell in cells]

    heads = page.locator("#table thead button").all_text_contents()
    mean = heads.index("mean acc %")
    page.locator("#table thead button").nth(mean).click()
    assert column(mean) == sorted(column(mean), reverse=True)
    assert page.locator("#table th").nth(mean).get_attribute("aria-sort") == "descending"
    page.locator("#table thead button").nth(mean).focus()
    page.keyboard.press("Enter")
    assert column(mean) == sorted(column(mean))
    assert page.locator("#table tr.slanted").count() == 1


def test_the_replay_is_scrubbed_played_and_turned(opened: Any) -> None:
    page = opened()
    before = painted(page, "#scene")
    page.locator("#scrub").focus()
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    assert page.locator("#frame").inner_text().startswith("frame 6 of 10")
    after = painted(page, "#scene")
    assert np.abs(after - before).max() > 0.2
    page.locator("#scene").focus()
    page.keyboard.press("ArrowLeft")
    assert np.abs(painted(page, "#scene") - after).max() > 0.2
    page.locator("#play").click()
    page.wait_for_function("document.getElementById('frame').textContent.startsWith('frame 10 of 10')", timeout=30_000)
    page.wait_for_function("document.getElementById('play').textContent === 'Play'", timeout=30_000)
    page.select_option("#second", "oracle")
    assert page.locator("#cast h3").all_inner_texts()[1] == "oracle"
    page.select_option("#second", "")
    assert page.locator("#cast article").count() == 1
    believed = page.locator("#cast .value").all_text_contents()
    assert sum(int(value.removesuffix(" %")) for value in believed) == pytest.approx(100, abs=2)


def test_the_planner_in_focus_changes_its_figures(opened: Any) -> None:
    page = opened()
    before = painted(page, "[data-figure=accuracy]")
    page.locator("select[data-group=focus]").select_option("oracle")
    page.wait_for_timeout(500)
    assert np.abs(painted(page, "[data-figure=accuracy]") - before).max() > 0.2


@pytest.mark.usefixtures("fake_weights")
def test_long_class_names_are_shortened_and_leave_room(opened: Any, tmp_path: Path) -> None:
    names = tuple(f"{letter} <i>person</i> that comes from far & away {letter}" for letter in "ABC")
    save_motion(tmp_path / "tiny.npz", replace(tiny_data(sequences=40), class_names=names))
    run_tiny(["h-rotate", "no-act"], starts=1, data=tmp_path / "tiny.npz", out=tmp_path / "run")
    report_of(tmp_path / "run")
    page = opened(tmp_path / "run" / "report.html", viewport=PHONE)
    for figure in ("confusion", "classes"):
        page.locator(f"[data-figure={figure}]").scroll_into_view_if_needed()
        page.locator(f"[data-figure={figure}] .main-svg").first.wait_for(timeout=30_000)
        shown = page.locator(f"[data-figure={figure}] .ytick text").all_text_contents()
        assert sorted(shown) == [f"{name[:14]}…{name[-9:]}" for name in names]


def test_passers_by_walk_through_the_replay(opened: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("recognition.storage.load_recogniser", lambda *_, **__: HashedRecogniser())
    run = tiny_run(tmp_path, ("no-act", "h-rotate"), world=CROWD)
    report_of(run)
    page = opened(run / "report.html")
    shown = painted(page, "#scene")
    page.evaluate("drawPassers = () => {}; drawFrame()")
    alone = painted(page, "#scene")
    assert 0.0005 < (np.abs(shown - alone).max(axis=-1) > 0.1).mean() < 0.1


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_a_phone_in_light_and_dark(opened: Any, scheme: str) -> None:
    page = opened(viewport=PHONE, color_scheme=scheme)
    for figure in page.locator(".figure").all():
        figure.scroll_into_view_if_needed()
        figure.locator(".main-svg").first.wait_for(timeout=30_000)
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    brightness = painted(page, "#replay").mean()
    assert brightness > 0.8 if scheme == "light" else brightness < 0.3


def test_a_stream_is_read_along_its_timeline_and_replayed(
    opened: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    forgetful(monkeypatch)
    run = stream_run(tmp_path, ("no-act", "h-rotate", "oracle"))
    report_of(run)
    page = opened(run / "report.html", viewport=PHONE, color_scheme="dark")
    for figure in page.locator(".figure").all():
        figure.scroll_into_view_if_needed()
        figure.locator(".main-svg").first.wait_for(timeout=30_000)
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    before = painted(page, "#timeline")
    page.locator("#timeline").focus()
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    told = page.locator("#moment").inner_text()
    assert told.startswith("0.5 s: ") and "h-rotate answers " in told and "no-act answers " in told
    page.locator("select[data-group=focus]").select_option("oracle")
    page.select_option("#watched", "2")
    assert "oracle answers " in page.locator("#moment").inner_text()
    assert np.abs(painted(page, "#timeline") - before).max() > 0.2
    page.locator("#scrub").focus()
    page.keyboard.press("End")
    assert page.locator("#frame").inner_text().startswith("4.9 s of 5 s, shown: ")
    page.locator("#course").click(position={"x": 0.7 * page.locator("#course").bounding_box()["width"], "y": 10})
    assert 2 < float(page.locator("#frame").inner_text().split()[0]) < 4
    assert page.locator("#cast .answer").first.inner_text().startswith("answers ")
