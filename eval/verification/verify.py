"""Verifies a run: its episodes and figures against its configuration, and the hashes of its data and weights."""

import json
from collections.abc import Mapping
from itertools import zip_longest
from pathlib import Path
from typing import Any

from ehar.data.motion_data import MotionData
from ehar.data.scenario import part_of
from ehar.data.streams.data import StreamData
from ehar.errors import DataError, EharError, UsageError
from eval.records.config import RunConfig, installed_versions, read_config
from eval.records.episode_lines import read_episodes
from eval.records.episodes import EpisodeRecords
from eval.records.run_files import EPISODES, SUMMARY, TABLE
from eval.render.tables import markdown
from eval.running.accuracy_kept import read_ideal_run
from eval.running.episodes import Episodes, cut_scenarios, random_starts
from eval.running.progress import ConsoleReporter, Reporter
from eval.running.run import Run, why_incomplete
from eval.verification.checks import FAILED, OK, UNCHECKED, Check, Verification
from eval.verification.figures import UNRECORDED, count_figures, mismatch, recompute
from eval.verification.inputs import check_inputs
from eval.verification.records import contradiction
from eval.verification.said import check_named, check_privileged, check_warnings
from eval.verification.steps import check_steps


def verify(
    run: str | Path,
    *,
    data: str | Path | None = None,
    models: str | Path | None = None,
    ideal: str | Path | None = None,
    rerun_episodes: int = 0,
    seed: int = 0,
    reporter: Reporter | None = None,
) -> Verification:
    """Check a run of `ehar benchmark` against itself, and against its data and weights if these are here.

    Args:
        run: folder of a finished run.
        data: present place of the run's data; None takes the recorded place.
        models: present place of its weights; None takes the recorded place.
        ideal: present folder of the run that flights were compared with; None takes the recorded folder.
        rerun_episodes: number of episodes to draw and run again, each with its chunk of 32.
        seed: seed of the draw of these episodes.
        reporter: receives progress; None reports on standard error.

    Raises:
        UsageError: the folder holds no run, a run of folds or trainings, or a run of another schema; or a place that
            was given does not exist.
        DataError: a file cannot be read.
        ModelError: weights that were asked for cannot be read.
        EpisodeError: a planner that was run once more broke its contract.
    """
    reporter = reporter or ConsoleReporter()
    for name, value in (("rerun_episodes", rerun_episodes), ("seed", seed)):
        if value < 0:
            raise UsageError(f"{name}: expected at least 0, got {value}")
    directory = Path(run)
    config = read_config(directory)
    if config.made_of:
        raise UsageError(
            f"{directory}: expected a run of its own, this one is {config.parts}: verify {', '.join(config.made_of)}"
        )
    notes = other_versions(config.versions)
    try:
        records = read_episodes(directory / EPISODES)
    except DataError as error:
        if not (directory / EPISODES).is_file():
            raise
        return Verification((Check("records", FAILED, str(error)),), notes)
    reason = why_incomplete(directory, config, {name: len(held) for name, held in records.items()})
    if reason is not None:
        return Verification((Check("complete", FAILED, f"{directory}: this run is incomplete: {reason}"),), notes)
    inputs = check_inputs(config, data, models, run_own_code=rerun_episodes > 0)
    episodes = None if inputs.data is None else run_episodes(config, inputs.data)
    count = len(next(iter(records.values())))
    of_records = _check_records(config, records, episodes)
    held = of_records.result == OK  # the others need records that do not contradict themselves
    checks = [
        Check("complete", OK, f"schema {config.schema}: {len(records)} planners, {count} episodes of each"),
        of_records,
        check_privileged(config),
        check_named(config),
        *([check_steps(config, records, None if inputs.data is None else inputs.data.fps)] if held else []),
        *([_check_figures(directory, config, records, ideal)] if held else []),
        *inputs.checks,
    ]
    warnings = check_warnings(config, inputs)
    if warnings is not None:
        checks.append(warnings)
    if rerun_episodes:
        from eval.verification.rerun import check_replay  # imported here: it brings everything that runs episodes

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
    if all(check.result == OK for check in checks if check.name in ("records", "figures")):
        checks.append(_check_table(directory, config, records))
    return Verification(tuple(checks), notes)


def other_versions(recorded: Mapping[str, str]) -> tuple[str, ...]:
    """Return a line that lists the versions that differ from those of a run; nothing if none differs."""
    installed = installed_versions()
    other = [
        f"{name} {recorded.get(name, 'none')}, here {installed.get(name, 'none')}"
        for name in {**recorded, **installed}
        if recorded.get(name) != installed.get(name)
    ]
    return (f"warning: versions are not those of the run: {'; '.join(other)}",) if other else ()


def run_episodes(config: RunConfig, data: MotionData | StreamData) -> Episodes:
    """Return the episodes of a run, made again from its data.

    Raises:
        UsageError: the part is unknown.
        DataError: the data have no such episodes.
    """
    # No note about sequences that are too short: the benchmark has reported them.
    told = config.conditions
    scenarios = cut_scenarios(data, part_of(data, told.part), told.frames, note=lambda _: None)
    return random_starts(scenarios, told.starts, told.seed, config.world)


def _check_records(config: RunConfig, records: Mapping[str, EpisodeRecords], episodes: Episodes | None) -> Check:
    difference = contradiction(config, records, episodes)
    if difference is not None:
        return Check("records", FAILED, difference)
    made = "the same for all planners, their data not at hand" if episodes is None else "those of the data"
    return Check("records", OK, f"episodes are {made}, each once; frames do not contradict each other")


def _check_figures(
    directory: Path, config: RunConfig, records: Mapping[str, EpisodeRecords], ideal: str | Path | None
) -> Check:
    """Return the check of summary.json against the records."""
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


def _check_table(directory: Path, config: RunConfig, records: Mapping[str, EpisodeRecords]) -> Check:
    """Return the check of table.md against the table that summary.json and the records give."""
    try:
        held = (directory / TABLE).read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        return Check("table", UNCHECKED, f"{TABLE} is not there")
    except (OSError, ValueError) as error:
        return Check("table", FAILED, f"{TABLE}: expected text, got {error}")
    expected = markdown(*Run(config, records, directory=directory).tables()).splitlines()
    if held == expected:
        return Check("table", OK, f"{TABLE} says what {SUMMARY} and the records say")
    if config.versions.get("ehar") != installed_versions().get("ehar"):
        return Check("table", UNCHECKED, f"another version of ehar wrote {TABLE}, and writes it otherwise")
    line, (got, wanted) = next(
        (number, pair) for number, pair in enumerate(zip_longest(held, expected), 1) if pair[0] != pair[1]
    )
    return Check("table", FAILED, f"{TABLE}: line {line}: got {got!r}, expected {wanted!r}")


def _read_ideal(config: RunConfig, ideal: str | Path | None) -> Mapping[str, EpisodeRecords] | None:
    """Return the records that flights were compared with; None if there was no comparison."""
    if ideal is not None:
        return read_ideal_run(Path(ideal), config)
    try:
        return None if config.ideal is None else read_ideal_run(Path(config.ideal), config)
    except EharError as error:
        raise UsageError(f"{error}; --ideal says where the run lies now that flights were compared with") from error


def _compared_with_ideal(held: Any) -> bool:
    """Return whether a summary compares flights with the ideal track."""
    planners = held.get("planners") if isinstance(held, dict) else None
    listed = planners if isinstance(planners, list) else []
    return any(isinstance(planner, dict) and planner.get("accuracy_kept") is not None for planner in listed)
