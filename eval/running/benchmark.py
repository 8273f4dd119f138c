"""The benchmark: planners on the same episodes, with the same recogniser, sensor and seeds."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from ehar.conditions import Conditions
from ehar.errors import UsageError
from ehar.flight.vehicle import Vehicle
from ehar.planner import Planner
from ehar.processes import check_workers
from eval.records.config import RunConfig, planner_config, run_config
from eval.records.episode_lines import stored_episodes
from eval.records.episodes import EpisodeRecords
from eval.records.one_by_one import OneByOne
from eval.records.run_files import EPISODES, check_out
from eval.running.accuracy_kept import read_ideal_run
from eval.running.choice import READOUTS, ModelPlace, choose_planners, listed
from eval.running.cluster import EngineName, engine_of
from eval.running.episodes import CHUNKS_ON_DEVICE, check_scored, cut_scenarios, random_starts
from eval.running.jobs import FinishedJobs, PlannerRun, Workload, jobs_of, run_planners
from eval.running.progress import ConsoleReporter, Reporter
from eval.running.run import Run
from eval.running.unfinished import UnfinishedRun
from eval.scores.summarise import summarise
from eval.scores.summary import Summary
from recognition.setting import load_setting


def benchmark(
    planners: str | Planner | Sequence[str | Planner] | None = None,
    conditions: Conditions | None = None,
    *,
    readout: str = "recogniser",
    ideal: str | Path | None = None,
    out: str | Path | None = None,
    workers: int = 1,
    engine: EngineName = "processes",
    address: str | None = None,
    device: str = "cpu",
    reporter: Reporter | None = None,
) -> Run:
    """Run planners on test episodes, and say how well each did.

    For example:
        ehar benchmark --data duo
        ehar benchmark --data mine.npz --models models/mine --out runs/mine
        ehar benchmark ./spiral.py:Spiral no-act oracle

    Args:
        planners: names, or your own: file.py:Class or module:Class, then --argument value; from Python, objects too.
        conditions: conditions of the run; None means the usual ones.
        readout: source of the scored probabilities: recogniser or belief.
        ideal: finished run on the ideal track to compare flights with.
        out: folder for records, tables and the accuracy curve. Each job is kept there when it is done. If the run is
            stopped, even by kill -9, the same call goes on from there, and ends in the same bytes. A run of objects in
            place of names begins anew, as nobody can tell whether they are the same.
        workers: processes; numbers do not depend on it.
        engine: processes of this machine, or ray: those of a cluster. Numbers do not depend on it either.
        address: address of a running Ray cluster, or auto; None starts one here.
        device: device of our recogniser: cpu or cuda; a GPU takes 512 episodes at once, and rounds otherwise.
        reporter: is told of progress; None reports on standard error.

    Returns:
        the run: its `summary`, `records`, `to_dataframe()` and `save(folder)`.

    Raises:
        EharError: one line that says what was got and what was expected.
        KeyboardInterrupt: Ctrl-C, or SIGTERM on the command line; finished jobs are in `out`.
    """
    conditions, reporter = conditions or Conditions(), reporter or ConsoleReporter()
    if readout not in READOUTS:
        raise UsageError(f"unknown readout {readout!r}; expected {' or '.join(READOUTS)}")
    check_workers(workers)
    machines = engine_of(engine, address, workers)
    specs, directory = listed(planners), None if out is None else Path(out)
    setting = load_setting(conditions, device=device)
    conditions = setting.conditions
    scenarios = cut_scenarios(setting.recordings, setting.sequences, conditions.frames, reporter.note)
    check_scored(scenarios)
    setting.runner.check_followed(scenarios)
    choice = choose_planners(specs, ModelPlace.of(setting), readout=readout, note=reporter.note)
    chosen, origins, model = choice
    config = run_config(
        setting,
        [planner_config(planner, origins.get(planner.name)) for planner in chosen],
        readout=readout,
        gain_model_sha256=None if model is None else model.sha256,
        ideal=None if ideal is None else Path(ideal),
        lengths=choice.lengths,
        localisations=choice.localisations,
    )
    for warning in config.warnings:
        reporter.note(f"warning: {warning}")
    if directory is not None:
        check_out(directory, config.to_json())
    on_ideal = None if ideal is None else read_ideal_run(Path(ideal), config)
    belief = model.belief if model is not None and readout == "belief" else None
    episodes = random_starts(scenarios, conditions.starts, conditions.seed, setting.world)
    workload = Workload(setting.runner, episodes, belief, 1 if device == "cpu" else CHUNKS_ON_DEVICE)

    def measured(finished: FinishedJobs | None) -> Run:
        runs = run_planners(workload, chosen, engine=machines, reporter=reporter, finished=finished)
        summary = summarise_runs(runs, config, on_ideal)
        return Run(config, _records_of(runs), setting.recordings.class_names, summary, directory)

    if directory is None:
        return measured(None)
    unfinished, jobs = UnfinishedRun(directory, config), jobs_of(len(chosen), workload)
    with unfinished.opened(jobs, anew=not _are_named(specs, conditions), note=reporter.note):
        run = measured(unfinished)
        unfinished.finish(run, jobs)
    return replace(run, records=stored_episodes(directory / EPISODES))


def summarise_runs(
    runs: Mapping[str, PlannerRun], config: RunConfig, on_ideal: Mapping[str, EpisodeRecords] | None
) -> Summary:
    """Return the summary of planners' runs; flights are compared with the records on the ideal track."""
    names = list(runs)
    return summarise(
        _records_of(runs),
        config,
        privileged={planner.name: planner.privileged for planner in config.planners},
        step_ms=OneByOne(names, lambda name: runs[name].step_ms),
        solves=OneByOne(names, lambda name: runs[name].solves),
        on_ideal=on_ideal,
    )


def _records_of(runs: Mapping[str, PlannerRun]) -> Mapping[str, EpisodeRecords]:
    """Return the records of planners, which stay where they are until they are asked for."""
    return OneByOne(list(runs), lambda name: runs[name].records)


def _are_named(specs: Sequence[str | Planner] | None, conditions: Conditions) -> bool:
    """Return whether names and hashes tell what runs; nobody can tell whether an object is the one of before."""
    told = (*(specs or ()), conditions.recogniser, conditions.sensor, conditions.track)
    return all(isinstance(one, str | Path | Vehicle | None) for one in told)
