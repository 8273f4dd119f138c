import shutil
from pathlib import Path

import pytest

from ehar.errors import UsageError
from eval.speed.report import time_report
from tests.helpers.reports import report_of, tiny_run
from tests.helpers.stream_runs import forgetful, stream_run
from tests.helpers.tiny_benchmarks import HashedRecogniser


def test_what_cannot_be_opened_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    report = tmp_path / "report.html"
    with pytest.raises(UsageError, match=r"report\.html: expected the report\.html of a run, got no such file"):
        time_report(report)
    report.write_text("<html>")
    monkeypatch.setattr("shutil.which", lambda _: None)
    with pytest.raises(UsageError, match="expected chromium on the path to open it, got none"):
        time_report(report)


@pytest.mark.slow
@pytest.mark.skipif(
    not (shutil.which("chromium") or shutil.which("chromium-browser")), reason="NO BROWSER TEST: no chromium"
)
@pytest.mark.parametrize("streams", [False, True])
def test_a_report_can_be_used_some_time_after_it_is_opened(
    streams: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("playwright.sync_api", reason="the browser test needs playwright, of ehar[dev]")
    if streams:
        forgetful(monkeypatch)
        run = stream_run(tmp_path, ("no-act", "h-rotate"))
    else:
        monkeypatch.setattr("recognition.storage.load_recogniser", lambda *_, **__: HashedRecogniser())
        run = tiny_run(tmp_path)
    report_of(run)
    assert 0 < time_report(run / "report.html") < 60  # the target is 3 s, on two idle cores
