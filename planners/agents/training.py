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

from ehar.processes import call, payload, worker_pool
from planners.agents.config import AgentTrainingConfig, ImitationSetting
from planners.agents.demonstrations import EPISODES, Demonstrations, DemonstrationTask, collect, join
from planners.agents.imitation import clone
from planners.agents.stages import StageRun
from planners.agents.world import TrainingWorld

Report = Callable[[str, int, int], None]  # the name of the task, the amount done, and the total
Note = Callable[[str], None]
DAGGER_SEED = 0  # seed of the agent that acts in demonstrations, and of all random numbers in them


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
    world = TrainingWorld.load(config)
    paths: list[Path] = []
    for stage in config.stage_names:
        runs = [StageRun.of(config, world, stage, seed) for seed in range(config.seeds)]
        paths += [run.path for run in runs]
        missing = [run for run in runs if not run.finished()]
        if len(missing) < len(runs):
            note(f"{stage}: {len(runs) - len(missing)} of {len(runs)} seeds are done")
        if not missing:
            continue
        if stage in ("il", "dagger"):
            setting = config.imitation(stage)
            _imitate(missing, world, demonstrations_of(config, setting, world, report), config.workers, report)
        else:
            _optimise(missing, world, config.workers, report, note)
    return paths


def demonstrations_of(
    config: AgentTrainingConfig, setting: ImitationSetting, world: TrainingWorld, report: Report
) -> Demonstrations:
    """Return all rounds of demonstrations; from the second on, an agent cloned from the earlier rounds acts."""
    acts = config.without if setting.rounds > 1 else "none"  # what the acting agent leaves out
    key = json.dumps(
        [asdict(setting), config.variations_of_each, config.conditions.length, config.conditions.fps, acts],
        sort_keys=True,
    )
    setting_key = f"{key} {world.setting.data.sha256} {world.setting.recogniser_sha256}"
    setting_key += "" if world.setting.sensor_sha256 is None else f" {world.setting.sensor_sha256}"
    digest = hashlib.sha256(setting_key.encode()).hexdigest()
    batches = max(1, round(setting.episodes / EPISODES / setting.rounds))
    rounds: list[Demonstrations] = []

    def task() -> DemonstrationTask:
        """Return the task of the next round."""
        agent = None
        if rounds:
            agent = world.network(config, DAGGER_SEED)
            clone(agent, join(rounds), setting, seed=DAGGER_SEED)
        return DemonstrationTask(
            scenarios=world.scenarios,
            runner=world.setting.runner,
            teacher=setting.teacher,
            agent=agent,
            seed=(DAGGER_SEED, len(rounds)),
        )

    for number in range(setting.rounds):
        name = f"demonstrations-{config.conditions.seen}-{digest[:8]}-round{number}"
        rounds.append(collect(task, batches, config.directory / name, workers=config.workers, report=report))
    return join(rounds)


def _imitate(
    runs: Sequence[StageRun], world: TrainingWorld, demonstrations: Demonstrations, workers: int, report: Report
) -> None:
    """Clone agents for several seeds, each in its own process."""
    if len(runs) == 1 or workers == 1:
        for done, run in enumerate(runs, 1):
            run.imitate(world, demonstrations)
            report(run.stage, done, len(runs))
        return
    sent = payload((runs[0].config, demonstrations), "the recogniser or the sensor")
    with worker_pool(min(workers, len(runs)), _start_imitating, sent=(sent,)) as pool:
        futures = [pool.submit(call, payload((_imitate_here, run), run.title)) for run in runs]
        for done, future in enumerate(as_completed(futures), 1):
            future.result()
            report(runs[0].stage, done, len(runs))


_imitated: tuple[TrainingWorld, Demonstrations]


def _start_imitating(sent: bytes) -> None:
    """Receive the world and the demonstrations, once in each process."""
    global _imitated
    config, demonstrations = cloudpickle.loads(sent)
    _imitated = TrainingWorld.load(config), demonstrations


def _imitate_here(run: StageRun) -> None:
    """Clone the agent of one seed in this process."""
    run.imitate(*_imitated)


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
            waiting = wait(waiting, timeout=0.5).not_done
            _pass_on(heard, report, note)
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
