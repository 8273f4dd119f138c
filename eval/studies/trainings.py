"""Runs of several trainings taken together as one run: the same episodes and conditions, other weights."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ehar.arrays import FloatArray
from ehar.errors import UsageError
from eval.records.config import RunConfig, joined_config, read_config
from eval.records.episode_lines import read_episodes
from eval.records.episodes import EpisodeRecords
from eval.records.run_files import BELIEF_JSON, EPISODES, check_out
from eval.render.tables import NONE, PRIVILEGED, Table, html, interval_text, p_text, text
from eval.running.run import Run, class_names, read_run
from eval.scores.differences import NBV, Difference, compare_pairs
from eval.scores.metrics import gap_closed
from eval.scores.planner_accuracy import draw_resamples, planner_accuracy
from eval.scores.planner_summary import NO_ACT, ORACLE, PlannerSummary
from eval.scores.resampling.training_seeds import group_planners, shared_record_name, split_record_name
from eval.scores.summarise import summarise
from eval.scores.summary_table import TOGETHER, basis_lines
from eval.studies.belief.stream_report import StreamBeliefReport, read_report, write_report
from eval.studies.same_episodes import SAME_CONDITIONS, check_same_episodes, check_same_planners, versions_note

LEAST = 3  # trainings behind a claim


@dataclass(frozen=True, repr=False)
class Trainings:
    """Several trainings of recogniser and gain field; it prints as a table, in a notebook as HTML.

    Args:
        run: the run that they make together: planners of each training are `nbv@0`, `nbv@1`, ...
        planner: the planner that is compared with the others.
        differences: how much more accurate it is than each other one without the truth, corrected together.
        acc: the accuracy of each planner in each training, (T,) [%].
        versions: the line that names versions that differ between the runs; None if all are the same.
    """

    run: Run
    planner: str
    differences: tuple[Difference, ...]
    acc: Mapping[str, FloatArray]
    versions: str | None = None

    @property
    def count(self) -> int:
        """T, the number of trainings."""
        return len(self.run.config.trainings)

    def tables(self) -> list[Table]:
        """Return the table of the trainings; of streams, also how soon activities are recognised."""
        own = [trainings_table(self)]
        return [*own, self.run.tables()[-1]] if self.run.of_streams else own

    def __repr__(self) -> str:
        """Return one line: the runs, and the number of planners."""
        return f"Trainings({', '.join(self.run.config.trainings)}: {len(self.run.summary.planners)} planners)"

    def __str__(self) -> str:
        """Return the table."""
        return text(*self.tables())

    def _repr_html_(self) -> str:
        """Return the table for a notebook."""
        return "".join(map(html, self.tables()))


def trainings(
    runs: Sequence[str | Path], *, planner: str = NBV, out: str | Path | None = None
) -> Trainings | StreamBeliefReport:
    """Take runs of several trainings together: means, intervals that cover trainings, and the spread over them.

    Args:
        runs: folders of finished runs, one for each training of recogniser and gain field; or of what `ehar study
            belief` wrote of streams.
        planner: the planner that is compared with each other one.
        out: folder for the run that they make together, which `ehar compare`, `study decide`, `overview` and `report`
            take as any other.

    Raises:
        UsageError: a folder holds no run; the runs have other episodes or conditions, the same weights, or another
            file or other arguments of a planner; or the planner did not run in all of them.
        DataError: files cannot be read, or their episodes are not those of config.json.
    """
    if len(runs) < 2:
        raise UsageError(f"trainings: expected at least 2 folders of runs, got {len(runs)}")
    if all((Path(folder) / BELIEF_JSON).is_file() for folder in runs):
        return _beliefs([Path(folder) for folder in runs], out)
    read = [read_run(folder) for folder in runs]
    _check(read)
    _check_planner(read, planner)
    names = [name for name in read[0].records if all(name in run.records for run in read)]
    together = _together(read, names)
    acc = {
        group.name: np.array([100 * together.scored[record].correct.mean() for record in group.records])
        for group in group_planners(together.scored)
    }
    found = Trainings(together, planner, _differences(together, planner), acc, versions_note(read))
    if out is not None:
        found.run.save(out, tables=found.tables())
    return found


def _beliefs(folders: Sequence[Path], out: str | Path | None) -> StreamBeliefReport:
    """Return the report of what beliefs and recognisers of several trainings said; `out` is a folder to write to."""
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
    check_same_planners(runs)


def _check_planner(runs: Sequence[Run], planner: str) -> None:
    """Raise a UsageError unless a planner without the truth ran in all runs."""
    in_all = [one for one in runs[0].config.planners if all(one.name in run.records for run in runs)]
    able = [one.name for one in in_all if not one.privileged]
    if planner not in able:
        raise UsageError(
            f"no planner {planner!r} without the truth in all {len(runs)} runs; expected one of: {', '.join(able)}"
        )


def _records(runs: Sequence[Run], names: Sequence[str]) -> dict[str, EpisodeRecords]:
    """Return the records of some planners in all trainings, planner by planner."""
    return {
        shared_record_name(name, training): run.records[name] for name in names for training, run in enumerate(runs)
    }


def _config(runs: Sequence[Run], names: Sequence[str]) -> RunConfig:
    """Return the configuration of all trainings."""
    configs = [run.config for run in runs]
    planners = [{planner.name: planner for planner in config.planners} for config in configs]
    return joined_config(
        configs,
        data=f"{configs[0].data}, {len(runs)} trainings",
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


def _differences(run: Run, planner: str) -> tuple[Difference, ...]:
    """Return how much more accurate a planner is than each other one without the truth, over all trainings."""
    able = [one.name for one in run.summary.planners if not one.privileged]
    groups = {group.name: group for group in group_planners(run.scored)}
    resamples = draw_resamples(list(run.scored.values()), groups.values())
    held = {name: planner_accuracy(groups[name], run.scored, resamples) for name in able}
    return compare_pairs([(held[planner], held[name]) for name in able if name != planner], resamples)


def trainings_table(found: Trainings) -> Table:
    """Return a row for each planner: accuracy, gap closed and the difference to the compared planner."""
    summary, planner = found.run.summary, found.planner
    differences = {difference.other: difference for difference in found.differences}
    basis = basis_lines(summary.basis, summary.no_intervals)
    few = f"Only {found.count} trainings: a claim takes at least {LEAST}." if found.count < LEAST else ""
    column = 3
    return Table(
        title=summary.title,
        header=("planner", "mean acc [95 %]", "gap closed % [95 %]", f"{planner} minus it [95 %]", "p"),
        rows=tuple(_row(found, one, differences.get(one.name)) for one in summary.planners),
        footnotes=(*basis.footnotes, *_footnotes(found)),
        bold=frozenset(
            (row, column)
            for row, one in enumerate(summary.planners)
            if one.name in differences and differences[one.name].is_clear
        ),
        notice=" ".join(filter(None, (basis.notice, few))),
    )


def _row(found: Trainings, planner: PlannerSummary, difference: Difference | None) -> tuple[str, ...]:
    """Return the cells of a planner; behind ± stands the deviation over what each training gives by itself."""
    alone, gap = found.acc[planner.name], NONE
    gaps = gap_closed(alone, found.acc[NO_ACT], found.acc[ORACLE]) if {NO_ACT, ORACLE} <= found.acc.keys() else None
    if planner.gap_closed is not None and gaps is not None and np.isfinite(gaps).all():
        ends = planner.gap_closed_ci95
        scaled = None if ends is None else (100 * ends[0], 100 * ends[1])
        gap = f"{100 * planner.gap_closed:.1f} ± {_spread(100 * gaps):.1f} {interval_text(scaled)}"
    to_it = found.acc[found.planner] - alone
    return (
        planner.name + PRIVILEGED * planner.privileged,
        f"{planner.acc_mean:.1f} ± {_spread(alone):.1f} {interval_text(planner.acc_mean_ci95)}",
        gap,
        ""
        if difference is None
        else f"{difference.acc_mean:+.1f} ± {_spread(to_it):.1f} {interval_text(difference.ci95_corrected)}",
        "" if difference is None else p_text(difference.p_corrected),
    )


def _spread(values: FloatArray) -> float:
    return float(np.std(values, ddof=1))


def _footnotes(found: Trainings) -> Iterator[str]:
    """Yield what the numbers are."""
    yield (
        f"Numbers are means over {found.count} trainings, gap closed is that of mean accuracies, and behind ± stands "
        "the standard deviation over trainings. Intervals draw people, sequences and trainings."
    )
    yield f"Bold: the interval excludes zero. {TOGETHER} So is p, the chance of such a difference if there is none."
    if any(planner.privileged for planner in found.run.summary.planners):
        yield f"{PRIVILEGED} privileged: is handed the label and the future."
    if found.versions is not None:
        yield found.versions
