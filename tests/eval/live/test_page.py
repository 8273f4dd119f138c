"""The page: an engineer sees people, camera, belief and target in a browser, and nobody else's machine is asked."""

import http.client
import json
import shutil
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit
from urllib.request import urlopen

import numpy as np
import pytest

from ehar.errors import UsageError
from ehar.world import PAPER
from eval.live.loop import Said
from eval.live.messages import Answer
from eval.live.page import Page
from eval.live.setpoints import Setpoint
from tests.helpers.fakes import SKELETON

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
NAMES = ("nod", "<b>left</b>", "no activity")


def said(share: float, *, time: float = 1.0, decision: str | None = None) -> Said:
    joints = np.zeros((2, len(SKELETON.joint_names), 3))
    joints[0] = [[400 + 60 * joint, 200 + 50 * joint, 0.9] for joint in range(len(joints[0]))]
    answer = Answer(
        time=time,
        belief=dict(zip(NAMES, (share, 1 - share, 0.0), strict=True)),
        decision=decision,
        viewpoint=(8.0, 0.5, 1.2),
        target=(6.0, 2.0, 1.0),
        joints=joints,
    )
    setpoint = Setpoint(
        time=time,
        position=(1.25, 2.5, 3.0),
        velocity=(0.0, 0.0, 0.0),
        acceleration=(0.0, 0.0, 0.0),
        yaw=0.0,
        yaw_rate=0.0,
        viewpoint=(8.0, 0.6, 1.2),
        braking=False,
    )
    return Said(answer, setpoint, (), {"late": 3})


@pytest.fixture
def page() -> Iterator[Page]:
    shown = Page(0, class_names=NAMES, skeleton=SKELETON, world=PAPER)
    yield shown
    shown.close()


def test_events_tell_what_goes_out_ten_times_a_second(page: Page) -> None:
    page.show(said(0.7), 5.0)
    page.show(said(0.9), 5.05)  # too soon
    with urlopen(page.address + "events") as events:
        first = events.readline().decode()
        assert events.readline() == b"\n"
        page.show(said(0.2), 5.11)
        second = events.readline().decode()
    assert [json.loads(line.removeprefix("data: "))["belief"]["nod"] for line in (first, second)] == [0.7, 0.2]
    held = json.loads(first.removeprefix("data: "))
    assert held["target"] == [6.0, 2.0, 1.0] and len(held["people"]) == 2 and held["counts"] == {"late": 3}


def test_it_serves_this_machine_only_and_nothing_else(page: Page) -> None:
    place = urlsplit(page.address)
    assert place.hostname == "127.0.0.1" and page._server.server_address[0] == "127.0.0.1"
    for path, status in (("/", 200), ("/etc/passwd", 404), ("/../messages.py", 404)):
        connection = http.client.HTTPConnection("127.0.0.1", place.port or 0)
        connection.request("GET", path)
        assert connection.getresponse().status == status
        connection.close()
    with pytest.raises(UsageError, match=f"--page {place.port}: expected a port that is free"):
        Page(place.port or 0, class_names=NAMES, skeleton=SKELETON, world=PAPER)


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="NO BROWSER TEST: no chromium (apt-get install chromium)")
def test_a_browser_shows_people_camera_belief_and_target(page: Page) -> None:
    playwright = pytest.importorskip("playwright.sync_api", reason="the browser test needs playwright, of ehar[dev]")
    complaints: list[str] = []
    asked: list[str] = []
    with playwright.sync_playwright() as running:
        browser = running.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"], timeout=120_000)
        tab = browser.new_page(viewport={"width": 1280, "height": 900})
        tab.on("pageerror", lambda error: complaints.append(str(error)))
        tab.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
        tab.on("request", lambda request: asked.append(request.url))
        tab.goto(page.address)
        assert tab.locator("#state").inner_text() == "waiting for frames"
        assert painted(tab, "#image") == painted(tab, "#map") == 0
        page.show(said(0.25), 1.0)
        tab.wait_for_function("document.querySelector('#state').textContent === 'flying'")
        assert painted(tab, "#image") > 500 and painted(tab, "#map") > 3000
        rows = tab.locator("#belief .row").all_inner_texts()
        assert [row.split("\n") for row in rows] == [["nod", "25 %"], ["<b>left</b>", "75 %"], ["no activity", "0 %"]]
        numbers = tab.locator("#numbers").inner_text()
        assert "1.25, 2.50, 3.00" in numbers and "6.0 m, 115 deg, 57 deg" in numbers and "late\t3" in numbers
        page.show(said(0.95, time=2.0, decision="nod"), 2.0)
        tab.wait_for_function("document.querySelector('#state').textContent === 'flying: nod'")
        assert tab.locator("#belief .row.sure").inner_text().startswith("nod")
        assert set(asked) == {page.address, page.address + "events"} and complaints == []
        page.close()
        tab.wait_for_function("document.querySelector('#state').textContent.startsWith('the loop has ended')")
        browser.close()


def painted(tab: Any, selector: str) -> int:
    """Return how many pixels of a canvas are not as the first one."""
    pixels = "(c => new Uint32Array(c.getContext('2d').getImageData(0, 0, c.width, c.height).data.buffer))({})"
    canvas = f"document.querySelector('{selector}')"
    return int(tab.evaluate(f"{pixels.format(canvas)}.reduce((n, one, _, all) => n + (one !== all[0]), 0)"))
