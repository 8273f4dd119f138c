"""Trains agents for one recogniser: demonstrations, imitation, and policy optimisation, for each of several seeds."""

import hashlib
import json
import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import as_completed, wait
from dataclasses import asdict
from multiprocessing.queues import Queue
from pathlib import Path
from queue import Empty
from typing import Any

import cloudpickle

from ehar.data.scenario import Scenarios
from ehar.data.streams.scenario import StreamScenarios
from ehar.files import check_folder
from ehar.processes import Engine, Processes, call, payload, worker_pool
from ehar.world import PAPER
from planners.agents.config import AgentTrainingConfig, ImitationSetting
from planners.agents.demonstrations import EPISODES, Demonstrations, DemonstrationTask, collect, join
from planners.agents.imitation import clone
from planners.agents.network import AgentNetwork
from planners.agents.stages import StageRun
from planners.agents.validation import VALIDATION_SEED, validation_batches
from planners.agents.world import TrainingWorld
from recognition.setting import refuse_told_onsets

Report = Callable[[str, int, int], None]  # the name of the task, the amount done, and the total
Note = Callable[[str], None]
DEMONSTRATIONS = 4  # counts what decides demonstrations beside their key, so that none of before a change are read
SHARED = 0  # seed of demonstrations that all training seeds share, and of the agent that acts in them


def train_agents(config: AgentTrainingConfig, report: Report, note: Note) -> list[Path]:
    """Train and save agents; finished trainings are skipped, and stopped ones go on from their last checkpoint.

    Args:
        config: the settings of the training.
        report: called with progress: the name of the task, the amount done, and the total.
        note: called with lines about the stages: the finished seeds, and the diagnostics of the others.

    Returns:
        the files of all agents that were asked for, stage by stage and seed by seed.

    Raises:
        EharError: data or recogniser are missing or do not fit, an option makes no sense, a loss is not finite, or
            a file of another training is in the way.
    """
    config.check()
    refuse_told_onsets(config.conditions)
    check_folder(config.directory)
    world = TrainingWorld.load(config)
    for line in world.setting.notes:
        note(f"warning: {line}")
    for departure in world.departures(config):
        note(f"warning: not the paper's recogniser: {departure}")
    paths: list[Path] = []
    for stage in config.stage_names:
        runs = [StageRun.of(config, world, stage, seed) for seed in config.seeds]
        paths += [run.path for run in runs]
        missing = [run for run in runs if not run.finished()]
        if len(missing) < len(runs):
            note(f"{stage}: {len(runs) - len(missing)} of {len(runs)} seeds are done")
        if not missing:
            continue
        if stage in ("il", "dagger"):
            _imitate(missing, world, config.imitation(stage), report, note)
        else:
            _optimise(missing, world, config.workers, report, note)
    return paths


def demonstrations_of(
    config: AgentTrainingConfig,
    setting: ImitationSetting,
    world: TrainingWorld,
    report: Report,
    seed: int = SHARED,
    engine: Engine | None = None,
) -> tuple[Demonstrations, Demonstrations]:
    """Return all rounds of demonstrations, and those of held-out people; these are the same for every seed.

    From the second round on, an agent cloned from the earlier rounds acts.

    Args:
        config: the settings of the training.
        setting: the settings of imitation.
        world: the world that episodes are drawn from.
        report: called with progress.
        seed: seed of all random numbers.
        engine: runs the episodes; None means worker processes, as many as `config` says.
    """
    acts = config.without if setting.rounds > 1 else "none"  # what the acting agent leaves out
    key = json.dumps(
        [asdict(setting), config.variations_of_each, world.scenarios.length, config.conditions.fps, acts],
        sort_keys=True,
    )
    setting_key = f"{DEMONSTRATIONS} {key} {world.setting.recordings.sha256} {world.setting.recogniser_sha256}"
    setting_key += "" if world.setting.sensor_sha256 is None else f" {world.setting.sensor_sha256}"
    setting_key += "" if world.setting.world.agrees_with(PAPER) else f" {world.setting.world.to_json()}"
    setting_key += "" if world.flown is None else f" {world.flown}"
    digest = hashlib.sha256(setting_key.encode()).hexdigest()
    batches = max(1, round(setting.episodes / EPISODES / setting.rounds))
    rounds: list[Demonstrations] = []

    def asked(scenarios: Scenarios | StreamScenarios, agent: AgentNetwork | None, *drawn: int) -> DemonstrationTask:
        """Return the task of asking the teacher about episodes of some scenarios."""
        return DemonstrationTask(
            scenarios=scenarios, runner=world.setting.runner, teacher=setting.teacher, agent=agent, seed=drawn
        )

    def task() -> DemonstrationTask:
        """Return the task of the next round."""
        agent = None
        if rounds:
            agent = world.network(config, seed)
            clone(agent, join(rounds), setting, seed=seed, held_out=held_out)
        return asked(world.scenarios, agent, seed, len(rounds))

    def collected(task: Callable[[], DemonstrationTask], batches: int, name: str) -> Demonstrations:
        """Return demonstrations from their folder, or make them."""
        folder = config.directory / f"demonstrations-{config.conditions.seen}-{digest[:8]}-{name}"
        return collect(task, batches, folder, engine=engine or Processes(config.workers), report=report)

    held_out = collected(
        lambda: asked(world.held_out, None, VALIDATION_SEED), validation_batches(world.held_out), "held-out"
    )
    drawn = "" if seed == SHARED else f"seed{seed}-"
    for number in range(setting.rounds):
        rounds.append(collected(task, batches, f"{drawn}round{number}"))
    return join(rounds), held_out


def _imitate(
    runs: Sequence[StageRun], world: TrainingWorld, setting: ImitationSetting, report: Report, note: Note
) -> None:
    """Clone agents for several seeds; those that share their demonstrations each in its own process."""
    config = runs[0].config
    if setting.per_seed:
        for done, run in enumerate(runs, 1):
            note(run.imitate(world, *demonstrations_of(config, setting, world, report, run.seed)))
            report(run.stage, done, len(runs))
        return
    demonstrations = demonstrations_of(config, setting, world, report)
    if len(runs) == 1 or config.workers == 1:
        for done, run in enumerate(runs, 1):
            note(run.imitate(world, *demonstrations))
            report(run.stage, done, len(runs))
        return
    sent = payload((config, demonstrations), "the recogniser or the sensor")
    with worker_pool(min(config.workers, len(runs)), _start_imitating, sent=(sent,)) as pool:
        futures = [pool.submit(call, payload((_imitate_here, run), run.title)) for run in runs]
        for done, future in enumerate(as_completed(futures), 1):
            note(future.result())
            report(runs[0].stage, done, len(runs))


_imitated: tuple[TrainingWorld, tuple[Demonstrations, Demonstrations]]


def _start_imitating(sent: bytes) -> None:
    """Receive the world and the demonstrations, once in each process."""
    global _imitated
    config, demonstrations = cloudpickle.loads(sent)
    _imitated = TrainingWorld.load(config), demonstrations


def _imitate_here(run: StageRun) -> str:
    """Clone the agent of one seed in this process, and return why training ended."""
    world, demonstrations = _imitated
    return run.imitate(world, *demonstrations)


def _optimise(runs: Sequence[StageRun], world: TrainingWorld, workers: int, report: Report, note: Note) -> None:
    """Run PPO for several seeds, each in its own process; one seed alone spreads its environments over processes."""
    for run in runs:
        run.start(world)  # raises at once if something is missing
    if len(runs) == 1 or workers == 1:
        for run in runs:
            run.optimise(
                world,
                workers=0 if workers == 1 else workers,
                note=note,
                report=report,
            )
        return
    heard: Queue[Any] = multiprocessing.get_context("spawn").Queue()
    with worker_pool(min(workers, len(runs)), _start, (heard,)) as pool:
        futures = [pool.submit(call, payload((_optimise_here, run), run.title)) for run in runs]
        waiting = set(futures)
        while waiting:
            done, waiting = wait(waiting, timeout=0.5)
            _pass_on(heard, report, note)
            failed = [error for future in done if (error := future.exception()) is not None]
            for error in failed if waiting else []:  # the others' work is not lost, but may take hours
                note(f"{error}; the other seeds go on")
        for future in futures:
            future.result()
    _pass_on(heard, report, note)  # processes that have ended have sent all they had


def _pass_on(heard: "Queue[Any]", report: Report, note: Note) -> None:
    """Pass on all notes and progress that processes have sent so far."""
    while True:
        try:
            what = heard.get_nowait()
        except Empty:
            return
        if isinstance(what, str):
            note(what)
        else:
            report(*what)


_heard: "Queue[Any]"


def _start(heard: "Queue[Any]") -> None:
    """Receive the queue for progress, once in each process."""
    global _heard
    _heard = heard


def _optimise_here(run: StageRun) -> None:
    """Run PPO for one seed in this process."""
    world = TrainingWorld.load(run.config)
    run.optimise(world, workers=0, note=_heard.put, report=lambda *heard: _heard.put(heard))
