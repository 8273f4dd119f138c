"""Runs of several trainings taken together as one run: the same episodes and conditions, other weights."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ehar.errors import UsageError
from ehar.files import write_text
from eval.records.config import RunConfig, hashed_together, read_config
from eval.records.episode_lines import read_episodes
from eval.records.episodes import EpisodeRecords
from eval.records.run_files import BELIEF_JSON, EPISODES, check_out
from eval.render.tables import NONE, PRIVILEGED, Table, html, interval_text, markdown, p_text, text
from eval.running.run import Run, class_names, read_run
from eval.scores.differences import NBV
from eval.scores.resampling.training_seeds import shared_record_name, split_record_name
from eval.scores.summarise import summarise
from eval.scores.summary_table import TOGETHER, basis_lines
from eval.scores.trainings import TrainedDifference, TrainedPlanner, TrainingsSummary, summarise_trainings
from eval.studies.same_episodes import SAME_CONDITIONS, check_same_episodes

if TYPE_CHECKING:
    from eval.studies.belief.stream_report import StreamBeliefReport

LEAST = 3  # trainings behind a claim


@dataclass(frozen=True, repr=False)
class Trainings:
    """Several trainings of recogniser and gain field; it prints as a table, in a notebook as HTML.

    Args:
        run: the run that they make together: planners of each training are `nbv@0`, `nbv@1`, ...
        planner: the planner that is compared with the others.
        summary: the results.
    """

    run: Run
    planner: str
    summary: TrainingsSummary

    def tables(self) -> list[Table]:
        """Return the table of the trainings; of streams, also how soon activities are recognised."""
        own = [trainings_table(self)]
        return [*own, self.run.tables()[-1]] if self.run.of_streams else own

    def __repr__(self) -> str:
        """Return one line: the runs, and the number of planners."""
        return f"Trainings({', '.join(self.run.config.trainings)}: {len(self.summary.planners)} planners)"

    def __str__(self) -> str:
        """Return the table."""
        return text(*self.tables())

    def _repr_html_(self) -> str:
        """Return the table for a notebook."""
        return "".join(map(html, self.tables()))


def trainings(
    runs: Sequence[str | Path], *, planner: str = NBV, out: str | Path | None = None
) -> "Trainings | StreamBeliefReport":
    """Take runs of several trainings together: means, intervals that cover trainings, and the spread over them.

    Args:
        runs: folders of finished runs, one for each training of recogniser and gain field; or of what `ehar study
            belief` wrote of streams.
        planner: the planner that is compared with each other one.
        out: folder for the run that they make together, which `ehar compare`, `study decide`, `overview` and `report`
            take as any other.

    Raises:
        UsageError: a folder holds no run; the runs have other episodes or conditions, or the same weights; or the
            planner did not run in all of them.
        DataError: files cannot be read, or their episodes are not those of config.json.
    """
    if len(runs) < 2:
        raise UsageError(f"trainings: expected at least 2 folders of runs, got {len(runs)}")
    if all((Path(folder) / BELIEF_JSON).is_file() for folder in runs):
        return _beliefs([Path(folder) for folder in runs], out)
    read = [read_run(folder) for folder in runs]
    _check(read)
    privileged = {planner.name: planner.privileged for run in read for planner in run.summary.planners}
    summary = summarise_trainings([run.scored for run in read], privileged, planner)
    names = [name for name in read[0].records if all(name in run.records for run in read)]
    found = Trainings(_together(read, names), planner, summary)
    if out is not None:
        folder = found.run.save(out)
        write_text(folder / "table.md", [markdown(*found.tables())])
    return found


def _beliefs(folders: Sequence[Path], out: str | Path | None) -> "StreamBeliefReport":
    """Return the report of what beliefs and recognisers of several trainings said; `out` is a folder to write to."""
    from eval.studies.belief.stream_report import read_report, write_report

    each = [Run(read_config(folder), read_episodes(folder / EPISODES), directory=folder) for folder in folders]
    _check(each)
    config, fps = _config(each, [planner.name for planner in each[0].config.planners]), each[0].conditions.fps
    assert fps is not None
    report = read_report(config, _records(each, list(each[0].records)), fps)
    if out is not None:
        check_out(Path(out), config.to_json())
        write_report(Path(out), report)
    return report


def _check(runs: Sequence[Run]) -> None:
    """Raise a UsageError unless the runs are those of several trainings."""
    for row, run in enumerate(runs):
        if run.config.made_of:
            raise UsageError(f"{run.directory}: expected the run of one training, this one is of {run.config.parts}")
        for before in runs[:row]:
            check_same_episodes(before, run, also=(*SAME_CONDITIONS, "onset"))
            if before.config.recogniser_sha256 == run.config.recogniser_sha256:
                raise UsageError(
                    f"{before.directory} and {run.directory}: expected other trainings of the recogniser, got the same"
                )


def _records(runs: Sequence[Run], names: Sequence[str]) -> dict[str, EpisodeRecords]:
    """Return the records of some planners in all trainings, planner by planner."""
    return {
        shared_record_name(name, training): run.records[name] for name in names for training, run in enumerate(runs)
    }


def _config(runs: Sequence[Run], names: Sequence[str]) -> RunConfig:
    """Return the configuration of all trainings: the first one's, but for what each training has of its own."""
    configs = [run.config for run in runs]
    planners = [{planner.name: planner for planner in config.planners} for config in configs]
    return replace(
        configs[0],
        data=f"{configs[0].data}, {len(runs)} trainings",
        recogniser_sha256=hashed_together([config.recogniser_sha256 for config in configs]) or "",
        gain_model_sha256=hashed_together([config.gain_model_sha256 for config in configs]),
        planners=tuple(
            replace(trained[name], name=shared_record_name(name, training))
            for name in names
            for training, trained in enumerate(planners)
        ),
        ideal=None,
        trainings=tuple(str(run.folder) for run in runs),
    )


def _together(runs: Sequence[Run], names: Sequence[str]) -> Run:
    """Return the run that several trainings make together, with the planners that ran in all of them."""
    config, records = _config(runs, names), _records(runs, names)
    told = {
        shared_record_name(name, training): run.summary.planner(split_record_name(name)[0])
        for name in names
        for training, run in enumerate(runs)
    }
    summary = summarise(
        records,
        config,
        privileged={planner.name: planner.privileged for planner in config.planners},
        step_ms={name: planner.step_ms for name, planner in told.items()},
        solves={name: planner.solves for name, planner in told.items()},
    )
    return Run(config, records, class_names(runs[0], lambda _: None), made=summary)


def trainings_table(found: Trainings) -> Table:
    """Return a row for each planner: accuracy, gap closed and the difference to the compared planner."""
    summary, planner = found.summary, found.planner
    differences = {of.difference.other: of for of in summary.differences}
    basis = basis_lines(summary.basis, summary.no_intervals)
    few = f"Only {summary.trainings} trainings: a claim takes at least {LEAST}." if summary.trainings < LEAST else ""
    column = 3
    return Table(
        title=found.run.summary.title,
        header=("planner", "mean acc [95 %]", "gap closed % [95 %]", f"{planner} minus it [95 %]", "p"),
        rows=tuple(_row(one, differences.get(one.name)) for one in summary.planners),
        footnotes=(*basis.footnotes, *_footnotes(summary)),
        bold=frozenset(
            (row, column)
            for row, one in enumerate(summary.planners)
            if one.name in differences and differences[one.name].difference.is_clear
        ),
        notice=" ".join(filter(None, (basis.notice, few))),
    )


def _row(planner: TrainedPlanner, of: TrainedDifference | None) -> tuple[str, ...]:
    """Return the cells of a planner."""
    gap = NONE
    if planner.gap_closed is not None and planner.gap_closed_sd is not None:
        ends = planner.gap_closed_ci95
        scaled = None if ends is None else (100 * ends[0], 100 * ends[1])
        gap = f"{100 * planner.gap_closed:.1f} ± {100 * planner.gap_closed_sd:.1f} {interval_text(scaled)}"
    return (
        planner.name + PRIVILEGED * planner.privileged,
        f"{planner.acc_mean:.1f} ± {planner.acc_mean_sd:.1f} {interval_text(planner.acc_mean_ci95)}",
        gap,
        ""
        if of is None
        else f"{of.difference.acc_mean:+.1f} ± {of.sd:.1f} {interval_text(of.difference.ci95_corrected)}",
        "" if of is None else p_text(of.difference.p_corrected),
    )


def _footnotes(summary: TrainingsSummary) -> Iterator[str]:
    """Yield what the numbers are."""
    yield (
        f"Numbers are means over {summary.trainings} trainings, behind ± stands the standard deviation over them. "
        "Intervals draw people, sequences and trainings."
    )
    yield f"Bold: the interval excludes zero. {TOGETHER} So is p, the chance of such a difference if there is none."
    if any(planner.privileged for planner in summary.planners):
        yield f"{PRIVILEGED} privileged: is handed the label and the future."
