"""Whether a run's folder holds what its configuration makes: episodes, figures, data and weights."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ehar.data.motion_data import MotionData
from ehar.data.scenario import part_of
from ehar.errors import DataError, EharError, UsageError
from eval.records.config import RunConfig, installed_versions, read_config
from eval.records.episodes import EpisodeRecords, read_episodes
from eval.records.run_files import EPISODES, SUMMARY
from eval.running.accuracy_kept import read_ideal_run
from eval.running.episodes import Episodes, cut_scenarios, random_starts
from eval.running.progress import ConsoleReporter, Reporter
from eval.running.run import why_incomplete
from eval.verification.checks import FAILED, OK, UNCHECKED, Check, Verification
from eval.verification.figures import UNRECORDED, count_figures, mismatch, recompute
from eval.verification.inputs import check_inputs
from eval.verification.records import contradiction


def verify(
    directory: Path,
    *,
    data: str | Path | None = None,
    models: Path | None = None,
    ideal: Path | None = None,
    rerun_episodes: int = 0,
    seed: int = 0,
    reporter: Reporter | None = None,
) -> Verification:
    """Check a run of `ehar benchmark` against itself, and against its data and weights where these are at hand.

    Args:
        directory: of the run.
        data: where its data lie now; None is where they lay.
        models: where its weights lie now; None is where they lay.
        ideal: where the run lies now that flights were compared with; None is where it lay.
        rerun_episodes: how many episodes are drawn and run once more, with all that share a chunk with them. The files
            and modules of one's own that the run names are run for that: only for a run that can be trusted.
        seed: of that draw.
        reporter: hears of progress; None reports on standard error.

    Raises:
        UsageError: the folder holds no run, or one of another schema; or what was asked for is not there.
        DataError: a file cannot be read.
        ModelError: weights that were asked for cannot be read.
    """
    reporter = reporter or ConsoleReporter()
    for name, value in (("rerun_episodes", rerun_episodes), ("seed", seed)):
        if value < 0:
            raise UsageError(f"{name}: expected at least 0, got {value}")
    directory = Path(directory)
    config = read_config(directory)
    notes = other_versions(config.versions)
    try:
        records = read_episodes(directory / EPISODES)
    except DataError as error:
        if not (directory / EPISODES).is_file():
            raise
        return Verification((Check("records", FAILED, str(error)),), notes)
    reason = why_incomplete(directory, config, records)
    if reason is not None:
        return Verification((Check("complete", FAILED, f"{directory}: this run is incomplete: {reason}"),), notes)
    inputs = check_inputs(config, data, models, run_own_code=rerun_episodes > 0)
    episodes = None if inputs.data is None else run_episodes(config, inputs.data)
    count = len(next(iter(records.values())))
    of_records = _check_records(config, records, episodes)
    checks = [
        Check("complete", OK, f"schema {config.schema}: {len(records)} planners, {count} episodes of each"),
        of_records,
        *([_check_figures(directory, config, records, ideal)] if of_records.result == OK else []),
        *inputs.checks,
    ]
    if rerun_episodes:
        from eval.verification.rerun import check_replay  # brings what running episodes needs

        failed = next((check for check in checks if check.result == FAILED), None)
        if failed is not None:
            checks.append(Check("replay", UNCHECKED, f"not with {failed.name} that failed"))
        elif episodes is None or inputs.setting is None or inputs.place is None:
            reason = next(check.what for check in inputs.checks if check.result == UNCHECKED)
            raise UsageError(f"{directory}: no episode can be run once more: {reason}")
        else:
            checks += check_replay(
                config,
                records,
                episodes,
                inputs.setting,
                inputs.place,
                count=rerun_episodes,
                seed=seed,
                reporter=reporter,
            )
    return Verification(tuple(checks), notes)


def other_versions(recorded: Mapping[str, str]) -> tuple[str, ...]:
    """Return a line that lists where the installed versions are not those of a run; nothing where all are."""
    installed = installed_versions()
    other = [
        f"{name} {recorded.get(name, 'none')}, here {installed.get(name, 'none')}"
        for name in {**recorded, **installed}
        if recorded.get(name) != installed.get(name)
    ]
    return (f"warning: versions are not those of the run: {'; '.join(other)}",) if other else ()


def run_episodes(config: RunConfig, data: MotionData) -> Episodes:
    """Return the episodes that a run has, made anew from its data.

    Raises:
        UsageError: the part is unknown.
        DataError: there are none in these data.
    """
    # What is too short was said when the benchmark ran.
    told = config.conditions
    scenarios = cut_scenarios(data, part_of(data, told.part), told.length, note=lambda _: None)
    return random_starts(scenarios, told.starts, told.seed)


def _check_records(config: RunConfig, records: Mapping[str, EpisodeRecords], episodes: Episodes | None) -> Check:
    difference = contradiction(config, records, episodes)
    if difference is not None:
        return Check("records", FAILED, difference)
    made = "the same for all planners, their data not at hand" if episodes is None else "those of the data"
    return Check("records", OK, f"episodes are {made}, each once; frames do not contradict each other")


def _check_figures(
    directory: Path, config: RunConfig, records: Mapping[str, EpisodeRecords], ideal: Path | None
) -> Check:
    """Return how summary.json compares with what the records give."""
    path = directory / SUMMARY
    try:
        held = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        return Check("figures", FAILED, f"{SUMMARY}: expected JSON, got {error}")
    of_ideal = _read_ideal(config, ideal)
    if of_ideal is None and _compared_with_ideal(held):
        raise UsageError(f"{path}: compares flights with a run on the ideal track; expected its folder as --ideal")
    try:
        difference = mismatch(held, recompute(config, records, held, of_ideal))
    except DataError as error:
        difference = str(error)
    if difference is not None:
        return Check("figures", FAILED, difference)
    return Check("figures", OK, f"{count_figures(held)} of {SUMMARY}; {', '.join(UNRECORDED)} are not in the records")


def _read_ideal(config: RunConfig, ideal: Path | None) -> Mapping[str, EpisodeRecords] | None:
    """Return the records that flights were compared with; None where they were compared with none."""
    if ideal is not None:
        return read_ideal_run(Path(ideal), config)
    try:
        return None if config.ideal is None else read_ideal_run(Path(config.ideal), config)
    except EharError as error:
        raise UsageError(f"{error}; --ideal says where the run lies now that flights were compared with") from error


def _compared_with_ideal(held: Any) -> bool:
    """Return whether a summary says what flights kept."""
    planners = held.get("planners") if isinstance(held, dict) else None
    listed = planners if isinstance(planners, list) else []
    return any(isinstance(planner, dict) and planner.get("accuracy_kept") is not None for planner in listed)
