"""Sweeps: everything that planners need, on several data sets and seeds, as one graph of stages."""

import os
import socket
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from ehar.conditions import Conditions
from ehar.data.motion_data import MotionData
from ehar.data.streams.data import StreamData
from ehar.errors import EharError, UsageError
from ehar.files import check_folder
from ehar.processes import Engine, Processes, check_workers, cores
from eval.running.cluster import EngineName, engine_of
from eval.running.cost import Steps, duration, predicted, step_seconds, steps_of
from eval.running.outlook import outlook
from eval.running.training import (
    Effort,
    TrainAllConfig,
    Trained,
    has_fixed_best,
    has_gain_field,
    has_recogniser,
    searching,
    train_all,
)
from recognition.setting import load_recordings_of

RECOGNISER, GAIN_FIELD, FIXED_BEST, DEMONSTRATIONS = "recogniser", "gain field", "fixed-best", "demonstrations"


@dataclass(frozen=True, kw_only=True)
class SweepConfig:
    """The configuration of all trainings on one data set or several.

    Args:
        conditions: conditions of all trainings; each set takes the place of their data.
        data: one data set or several.
        out: folder to write to; of several sets, each has a folder there, with its name.
        seeds: the agents' training seeds, by name: 7 8 9.
        setting: tiny, a first try in a minute or two; quick, for 2 CPU cores; paper, as published, for a GPU: it takes
            --views paper, and trains no field.
        in_the_way: whether recognisers learn with pillars, boxes and passers-by in the way, in an open world.
        workers: number of processes.
        engine: processes of this machine, or ray: a cluster whose machines share `out` and the data.
        address: address of a running Ray cluster, or auto; None starts one here.
        device: device of the recogniser's and of PPO's network: cpu or cuda.
    """

    conditions: Conditions
    data: tuple[str | Path | MotionData | StreamData, ...]
    out: Path
    seeds: tuple[int, ...] = (0,)
    setting: Effort = "quick"
    in_the_way: bool = False
    workers: int = field(default_factory=cores)
    engine: EngineName = "processes"
    address: str | None = None
    device: str = "cpu"

    @property
    def alone(self) -> bool:
        """Whether there is one set, which this machine trains on stage by stage."""
        return len(self.data) == 1 and self.engine == "processes"

    @cached_property
    def machines(self) -> Engine:
        """What runs the stages: with processes, as many as there are sets.

        Raises:
            UsageError: the engine is unknown, or not installed.
        """
        check_workers(self.workers)
        beside = self.workers if self.engine == "ray" else min(self.workers, len(self.data))
        return engine_of(self.engine, self.address, beside)

    @property
    def inside(self) -> Engine:
        """What runs the jobs of one stage: the whole cluster, or its share of this machine's processes."""
        machines = self.machines
        return Processes(self.workers // machines.workers) if isinstance(machines, Processes) else machines

    @cached_property
    def sets(self) -> dict[str, TrainAllConfig]:
        """The trainings on each set, by the name of the set.

        Raises:
            UsageError: two sets have one name.
        """
        inside = self.inside
        workers = self.workers if self.alone else inside.workers if isinstance(inside, Processes) else 1
        found: dict[str, TrainAllConfig] = {}
        for data in self.data:
            name = data.name if isinstance(data, MotionData | StreamData) else Path(data).stem
            if name in found:
                raise UsageError(f"--data: expected sets with different names, got {name} twice")
            found[name] = TrainAllConfig(
                conditions=replace(self.conditions, data=data),
                out=self.out if len(self.data) == 1 else self.out / name,
                seeds=self.seeds,
                setting=self.setting,
                in_the_way=self.in_the_way,
                workers=workers,
                device=self.device,
            )
        return found


class Stage(NamedTuple):
    """One training on one set.

    Args:
        data: name of the set.
        kind: recogniser, gain field, fixed-best, demonstrations, or an agent.
        seed: training seed of an agent.
        agent: agent that demonstrations are for.
    """

    data: str
    kind: str
    seed: int | None = None
    agent: str | None = None

    @property
    def column(self) -> str:
        """The column of a table of sets that it stands in."""
        return self.agent or self.kind

    def __str__(self) -> str:
        """Return the name of the stage in messages."""
        seed = "" if self.seed is None else f" seed {self.seed}"
        return f"{self.data}, {self.kind}{seed}{f' for {self.agent}' if self.agent else ''}"


class End(NamedTuple):
    """How a stage ended.

    Args:
        seconds: how long it took [s].
        kept: whether it was done before.
        error: what was wrong, on one line; empty if nothing was.
        warnings: what its user should know.
    """

    seconds: float
    kept: bool = False
    error: str = ""
    warnings: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return it in a few words."""
        if self.error:
            return f"failed: {self.error}"
        return "kept" if self.kept else f"done in {duration(self.seconds)}"


def stages_of(sets: Mapping[str, TrainAllConfig]) -> dict[Stage, tuple[Stage, ...]]:
    """Return the stages of all sets, and which stages each of them needs.

    The graph of a set: its recogniser first; then gain field, fixed-best, demonstrations and ppo; il and dagger after
    their demonstrations, or after the recogniser where each seed draws its own; il-ppo of a seed after il of that seed.
    """
    graph: dict[Stage, tuple[Stage, ...]] = {}
    for name, config in sets.items():
        recogniser = (Stage(name, RECOGNISER),)
        graph[recogniser[0]] = ()
        # Gain fields and places are for the causal form, and no part of the paper; to try every place takes long.
        valued = {"paper": (), "tiny": (GAIN_FIELD,), "quick": (GAIN_FIELD, FIXED_BEST)}[config.setting]
        graph |= {Stage(name, kind): recogniser for kind in valued}
        for agent in config.agents.stage_names:
            needed = recogniser
            if agent in ("il", "dagger") and not config.agents.imitation(agent).per_seed:
                needed = (Stage(name, DEMONSTRATIONS, agent=agent),)
                graph[needed[0]] = recogniser
            for seed in config.seeds:
                graph[Stage(name, agent, seed)] = (Stage(name, "il", seed),) if agent == "il-ppo" else needed
    return graph


@dataclass(frozen=True)
class _Task:
    """What all stages share.

    Args:
        sets: the trainings on each set.
        inside: runs the jobs of a stage.
        folder: present folder, which relative paths begin at.
    """

    sets: Mapping[str, TrainAllConfig]
    inside: Engine
    folder: Path


def run_stage(task: _Task, stage: Stage) -> End:
    """Run one stage in this process; what goes wrong is returned, as other sets go on.

    It computes on one thread: the digits of sums depend on their number, which should not depend on the machine.
    """
    from recognition.torch_threads import one_torch_thread  # imported here: torch takes seconds

    begin, notes = time.monotonic(), list[str]()
    try:
        try:
            os.chdir(task.folder)
        except OSError as error:
            raise UsageError(
                f"{task.folder}: machine {socket.gethostname()} cannot open it: {error.strerror}; expected a folder "
                "that all machines share"
            ) from error
        with one_torch_thread():
            kept = _train(stage, task.sets[stage.data], task.inside, notes.append)
    except Exception as error:  # whatever it is, other sets go on
        known = isinstance(error, EharError)
        line = " ".join(str(error).split())
        return End(time.monotonic() - begin, error=line if known else f"{type(error).__name__}: {line}"[:300])
    return End(time.monotonic() - begin, kept, warnings=tuple(note for note in notes if "warning: " in note))


def _train(stage: Stage, config: TrainAllConfig, inside: Engine, note: Callable[[str], None]) -> bool:
    """Train what a stage is about; return whether it was done before."""
    from planners.agents import training as agents  # imported here: torch takes seconds
    from planners.agents.storage import agent_path
    from planners.agents.world import TrainingWorld
    from planners.place import fit
    from planners.value import training as gain_fields
    from recognition.training import trainer

    if stage.kind == RECOGNISER:
        if has_recogniser(config):
            return True
        outcome = trainer.train_recogniser(replace(config.recogniser, threads=1))
        note(f"{'warning: ' * outcome.cut_short}{outcome.reason}")
    elif stage.kind == GAIN_FIELD:
        if has_gain_field(config):
            return True
        gain_fields.train_gain_field(config.gain_field, searching, _silent, note, inside)
    elif stage.kind == FIXED_BEST:
        if has_fixed_best(config):
            return True
        fit.fit_fixed_best(config.fixed_best, _silent, note, inside)
    elif stage.kind == DEMONSTRATIONS:
        asked = config.agents
        (setting,) = [asked.imitation(agent) for agent in asked.stage_names if agent == stage.agent]
        agents.demonstrations_of(asked, setting, TrainingWorld.load(asked), _silent, engine=inside)
    else:
        assert stage.seed is not None
        kept = agent_path(config.out, stage.kind, config.with_models, stage.seed).is_file()
        asked, named = (
            replace(config.agents, stages=stage.kind, seeds=(stage.seed,)),
            f"{stage.kind} seed {stage.seed}: ",
        )
        agents.train_agents(asked, _silent, lambda line: note(line.removeprefix(named)))
        return kept
    return False


def _silent(stage: str, done: int, total: int) -> None:
    """Take no notice of progress: a stage may be on another machine."""


def _rows(
    graph: Mapping[Stage, tuple[Stage, ...]], ends: Mapping[Stage, End], columns: Sequence[str]
) -> list[tuple[str, ...]]:
    """Return the rows of a table: for each set, how far it is in each column."""

    def cell(name: str, column: str) -> str:
        stages = [stage for stage in graph if (stage.data, stage.column) == (name, column)]
        done = [ends[stage] for stage in stages if stage in ends]
        if any(end.error for end in done):
            return "failed"
        if len(done) < len(stages):
            return f"{len(done)} of {len(stages)}"
        return "kept" if all(end.kept for end in done) else duration(sum(end.seconds for end in done))

    return [(name, *(cell(name, column) for column in columns)) for name in dict.fromkeys(one.data for one in graph)]


def _outlook(sets: Mapping[str, TrainAllConfig], graph: Mapping[Stage, tuple[Stage, ...]], config: SweepConfig) -> str:
    """Return a line that says what a sweep will take: its work, its longest chain, and both on this machine."""
    step = {name: step_seconds(one) for name, one in sets.items()}
    held = {name: load_recordings_of(one.told) for name, one in sets.items()}
    costs: dict[Stage, Steps] = {}
    for stage in graph:
        one = sets[stage.data]
        kept = _is_kept(stage, one)
        steps = Steps(0.0, 0.0) if kept else steps_of(one, held[stage.data], stage.kind, stage.agent)
        costs[stage] = Steps(step[stage.data] * steps.least, step[stage.data] * steps.most)
    work, chain = predicted(graph, costs, 1), predicted(graph, costs, len(graph))
    what = f"{len(graph)} stages on {len(sets)} set{'s' * (len(sets) > 1)}"
    line = f"{what}: {work} on one core, {chain} on any number of them"
    return line if config.address else f"{line}, {predicted(graph, costs, config.workers)} on {config.workers}"


def _is_kept(stage: Stage, config: TrainAllConfig) -> bool:
    """Return whether a stage is done; one that does not fit is not: it says so when its turn comes."""
    from planners.agents.storage import agent_path  # imported here: torch takes seconds

    if stage.seed is not None:
        return agent_path(config.out, stage.kind, config.with_models, stage.seed).is_file()
    try:
        if not has_recogniser(config):
            return False
        done = {RECOGNISER: lambda _: True, GAIN_FIELD: has_gain_field, FIXED_BEST: has_fixed_best}.get(stage.kind)
        return done is not None and done(config)
    except EharError:
        return False


def train_sets(config: SweepConfig) -> Trained:
    """Train recogniser, gain field, fixed-best and agents on each set; finished parts are kept, and stopped ones go on.

    If a stage fails, those that need it are left out, and all others go on.

    Raises:
        EharError: an option is wrong, or the data of a set cannot be trained on; this is told before anything begins.
            With one set and processes, also what a training raised.
    """
    from eval.running.progress import TableProgress  # imported here: it brings rich

    sets = config.sets
    if config.alone:
        (only,) = sets.values()
        return train_all(only, lambda: _outlook(sets, stages_of(sets), config))
    for name, one in sets.items():
        one.agents.check()
        check_folder(one.out)
        for line in outlook(load_recordings_of(one.told), one.told.length):
            print(f"{name}: {line}", flush=True)
    graph = stages_of(sets)
    print(_outlook(sets, graph, config), flush=True)
    ends: dict[Stage, End] = {}

    def ready(candidates: Sequence[Stage]) -> list[Stage]:
        return [one for one in candidates if all(need in ends and not ends[need].error for need in graph[one])]

    def follow(stage: Stage, _: End) -> list[Stage]:
        return ready([one for one in graph if stage in graph[one]])

    task = _Task(sets, config.inside, Path.cwd())
    columns = list(dict.fromkeys(stage.column for stage in graph))
    with TableProgress("set", columns) as progress:
        progress.show(_rows(graph, ends, columns))
        try:
            for stage, end in config.machines.each_batch(run_stage, task, ready(list(graph)), follow):
                ends[stage] = end
                for line in (*end.warnings, str(end)):
                    progress.note(f"{stage}: {line}")
                progress.show(_rows(graph, ends, columns))
        except KeyboardInterrupt:
            raise KeyboardInterrupt("what is done is kept; the same command goes on") from None
    failed = [f"{stage} failed: {end.error}" for stage, end in ends.items() if end.error]
    left = len(graph) - len(ends)
    if left:
        failed.append(f"left out, as they need these: {left} stage{'s' * (left > 1)}")
    whole = [name for name in sets if all(one in ends and not ends[one].error for one in graph if one.data == name)]
    following = [f"next: ehar benchmark {sets[name].benchmark_options}" for name in whole]
    return Trained(tuple(one.out for one in sets.values()), (*following, *failed), failed=bool(failed))
