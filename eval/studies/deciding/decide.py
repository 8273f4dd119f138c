"""Deciding once: when each activity of a finished run is best answered, if waiting costs."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ehar.arrays import IntArray
from ehar.data.any_source import load_recordings
from ehar.errors import DataError, UsageError
from ehar.files import write_text
from eval.records.config import LATER
from eval.records.episodes import EpisodeRecords, join_records
from eval.records.run_files import TABLE, check_no_run
from eval.render.tables import markdown
from eval.running.run import Run, read_run
from eval.scores.deciding.curves import deciding_once, fit_across, fit_rules
from eval.scores.deciding.fit import seen_in
from eval.scores.differences import NBV
from eval.scores.planner_accuracy import draw_resamples
from eval.scores.planner_summary import NO_ACT, ORACLE
from eval.scores.resampling.training_seeds import group_planners
from eval.scores.streams.activities import activity_frames
from eval.studies.deciding.deciding import Deciding
from eval.studies.same_episodes import label, shown

DEFAULTS = (NO_ACT, NBV, ORACLE)  # as far as they ran
SAME_WORDS = (  # what decides what is said in a frame, beside part, starts and seed
    *("data_sha256", "recogniser_sha256", "sensor", "sensor_sha256", "views", "form", "readout", "track"),
    *("track_sha256", "length", "fps", "world", "onset"),
)


def decide(
    run: str | Path,
    *,
    fitted_on: str | Path | None = None,
    planners: Sequence[str] = (),
    data: str | Path | None = None,
    out: str | Path | None = None,
) -> Deciding:
    """Say when each activity of a finished run is best answered, if it is answered once and waiting costs.

    Args:
        run: folder of a finished run.
        fitted_on: folder of a run on another part of the same data, whose episodes the rules are fitted on. A run of
            folds needs none: the rules of each are fitted on the others, and so on people whom nobody has learned from.
        planners: planners to show; none takes no-act, nbv and oracle as far as they ran.
        data: path of the run's data; None takes the path in config.json.
        out: folder for table.md and the picture.

    Raises:
        UsageError: a folder holds no run, a planner did not run, or the runs are of the same part or of other
            conditions; or `out` holds a run.
        DataError: files cannot be read, or the data are not those of the run.
    """
    if out is not None:
        check_no_run(Path(out))
    scored = read_run(run)
    fitted = _fitted_on(scored, fitted_on)
    seconds = 1 / _frame_rate(scored, data)
    privileged = {planner.name: planner.privileged for planner in scored.summary.planners}
    chosen = tuple(planners) or tuple(name for name in DEFAULTS if name in privileged) or tuple(privileged)
    scored.check_planners(chosen)
    told = {planner.name for planner in fitted.summary.planners if planner.privileged}
    learners = tuple(group.name for group in group_planners(fitted.records) if group.name not in told)
    if not learners:
        raise UsageError(
            f"{fitted.folder}: expected a planner without the truth to fit rules on, got {', '.join(told)}"
        )
    names = _records_of(scored, chosen)
    records = {name: scored.records[name] for name in names}
    joined = join_records([fitted.episodes(name) for name in learners])
    second = all(held.second_probability is not None for held in (*records.values(), joined))
    fitting = seen_in(joined, seconds, second=second)
    across = fitted is scored
    rules = (
        fit_across(fitting, _folds(scored, joined), _folds(scored, records[names[0]])) if across else fit_rules(fitting)
    )
    tested = [name for name in chosen if name != NO_ACT and not privileged[name]] if NO_ACT in chosen else []
    found = Deciding(
        run=scored,
        fitted_on=None if across else fitted,
        fitted_with=learners,
        fitted_activities=len(fitting.label),
        planners={name: privileged[name] for name in chosen},
        found=deciding_once(
            {name: seen_in(held, seconds, second=second) for name, held in records.items()},
            rules,
            draw_resamples([scored.scored[name] for name in names], group_planners(names)),
            against=NO_ACT,
            tested=tested,
        ),
    )
    if out is not None:
        from eval.studies.deciding.figure import draw_deciding  # matplotlib takes a second to import

        draw_deciding(found, Path(out) / "deciding")
        write_text(Path(out) / TABLE, [markdown(*found.tables())])
    return found


def _fitted_on(scored: Run, fitted_on: str | Path | None) -> Run:
    """Return the run that rules are fitted on: the other one, or of folds the same."""
    if scored.config.folds:
        if fitted_on is not None:
            raise UsageError(
                f"{fitted_on}: expected no run to fit on, as each fold of {scored.directory} has the others"
            )
        return scored
    if fitted_on is None:
        raise UsageError(f"{scored.directory}: expected --fitted-on, a run on another part to fit the rules on")
    fitted = read_run(fitted_on)
    _check_other_part(scored, fitted)
    return fitted


def _folds(run: Run, records: EpisodeRecords) -> IntArray:
    """Return the fold of each activity in records of a run's folds, or of several planners one after another."""
    episodes = np.repeat(np.arange(len(run.config.folds)), [fold.episodes for fold in run.config.folds])
    fold: IntArray = np.tile(episodes, len(records) // len(episodes))
    return fold[activity_frames(records.label)[0]] if records.of_streams else fold


def _check_other_part(scored: Run, fitted: Run) -> None:
    """Raise a UsageError unless rules can be fitted on one run and scored on the other."""
    where = f"{scored.directory} and {fitted.directory}"
    in_scored, in_fitted = (LATER | run.config.to_json() for run in (scored, fitted))
    differing = [name for name in SAME_WORDS if in_scored[name] != in_fitted[name]]
    if differing:
        got = ", ".join(f"{label(name)} ({shown(name, in_scored)}, {shown(name, in_fitted)})" for name in differing)
        raise UsageError(f"{where}: expected runs on two parts of the same data; they differ in {got}")
    if in_scored["part"] == in_fitted["part"]:
        part = in_scored["part"]
        raise UsageError(
            f"{where}: expected rules to be fitted on another part than they are scored on, got {part} twice"
        )
    names = [set(next(iter(run.records.values())).sequence) for run in (scored, fitted)]
    if names[0] & names[1]:
        raise DataError(f"{where}: expected parts that share no sequence, got {min(names[0] & names[1])!r} in both")


def _frame_rate(run: Run, source: str | Path | None) -> float:
    """Return the frames per second of a run: what it was told, or else that of its data."""
    told = run.conditions
    if told.fps is not None:
        return told.fps
    place = told.data if source is None else source
    held = load_recordings(str(place))
    if held.sha256 not in run.config.data_hashes:
        raise DataError(f"{place}: expected the data of {run.folder}, got others")
    return held.fps


def _records_of(run: Run, planners: Sequence[str]) -> list[str]:
    """Return the record names of planners, in the order of the planners."""
    groups = {group.name: group.records for group in group_planners(run.records)}
    return [name for planner in planners for name in groups.get(planner, (planner,))]
