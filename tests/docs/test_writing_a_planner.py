"""What docs/writing-a-planner.md shows is what lies in docs/examples, and runs."""

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.conditions import Conditions
from ehar.data.motion_file import load_motion, save_motion
from ehar.data.scenario import part_of, windows
from ehar.envs.controls import GridControls
from ehar.envs.environment import EpisodeVectorEnv
from ehar.envs.task import EpisodeTask
from ehar.motion import GridMotion
from ehar.planner import Context
from ehar.rollout import rollout
from ehar.sensors.perfect import PerfectSensor
from eval import benchmark, check_motion, check_planner, check_recogniser
from eval.cli.commands.benchmark import BENCHMARK
from eval.cli.main import parse
from eval.cli.own_flags import fold_flags
from planners.registry import resolve_planner
from recognition.calibration import Temperature
from recognition.networks.spec import NetworkSpec
from recognition.setting import load_motion_of
from recognition.storage import load_recogniser, recogniser_path, save_recogniser
from tests.helpers.fakes import FakeRecogniser, tiny_batch, tiny_context, tiny_data
from tests.helpers.gain_models import model_of, peak_weights
from tests.helpers.pages import DOCS, commands, python_blocks
from tests.helpers.tiny_benchmarks import Log
from tests.helpers.tiny_benchmarks import run as run_tiny

PAGE = DOCS / "writing-a-planner.md"
EXAMPLES = DOCS / "examples"
LENGTH = 8


@pytest.mark.parametrize(
    "path", sorted(set(EXAMPLES.glob("*.py")) - set(EXAMPLES.glob("live_*.py"))), ids=lambda path: str(path.stem)
)
def test_the_page_shows_every_example_as_it_is(path: Path) -> None:
    assert path.read_text() in python_blocks(PAGE)
    assert len(path.read_text().splitlines()) <= 65


@pytest.mark.usefixtures("fake_weights")
def test_the_spiral_conforms_and_does_what_it_says() -> None:
    spec = f"{EXAMPLES}/spiral.py:Spiral(distance=6)"
    found = check_planner(spec, Conditions(data=tiny_data()))
    assert found.passed, str(found)
    summary = run_tiny([spec, "no-act"], data=tiny_data(sequences=20), starts=1).summary
    assert summary.planner("spiral(distance=6)").metrics["path_length_m"] > 0.5


def made_rays(steps: int, peak: list[float]) -> Any:
    model = model_of(peak_weights(np.array(peak)))
    return resolve_planner(f"{EXAMPLES}/rays.py:Rays(steps={steps})", lambda: model)[0]


@pytest.mark.usefixtures("fake_weights")
def test_the_rays_conform() -> None:
    found = check_planner(made_rays(5, [8.0, 1.0, 1.2]), Conditions(data=tiny_data()))
    assert found.passed, str(found)


def test_the_rays_climb_to_where_the_field_is_highest() -> None:
    peak = [8.0, 1.0, 1.2]
    batch = tiny_batch(episodes=5, length=150)
    context = tiny_context(episodes=5, length=150)
    record = rollout(made_rays(3, peak), batch, FakeRecogniser(), PerfectSensor(), GridMotion(), context)
    np.testing.assert_allclose(record.viewpoints[:, -1], np.tile(peak, (5, 1)), atol=0.2)


@pytest.mark.slow
def test_the_rays_run_over_the_trained_field() -> None:
    conditions = Conditions(data="solo", sensor="estimator", part="validation")
    summary = benchmark([f"{EXAMPLES}/rays.py:Rays", "no-act"], conditions).summary
    assert summary.planner("rays").acc_mean > summary.planner("no-act").acc_mean + 0.5


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Conditions:
    """Write tiny data and an untrained recogniser of it, and return the conditions of both."""
    folder = tmp_path_factory.mktemp("world")
    save_motion(folder / "tiny.npz", tiny_data(sequences=24))
    spec = NetworkSpec.of(load_motion(folder / "tiny.npz"), form="causal", size="small", length=LENGTH)
    world = Conditions(data=str(folder / "tiny.npz"), models=folder, length=LENGTH)
    path = recogniser_path(folder, world)
    save_recogniser(path, spec.build(), spec, Temperature(), {})
    return world


@pytest.fixture(scope="module")
def learned(world: Conditions) -> Any:
    return runpy.run_path(str(EXAMPLES / "learned.py"))["train"](60, world)


def test_the_learned_policy_conforms_and_runs(world: Conditions, learned: Any) -> None:
    found = check_planner(learned, world)
    assert found.passed, str(found)
    run = benchmark([learned, "no-act"], world, reporter=Log())
    assert run.summary.planner("learned").metrics["path_length_m"] >= 0


def test_the_learned_policy_makes_the_moves_that_it_makes_in_its_environment(world: Conditions, learned: Any) -> None:
    data = load_motion_of(world)
    recogniser = load_recogniser(world, data)
    scenarios = windows(data, part_of(data, "policy"), LENGTH, 1)
    envs = EpisodeVectorEnv(
        4, EpisodeTask(scenarios=scenarios, recogniser=recogniser, sensor=PerfectSensor(), controls=GridControls())
    )
    seen, _ = envs.reset(seed=0)
    viewpoints = [envs.episodes.viewpoint]
    for _ in range(LENGTH - 1):
        moves, _ = learned.policy.predict(seen, deterministic=True)
        seen, *_ = envs.step(moves)
        viewpoints.append(envs.episodes.viewpoint)
    context = Context(
        episodes=4,
        length=LENGTH,
        frame_time=1 / data.fps,
        class_names=data.class_names,
        skeleton=data.skeleton,
        workspace=GridMotion().workspace,
        track="ideal",
        rng=np.random.default_rng(0),
    )
    record = rollout(learned, envs.episodes._batch, recogniser, PerfectSensor(), GridMotion(), context)
    np.testing.assert_allclose(record.viewpoints, np.stack(viewpoints, axis=1), atol=1e-9)


def test_the_recogniser_of_the_page_conforms(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(next(block for block in python_blocks(PAGE) if "class Mine" in block))
    for persons in (1, 2):
        found = check_recogniser(f"{path}:Mine(strength=0.2)", Conditions(data=tiny_data(persons=persons)))
        assert found.passed, str(found)


def test_the_motion_of_the_page_conforms_and_counts_the_frames_of_the_world(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(next(block for block in python_blocks(PAGE) if "class Slow" in block))
    assert check_motion(f"{path}:Slow").passed
    slow = runpy.run_path(str(path))["Slow"]()
    grid, target = GridMotion(), np.array([[9.0, 1.0, 1.0]])
    grid.reset(np.array([[6.0, 0.0, 1.0]]), 0.04)
    begin = grid.advance(np.array([[6.0, 0.0, 1.0]]))  # a place of the grid
    slow.reset(begin, 0.04)
    reached = [slow.advance(target) for _ in range(4)]
    assert [np.array_equal(here, begin) for here in reached] == [True, False, False, False]
    np.testing.assert_array_equal(reached[1], reached[2])
    assert slow._frame == 4


def test_flags_after_a_class_of_the_page_become_its_arguments() -> None:
    shown = commands(PAGE)  # what they run is tested above
    assert len(shown) >= 6 and all(callable(parse(words)) for words in shown)
    run = [fold_flags(words, BENCHMARK.options()) for name, *words in shown if name == "benchmark"]
    planners = {word for words in run for word in words}
    assert {"./spiral.py:Spiral(distance='8', turn='-0.2')", "./rays.py:Rays", "./rays.py:Rays(steps='30')"} <= planners
