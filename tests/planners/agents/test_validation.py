"""Validation in training: the same held-out episodes each time, the best weights, and why a training ended."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from planners.agents import stages as agent_stages
from planners.agents import validation
from planners.agents.config import AgentTrainingConfig, ImitationSetting, PPOSetting
from planners.agents.imitation import clone
from planners.agents.network import AgentNetwork
from planners.agents.ppo import PPOProgress, ending, train_ppo
from planners.agents.training import train_agents
from planners.agents.validation import Ending, stopped_getting_better
from planners.agents.world import TrainingWorld
from tests.helpers.agent_trainings import PPO, TinyTraining, agent_file, silent, tiny_training, train
from tests.helpers.agent_worlds import tiny_maker, weights
from tests.helpers.agents import untrained_network
from tests.helpers.made_demonstrations import demonstrated, fresh

MOVES = 9
SMALL = PPOSetting(frames=9 * MOVES * 8, num_envs=8, hold=2, copies=4, learning_rate=3e-3, evaluate_every=MOVES * 8)


@pytest.mark.parametrize(
    ("scores", "stopped"),
    [
        ([], False),
        ([3.0, 2.0, 1.0], False),  # not more than three so far
        ([3.0, 2.0, 1.0, 2.9], True),
        ([3.0, 2.0, 1.0, 3.0], True),  # as good is not better
        ([3.0, 2.0, 1.0, 3.1], False),
        ([3.0, 4.0, 1.0, 3.1, 3.2], True),
        ([1.0, np.nan, np.nan, np.nan], True),
    ],
)
def test_patience(scores: list[float], stopped: bool) -> None:
    assert stopped_getting_better(scores, 3) == stopped


def test_a_line_says_why_a_training_ended() -> None:
    stopped = Ending.of([50, 60, 59, 58], [30_000, 60_000, 90_000, 120_000], patience=2, most=600_000, unit="frames")
    assert str(stopped) == "validation stopped getting better after 60,000 of at most 600,000 frames"
    assert (stopped.ended, stopped.better) == (120_000, False)
    short = Ending.of([50, 60, 59], [30_000, 60_000, 90_000], patience=2, most=90_000, unit="frames")
    assert str(short) == "warning: cut short at 90,000 frames, too soon after the best at 60,000: more may help"
    rising = Ending.of([50, 60, 61], [30_000, 60_000, 90_000], patience=2, most=90_000, unit="frames")
    assert str(rising) == "warning: cut short at 90,000 frames, still getting better: more may help"


@dataclass
class Scored:
    """Gives scores in their order, and remembers the weights that got them."""

    scores: Iterator[float]
    seen: list[str]

    def __call__(self, network: AgentNetwork) -> float:
        self.seen.append(weights(network))
        return next(self.scores)


def optimised(scores: list[float], **options: object) -> tuple[PPOProgress, Scored]:
    progress, scored = PPOProgress(AgentNetwork(untrained_network(hindsight=5).spec)), Scored(iter(scores), [])
    setting = replace(SMALL, **options)  # type: ignore[arg-type]
    train_ppo(
        progress,
        tiny_maker(copies=setting.copies),
        moves=MOVES,
        setting=setting,
        seed=0,
        fine_tune=False,
        keep=lambda _: None,
        validate=scored,
    )
    return progress, scored


def test_ppo_stops_when_validation_does_and_remembers_the_best() -> None:
    progress, scored = optimised([10, 30, 20, 25, 29, 99], patience=3)
    assert progress.rollouts == len(progress.history) == 5
    best = AgentNetwork(progress.network.spec)
    best.load_state_dict(progress.best)
    assert weights(best) == scored.seen[1] != weights(progress.network)
    assert str(ending(progress, replace(SMALL, patience=3), MOVES)) == (
        "validation stopped getting better after 144 of at most 648 frames"
    )


def test_ppo_that_gets_better_to_the_end_is_cut_short() -> None:
    progress, _ = optimised([float(score) for score in range(9)], patience=3)
    assert progress.rollouts == 9
    assert ending(progress, replace(SMALL, patience=3), MOVES).better


def test_imitation_stops_before_it_learns_by_heart() -> None:
    """Few frames, whose answers are random, can only be learned by heart."""
    shown, unseen = (demonstrated(64, seed=seed) for seed in (0, 1))
    rng = np.random.default_rng(2)
    noise = replace(shown, values=rng.normal(size=shown.values.shape))
    setting = ImitationSetting(epochs=200, patience=4, batch=64, learning_rate=3e-3)
    network = fresh()
    history = clone(network, noise, setting, seed=0, held_out=unseen)
    losses = [epoch["validation_loss"] for epoch in history]
    assert len(history) < 200 and int(np.argmin(losses)) == len(history) - 1 - setting.patience
    again = clone(network, unseen, replace(setting, epochs=1, learning_rate=0.0), seed=0)
    assert again[0]["loss"] == pytest.approx(min(losses), rel=1e-3), "the best weights are kept"


def test_held_out_are_sequences_that_nothing_is_trained_on(tmp_path: Path) -> None:
    world = TrainingWorld.load(tiny_training(tmp_path))
    assert world.is_held_out and len(world.held_out)
    trained = set(world.scenarios.data.sequence_names)
    held = {world.held_out.data.sequence_names[index] for index in world.held_out.sequence}
    assert held and not held & trained


def test_the_same_network_gets_the_same_score(tmp_path: Path) -> None:
    config = tiny_training(tmp_path)
    world = TrainingWorld.load(config)
    network = world.network(config, 0).train()
    before = weights(network)
    assert world.validation.accuracy(network) == world.validation.accuracy(network)
    assert weights(network) == before and network.training
    assert 0 < world.validation.accuracy(network) < 100


@dataclass(frozen=True, kw_only=True)
class Impatient(TinyTraining):
    """Ends before its frames are done, after the checkpoint of the fifth rollout."""

    @property
    def ppo(self) -> PPOSetting:
        return replace(PPO, frames=30 * 7 * 8, patience=2)


@pytest.fixture
def falling(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let validation find each rollout worse than the one before, from the third evaluation on."""
    scores: dict[str, float] = {}

    def score(_: object, network: AgentNetwork) -> float:
        return scores.setdefault(weights(network), 50.0 - abs(len(scores) - 2))

    monkeypatch.setattr(validation.Validation, "accuracy", score)


def impatient(folder: Path) -> AgentTrainingConfig:
    return Impatient(**{**vars(tiny_training(folder)), "stages": "ppo"})


class Stopped(Exception):
    """Ctrl-C."""


@pytest.mark.usefixtures("falling")
def test_a_training_that_ends_early_says_why_and_resumes_to_the_same_bytes(tmp_path: Path) -> None:
    notes: list[str] = []
    through = impatient(tmp_path / "through")
    train_agents(through, silent, notes.append)
    expected = "validation stopped getting better after 336 of at most 1,680 frames"
    assert notes[-1] == f"ppo seed 0: {expected}"
    file = agent_file(through, "ppo")
    held = json.loads(file.with_suffix(".json").read_text())["training"]
    assert held["ended"]["why"] == expected and held["ended"]["ended"] == 560
    assert [evaluation["frames"] for evaluation in held["evaluations"]] == [112, 224, 336, 448, 560]
    assert len(held["history"]) == 10 and held["validated_on_held_out_sequences"]
    stopped = impatient(tmp_path / "stopped")

    def stop(_: str, rollouts: int, __: int) -> None:
        if rollouts == 7:
            raise Stopped

    with pytest.raises(Stopped):
        train_agents(stopped, stop, silent)
    assert train(stopped) == {path.name: path.read_bytes() for path in (file, file.with_suffix(".json"))}


def test_a_fine_tuning_that_never_gets_better_keeps_what_was_cloned(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scores = iter(range(100, 0, -1))
    monkeypatch.setattr(validation.Validation, "accuracy", lambda *_: float(next(scores)))
    config = replace(tiny_training(tmp_path), stages="il,il-ppo")
    train(config)
    one, other = (
        agent_stages.load_agent(
            replace(config.conditions, models=config.directory),
            TrainingWorld.load(config).setting.data,
            name,
            recogniser_sha256=TrainingWorld.load(config).setting.recogniser_sha256,
            seed=0,
        ).network.state_dict()
        for name in ("il", "il-ppo")
    )
    assert all(bool((one[name] == other[name]).all()) for name in one if not name.startswith("critic."))
