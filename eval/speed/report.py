"""Times how soon a report responds, in headless Chromium: its table is sorted and its replay moves."""

import shutil
import time
from pathlib import Path

import numpy as np

from ehar.errors import UsageError

REPEATS = 5


def time_report(report: Path) -> float:
    """Return the seconds from opening a report until its table has been sorted and its replay moved on.

    Each of `REPEATS` openings uses a new browser with empty caches; the median counts.

    Args:
        report: `report.html`, with a replay.

    Raises:
        UsageError: there is no such file, or no Chromium or playwright to open it with.
    """
    if not report.is_file():
        raise UsageError(f"{report}: expected the report.html of a run, got no such file")
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        raise UsageError("report: expected chromium on the path to open it, got none")
    try:
        from playwright.sync_api import sync_playwright  # imported here: an extra that few need
    except ImportError as error:
        raise UsageError("report: expected playwright, which pip install -e '.[dev]' brings, to open it") from error
    seconds = np.empty(REPEATS)
    with sync_playwright() as running:
        for repeat in range(REPEATS):
            browser = running.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            begin = time.perf_counter()
            page.goto(report.resolve().as_uri())
            page.locator("#table thead button").first.click()
            page.locator("#table th[aria-sort]:not([aria-sort=none])").first.wait_for()
            before = page.locator("#frame").text_content()
            page.locator("#scrub").focus()
            page.keyboard.press("ArrowRight")
            page.wait_for_function("before => document.getElementById('frame').textContent !== before", arg=before)
            seconds[repeat] = time.perf_counter() - begin
            browser.close()
    return float(np.median(seconds))
