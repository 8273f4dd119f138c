"""A stream as a film: a stretch of it, as fast as in life, and what is shown at each moment."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ehar.errors import UsageError
from eval.cli.main import main
from eval.replays.figure import ReplayFigure
from eval.replays.replay import make_replay
from tests.helpers.fakes import CLASS_NAMES
from tests.helpers.replays import FRAMES, known_replay
from tests.helpers.stream_runs import forgetful, stream_run
from tests.helpers.tiny_benchmarks import Log

CENTRES = np.linspace([0.0, 0.0, 0.0], [1.0, 0.2, 0.0], FRAMES)
STREAM = replace(known_replay(), labels=np.array([0, 0, 2, 2, 1, 1]), centres=CENTRES)


@pytest.fixture(autouse=True)
def forgets(monkeypatch: pytest.MonkeyPatch) -> None:
    forgetful(monkeypatch)


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a run of streams."""
    with pytest.MonkeyPatch.context() as patch:
        forgetful(patch)
        return stream_run(tmp_path_factory.mktemp("watched"), ("no-act", "h-rotate"))


def test_a_stretch_is_filmed_as_fast_as_in_life(watched: Path, tmp_path: Path) -> None:
    main(["replay", str(watched), "1", "--since", "1", "--until", "2.5", "--out", str(tmp_path / "a.gif")])
    with Image.open(tmp_path / "a.gif") as film:
        assert film.n_frames == 15  # type: ignore[attr-defined]  # of 10 a second
        assert film.info["duration"] == 100


def test_times_that_hold_no_frames_are_refused(watched: Path) -> None:
    for since, until in ((-1.0, 2.0), (2.0, 2.0), (6.0, None)):
        with pytest.raises(UsageError, match="--since, --until: expected two times from 0 to 5 s"):
            make_replay(watched, 0, since=since, until=until, reporter=Log())


def test_a_part_keeps_what_belongs_to_its_frames() -> None:
    part = STREAM.cut(2, 5)
    assert (part.frames, part.first, part.length) == (3, 2, FRAMES)
    assert part.labels.tolist() == [2, 2, 1]
    for camera, whole in zip(part.cameras, STREAM.cameras, strict=True):
        np.testing.assert_array_equal(camera.path, whole.path[2:5])
        assert camera.target is not None and whole.target is not None
        np.testing.assert_array_equal(camera.target, whole.target[2:4])
        assert camera.wanted(2) is None  # the last frame
    np.testing.assert_array_equal(part.true_probability[0], STREAM.true_probability[0][2:5])
    right = STREAM.cameras[0].probabilities[2:5].argmax(axis=1) == [2, 2, 1]
    np.testing.assert_array_equal(part.right(part.cameras[0]), right)


def test_what_is_shown_changes_and_the_ground_passes_below() -> None:
    figure = ReplayFigure(STREAM, 1.0)
    said = []
    for frame in (0, 2, 4):
        figure.draw(frame)
        said.append(figure._shown.get_text())
    assert said == [f"shown: {CLASS_NAMES[label]}" for label in (0, 2, 1)]
    scene = figure._panels[0]
    lines = [scene._lines_below(CENTRES[frame]) for frame in (0, 1)]  # type: ignore[attr-defined]
    assert np.abs(lines[1] - lines[0]).max() > 0.05
    assert STREAM.shown_classes == [0, 1, 2]
