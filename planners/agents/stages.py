"""One stage of one agent's training: its result, its checkpoint, and its run."""

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
from ehar.world import PAPER
from planners.agents.config import AgentTrainingConfig, Stage
from planners.agents.demonstrations import Demonstrations
from planners.agents.imitation import clone
from planners.agents.network import AgentNetwork, AgentSpec
from planners.agents.storage import agent_name, agent_path, load_agent, save_agent
from planners.agents.validation import Ending
from planners.agents.world import TrainingWorld
from recognition.torch_threads import one_torch_thread
from recognition.training.checkpoints import Checkpoint, load_checkpoint, save_checkpoint
from recognition.weight_files import description_path, recorded_run

if TYPE_CHECKING:
    from planners.agents.ppo import PPOProgress

KEEP_EVERY = 5  # rollouts from one checkpoint to the next


@dataclass(frozen=True)
class _Held:
    """The JSON of a checkpoint: the identity and the progress of its training."""

    run: dict[str, Any]
    rollouts: int
    history: list[dict[str, Any]]  # numbers, with NaN for a diagnostic that has no value
    evaluations: list[dict[str, Any]]


@dataclass(frozen=True, eq=False)
class StageRun:
    """One stage of the training of one agent.

    Args:
        stage: il, ppo, il-ppo or dagger.
        seed: seed of the training.
        config: the settings of all agents' training.
        path: the file for the agent's weights.
        identity: everything that decides the result, for JSON.
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
        """The name of this run in messages."""
        return f"{agent_name(self.stage, self.config.without)} seed {self.seed}"

    @property
    def checkpoint(self) -> Path:
        """The checkpoint of a run that was stopped."""
        return self.path.with_suffix(".checkpoint")

    def finished(self) -> bool:
        """Return whether this run has finished.

        Raises:
            UsageError: the result of another run is in its place.
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

    def imitate(self, world: TrainingWorld, demonstrations: Demonstrations, held_out: Demonstrations) -> str:
        """Clone the demonstrations, save the result, and return a line that says why training ended."""
        network, setting = world.network(self.config, self.seed), self.config.imitation(self.stage)
        with _named(self.title):
            history = clone(network, demonstrations, setting, seed=self.seed, held_out=held_out)
        ending = Ending.of(
            [-epoch["validation_loss"] for epoch in history],
            range(1, len(history) + 1),
            patience=setting.patience,
            most=setting.epochs,
            unit="epochs",
        )
        self.save(world, network, history, ending)
        return f"{self.title}: {ending}"

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
            world.setting.recordings,
            agent_name("il", self.config.without),
            recogniser_sha256=world.setting.recogniser_sha256,
            seed=self.seed,
        ).network
        if (cloned.spec.sizes, cloned.spec.without) != (network.spec.sizes, network.spec.without):
            wanted, got = _encoded(network.spec), _encoded(cloned.spec)
            raise ModelError(f"{path}: expected the inputs and encoders of {self.title}, {wanted}, got {got}")
        # We leave out the critic: cloning does not train it, and its inputs may differ from those in il.
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
            world: the world that episodes are drawn from.
            workers: number of processes that environments run in; 0 runs them here.
            note: called with lines of diagnostics.
            report: called with the name of the run, the rollouts done, and the total.
        """
        # Imported here: stable-baselines3 takes a second to import.
        from planners.agents.ppo import PPOProgress, diagnostics_line, ending, rollouts_of, train_ppo

        network = self.start(world)
        network.train()
        progress = PPOProgress(network)
        self._resume(progress)
        logs = self.config.tensorboard
        setting, moves = self.config.ppo.at(world.scenarios.data.fps), world.scenarios.length - 1
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
                validate=world.validation.accuracy,
                workers=workers,
                device=self.config.device,
                tensorboard=str(logs / self.path.stem) if logs else None,
            )
        network.load_state_dict(progress.best)
        ended = ending(progress, setting, moves)
        note(f"{self.title}: {ended}")
        self.save(world, network, progress.history, ended, evaluations=progress.evaluations)
        self.checkpoint.unlink(missing_ok=True)

    def save(
        self,
        world: TrainingWorld,
        network: AgentNetwork,
        history: list[dict[str, float]],
        ended: Ending,
        **others: Any,
    ) -> None:
        """Write the agent, and beside it a description of its training."""
        save_agent(
            self.path,
            network,
            world.setting.recordings,
            recogniser_sha256=world.setting.recogniser_sha256,
            history={
                "data": world.setting.recordings.title,
                "run": self.identity,
                "not_as_in_the_paper": list(world.departures(self.config)),
                "validated_on_held_out_sequences": world.is_held_out,
                "ended": ended.to_json(),
                **others,
                "history": history,
            },
            world=world.setting.world,
            vehicle=world.setting.runner.track.vehicle,
        )

    def _save_checkpoint(self, progress: "PPOProgress") -> None:
        """Keep everything that later rollouts depend on."""
        held = asdict(_Held(self.identity, progress.rollouts, progress.history, progress.evaluations))
        states = {"network": progress.network.state_dict(), "best": progress.best}
        save_checkpoint(self.checkpoint, Checkpoint(states, progress.optimiser, held))

    def _resume(self, progress: "PPOProgress") -> None:
        """Go on from the checkpoint, if this run has one."""
        if not self.checkpoint.is_file():
            return
        try:
            kept = load_checkpoint(self.checkpoint)
            reached = parse_json(json.dumps(kept.held), _Held, "its JSON", "a checkpoint")
            held, wanted = reached.run, as_json(self.identity)
            if held == wanted:
                progress.network.load_state_dict(kept.states["network"])
                progress.optimiser, progress.rollouts = kept.optimiser, reached.rollouts
                progress.history, progress.evaluations = reached.history, reached.evaluations
                progress.best = dict(kept.states.get("best", {}))
        except Exception as error:  # the damage decides its type, and it may be long
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
    """Put the name of a training before the message of its error."""
    try:
        yield
    except ModelError as error:
        raise ModelError(f"{title}: {error}") from error


def _encoded(spec: AgentSpec) -> str:
    """Return the sizes of a network's inputs and what is left out of them, in words."""
    sizes = ", ".join(f"{name} {size}" for name, size in vars(spec.sizes).items())
    return f"{sizes} without {', '.join(spec.without) or 'nothing'}"


def _differing(held: dict[str, Any], wanted: dict[str, Any]) -> str:
    """Return the names of the fields in which two identities differ; for settings, the names of their options."""
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
    """Return everything that decides the result of a stage, for JSON; paths and the device do not."""
    decisive: dict[str, Any] = {
        "stage": stage,
        "seed": seed,
        "sensor": config.conditions.sensor_name,
        "views": config.conditions.views,
        "length": world.scenarios.length,
        "fps": config.conditions.fps,
        "variations": config.variations_of_each,
        "without": config.without,
        "data_sha256": world.setting.recordings.sha256,
        "recogniser_sha256": world.setting.recogniser_sha256,
    }
    if world.setting.sensor_sha256 is not None:
        decisive["sensor_sha256"] = world.setting.sensor_sha256
    if not world.setting.world.agrees_with(PAPER):
        decisive["world"] = world.setting.world.to_json()
    if world.flown is not None:
        decisive["vehicle"] = world.flown
    if stage != "ppo":
        decisive["imitation"] = asdict(config.imitation(stage))
    if stage in ("ppo", "il-ppo"):
        decisive["ppo"] = {name: value for name, value in asdict(config.ppo).items() if value is not None}
    if stage == "il-ppo":  # what it starts from
        start = _path(config, "il", seed)
        decisive["start_sha256"] = hashlib.sha256(start.read_bytes()).hexdigest() if start.is_file() else None
    return decisive
