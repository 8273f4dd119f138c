"""One stage of one agent's training: where its result and its checkpoint lie, and how it is run."""

import hashlib
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ehar.errors import ModelError, UsageError
from ehar.files import as_json, parse_json
from planners.agents.config import AgentTrainingConfig, Stage
from planners.agents.demonstrations import Demonstrations
from planners.agents.imitation import clone
from planners.agents.network import AgentNetwork
from planners.agents.storage import agent_name, agent_path, load_agent, save_agent
from planners.agents.world import TrainingWorld
from recognition.torch_threads import one_torch_thread
from recognition.training.checkpoints import Checkpoint, load_checkpoint, save_checkpoint
from recognition.weight_files import description_path, recorded_run

if TYPE_CHECKING:
    from planners.agents.ppo import PPOProgress

KEEP_EVERY = 5  # rollouts, that a checkpoint is kept


@dataclass(frozen=True)
class _Held:
    """What a checkpoint holds beside tensors: which training it is of, and how far that has come."""

    run: dict[str, Any]
    rollouts: int
    history: list[dict[str, Any]]  # of numbers, and NaN where a diagnostic has no value


@dataclass(frozen=True, eq=False)
class StageRun:
    """One stage of the training of one agent.

    Args:
        stage: il, ppo, il-ppo or dagger.
        seed: of the training.
        config: how all agents are trained.
        path: where the agent's weights will lie.
        identity: all that decides the result, for JSON.
    """

    stage: Stage
    seed: int
    config: AgentTrainingConfig
    path: Path
    identity: dict[str, Any]

    @staticmethod
    def of(config: AgentTrainingConfig, world: TrainingWorld, stage: Stage, seed: int) -> "StageRun":
        """Return the run of a stage."""
        return StageRun(stage, seed, config, _path(config, stage, seed), _identity(config, world, stage, seed))

    @property
    def title(self) -> str:
        """What lines that are shown call it."""
        return f"{agent_name(self.stage, self.config.without)} seed {self.seed}"

    @property
    def checkpoint(self) -> Path:
        """Where a run that was stopped left off."""
        return self.path.with_suffix(".checkpoint")

    def finished(self) -> bool:
        """Return whether this very run has finished.

        Raises:
            UsageError: the result of another run lies in its place.
        """
        description = description_path(self.path)
        if not description.is_file() or not self.path.is_file():
            return False
        held, wanted = recorded_run(self.path), as_json(self.identity)
        if held == wanted:
            return True
        raise UsageError(
            f"{description}: holds another training, which differs in {_differing(held, wanted)}: "
            f"remove it, or choose another --out"
        )

    def imitate(self, world: TrainingWorld, demonstrations: Demonstrations) -> None:
        """Clone, and save the result."""
        network = world.network(self.config, self.seed)
        with _named(self.title):
            history = clone(network, demonstrations, self.config.imitation(self.stage), seed=self.seed)
        self.save(world, network, history)

    def start(self, world: TrainingWorld) -> AgentNetwork:
        """Return the network that optimisation begins with: untrained, or as cloned with the same seed.

        Raises:
            ModelError: there is no cloned policy, or it does not fit.
        """
        network = world.network(self.config, self.seed)
        if self.stage == "ppo":
            return network
        path = _path(self.config, "il", self.seed)
        if not path.is_file():
            raise ModelError(f"{path}: no such file: expected the cloned policy, of --stages il,{self.stage}")
        cloned = load_agent(
            replace(self.config.conditions, models=path.parent),
            world.setting.data,
            agent_name("il", self.config.without),
            recogniser_sha256=world.setting.recogniser_sha256,
            seed=self.seed,
        ).network
        if (cloned.spec.sizes, cloned.spec.without) != (network.spec.sizes, network.spec.without):
            raise ModelError(f"{path}: expected an agent of other inputs, or encoders")
        # But for the critic, which cloning does not train, and which a setting may show more than that of il did.
        policy = {name: w for name, w in cloned.state_dict().items() if not name.startswith("critic.")}
        network.load_state_dict(policy, strict=False)
        return network

    @one_torch_thread()
    def optimise(
        self,
        world: TrainingWorld,
        *,
        workers: int,
        note: Callable[[str], None],
        report: Callable[[str, int, int], None],
    ) -> None:
        """Train by PPO from the start or the checkpoint, and save the result.

        Args:
            world: that episodes are drawn from.
            workers: processes that environments run in; 0 runs them here.
            note: hears the diagnostics, in lines.
            report: hears of which run how many rollouts are done, of how many.
        """
        # Here, as stable-baselines3 takes a second to import.
        from planners.agents.ppo import PPOProgress, diagnostics_line, rollouts_of, train_ppo

        network = self.start(world)
        network.train()
        progress = PPOProgress(network)
        self._resume(progress)
        logs = self.config.tensorboard
        setting, moves = self.config.ppo, world.scenarios.length - 1
        total = rollouts_of(setting, moves)

        def keep(reached: PPOProgress) -> None:
            report(self.title, reached.rollouts, total)
            if reached.rollouts % KEEP_EVERY == 0 and reached.rollouts < total:
                self._save_checkpoint(reached)
                note(f"{self.title}, {diagnostics_line(reached, total)}")

        with _named(self.title):
            train_ppo(
                progress,
                partial(world.make_env, copies=setting.copies),
                moves=moves,
                setting=setting,
                seed=self.seed,
                fine_tune=self.stage == "il-ppo",
                keep=keep,
                workers=workers,
                device=self.config.device,
                tensorboard=str(logs / self.path.stem) if logs else None,
            )
        self.save(world, network, progress.history)
        self.checkpoint.unlink(missing_ok=True)

    def save(self, world: TrainingWorld, network: AgentNetwork, history: list[dict[str, float]]) -> None:
        """Write the agent, with how it came about beside it."""
        save_agent(
            self.path,
            network,
            world.setting.data,
            recogniser_sha256=world.setting.recogniser_sha256,
            history={"data": world.setting.data.title, "run": self.identity, "history": history},
        )

    def _save_checkpoint(self, progress: "PPOProgress") -> None:
        """Keep everything that the rollouts to come depend on."""
        held = asdict(_Held(self.identity, progress.rollouts, progress.history))
        states = {"network": progress.network.state_dict()}
        save_checkpoint(self.checkpoint, Checkpoint(states, progress.optimiser, held))

    def _resume(self, progress: "PPOProgress") -> None:
        """Go on from the checkpoint, if there is one of this very run."""
        if not self.checkpoint.is_file():
            return
        try:
            kept = load_checkpoint(self.checkpoint)
            reached = parse_json(json.dumps(kept.held), _Held, "its JSON", "a checkpoint")
            held, wanted = reached.run, as_json(self.identity)
            if held == wanted:
                progress.network.load_state_dict(kept.states["network"])
                progress.optimiser, progress.rollouts = kept.optimiser, reached.rollouts
                progress.history = reached.history
        except Exception as error:  # of the kind that the damage happens to cause, at length
            reason = f"{type(error).__name__}: {error}".splitlines()[0][:120]
            raise ModelError(
                f"{self.checkpoint}: expected a training checkpoint, got {reason}: remove it to start anew"
            ) from error
        if held != wanted:
            raise UsageError(
                f"{self.checkpoint}: a checkpoint of another training, which differs in {_differing(held, wanted)}: "
                f"train with its options, data and recogniser, remove it, or choose another --out"
            )


@contextmanager
def _named(title: str) -> Iterator[None]:
    """Say in an error which of several trainings ended."""
    try:
        yield
    except ModelError as error:
        raise ModelError(f"{title}: {error}") from error


def _differing(held: dict[str, Any], wanted: dict[str, Any]) -> str:
    """Return the names of what two identities differ in, those of settings with the options within."""
    names: list[str] = []
    for key in sorted(wanted.keys() | held.keys()):
        one, other = held.get(key), wanted.get(key)
        if isinstance(one, dict) and isinstance(other, dict):
            names += [f"{key}.{option}" for option in _differing(one, other).split(", ") if option]
        elif one != other:
            names.append(key)
    return ", ".join(names)


def _path(config: AgentTrainingConfig, stage: Stage, seed: int) -> Path:
    name = agent_name(stage, config.without)
    return agent_path(config.directory, name, config.conditions, seed)


def _identity(config: AgentTrainingConfig, world: TrainingWorld, stage: Stage, seed: int) -> dict[str, Any]:
    """Return what decides the result of a stage, for JSON: neither where files lie nor on what it is computed."""
    decisive: dict[str, Any] = {
        "stage": stage,
        "seed": seed,
        "sensor": config.conditions.sensor_name,
        "views": config.conditions.views,
        "length": config.conditions.length,
        "fps": config.conditions.fps,
        "variations": config.variations_of_each,
        "without": config.without,
        "data_sha256": world.setting.data.sha256,
        "recogniser_sha256": world.setting.recogniser_sha256,
    }
    if world.setting.sensor_sha256 is not None:
        decisive["sensor_sha256"] = world.setting.sensor_sha256
    if stage != "ppo":
        decisive["imitation"] = asdict(config.imitation(stage))
    if stage in ("ppo", "il-ppo"):
        decisive["ppo"] = asdict(config.ppo)
    if stage == "il-ppo":  # what it starts from
        start = _path(config, "il", seed)
        decisive["start_sha256"] = hashlib.sha256(start.read_bytes()).hexdigest() if start.is_file() else None
    return decisive
