from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest

from ehar.conditions import Conditions
from ehar.data.motion_file import save_motion
from ehar.data.scenario import split_parts
from ehar.errors import UsageError
from ehar.world import PAPER
from eval.cli.main import main
from eval.records.episode_lines import read_episodes
from eval.running.episodes import cut_scenarios, random_starts
from eval.studies.explain import explain, moments
from eval.studies.explain_figure import draw_explanation, shown_classes
from eval.studies.explanation import Explanation, explain_table
from planners.value.view_basis import PAPER_RANGE, field_value
from tests.helpers.fakes import CLASS_NAMES, tiny_data
from tests.helpers.gain_models import model_of, peak_weights
from tests.helpers.tiny_benchmarks import HashedRecogniser, Log
from tests.helpers.tiny_benchmarks import run as run_tiny

PEAK = np.array([8.0, np.radians(200), np.radians(60)])


@pytest.fixture(autouse=True)
def known_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("recognition.storage.load_recogniser", lambda *_, **__: HashedRecogniser())
    monkeypatch.setattr("eval.running.choice.ModelPlace.load_gain_model", lambda _: model_of(peak_weights(PEAK)))


def explained(**options: Any) -> Explanation:
    conditions = Conditions(data=options.pop("data", tiny_data(sequences=20)), length=10)
    return explain(conditions, **{"reporter": Log(), **options})


def test_moments_lie_between_a_tenth_and_nine_tenths() -> None:
    assert moments(60, 4).tolist() == [5, 21, 37, 53]
    assert moments(60, 1).tolist() == [5]
    assert moments(2, 1).tolist() == [0]
    for length in (2, 5, 60):
        shown = moments(length, length - 1)
        assert (np.diff(shown) > 0).all() and shown[0] >= 0 and shown[-1] <= length - 2


@pytest.mark.parametrize("planner", ["nbv", "nbv-search", "nbv-greedy"])
def test_the_map_is_best_where_the_field_peaks(planner: str) -> None:
    explanation = explained(planner=planner)
    for frame in explanation.moments:
        field = explanation.field_map(frame)
        row, column = field.best
        assert field.azimuth[column] == pytest.approx(200, abs=1)
        assert field.polar[row] == pytest.approx(60, abs=1)
        assert field.gain[row, column] == field.gain.max() >= 0
        # A view's gain is over the camera's own.
        _, azimuth, polar = np.degrees(explanation.viewpoints[frame])
        nearest = field.gain[np.abs(field.polar - polar).argmin(), np.abs(field.azimuth - azimuth % 360).argmin()]
        assert abs(nearest) < 0.05
    assert np.ptp(explanation.weights, axis=0).max() == 0  # this field knows nothing of the situation
    first, last = field_value(explanation.weights[0], explanation.viewpoints[[0, -1]], PAPER_RANGE)
    assert last > first  # the planner went there


def test_it_explains_the_benchmarks_own_episode(tmp_path: Path) -> None:
    data = tiny_data(sequences=20)
    run_tiny(["no-act"], data=data, starts=1, out=tmp_path / "run")
    recorded = read_episodes(tmp_path / "run" / "episodes.jsonl")["no-act"]
    episodes = random_starts(cut_scenarios(data, split_parts(data).test, 10, lambda _: None), 1, 0, PAPER)
    for index in (0, 7):
        alone, together = episodes.pick([index]), episodes.batch(0)
        np.testing.assert_array_equal(alone.positions[0], together.positions[index])
        for draws, all_draws in zip(alone.noise, together.noise, strict=True):
            np.testing.assert_array_equal(draws[0], all_draws[index])
        explanation = explained(data=data, episode=index)
        np.testing.assert_allclose(explanation.viewpoints[0], recorded.start[index], atol=1e-6)
        assert (explanation.labels == recorded.label[index]).all()
        assert explanation.sequence.startswith(recorded.sequence[index])


def explanation_of(right: list[bool]) -> Explanation:
    explanation = explained()
    recognised = np.full((len(right), len(CLASS_NAMES)), 0.1)
    label = explanation.labels[0]
    wrong = (label + 1) % len(CLASS_NAMES)
    recognised[np.arange(len(right)), np.where(right, label, wrong)] = 0.8
    return Explanation(**{**vars(explanation), "recognised": recognised, "labels": np.full(len(right), label)})


def test_the_outcome_says_what_was_recognised_and_since_when() -> None:
    name = CLASS_NAMES[explained().labels[0]]
    assert explanation_of([True] * 4).outcome == f"recognised as {name} from the first frame on"
    assert explanation_of([True, False, True, True]).outcome == f"recognised as {name} for good from frame 3 of 4 on"
    outcome = explanation_of([True, True, False]).outcome
    assert outcome.startswith("taken for ") and name not in outcome and outcome.endswith("right in 2 of 3 frames")


def test_the_true_class_is_always_drawn() -> None:
    explanation = explained()
    believed = np.tile(np.linspace(1, 0, 30), (9, 1))
    many = Explanation(**{**vars(explanation), "believed": believed, "labels": np.full(10, 29)})
    assert shown_classes(many) == [*range(9), 29]
    assert shown_classes(explanation) == [0, 1, 2]


def test_it_is_drawn_and_tabled(tmp_path: Path) -> None:
    explanation = explained()
    draw_explanation(explanation, tmp_path / "a.svg")
    drawn = (tmp_path / "a.svg").read_text()
    assert drawn.startswith("<?xml")
    draw_explanation(explained(frames=1), tmp_path / "a.png")
    assert matplotlib.image.imread(tmp_path / "a.png").std() > 0.05
    assert {path.name for path in tmp_path.iterdir()} == {"a.svg", "a.png"}
    table = explain_table(explanation)
    assert [row[0] for row in table.rows] == [str(frame + 1) for frame in explanation.moments]
    assert all(row[8:] == ("200", "60") for row in table.rows)
    assert explanation.outcome in table.title


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"planner": "random"}, "unknown planner 'random'"),
        ({"episode": 20}, "episode: expected 0 to 19, got 20"),
        ({"frames": 0}, "frames: expected 1 to 9"),
        ({"frames": 10}, "frames: expected 1 to 9"),
    ],
)
def test_bad_input_is_named(options: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        explained(**options)


def test_the_command_draws_and_prints(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, picture = tmp_path / "tiny.npz", tmp_path / "picture.png"
    save_motion(path, tiny_data(sequences=20))
    options = ["study", "explain", "--data", str(path), "--length", "10", "--planner", "nbv-greedy", "--frames", "2"]
    main([*options, "--out", str(picture)])
    assert picture.is_file()
    assert "nbv-greedy" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main([*options, "--out", str(tmp_path / "picture.txt")])
    assert "expected a picture that ends in .png" in capsys.readouterr().err
