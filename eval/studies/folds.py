"""Runs of folds over people taken together as one run: every sequence is tested once, by the training of its fold."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ehar.data.recordings import SYNTHETIC
from ehar.data.scenario import TEST
from ehar.errors import UsageError
from eval.records.config import FoldConfig, PlannerConfig, RunConfig, hashed_together, joined_config, read_config
from eval.records.episode_lines import read_episodes
from eval.records.episodes import EpisodeRecords, join_records
from eval.records.run_files import BELIEF_JSON, EPISODES, check_out
from eval.records.solves import join_solves
from eval.render.tables import PRIVILEGED, Table, html, text
from eval.running.accuracy_kept import read_ideal_run
from eval.running.run import Run, class_names, read_run
from eval.scores.resampling.training_seeds import group_planners
from eval.scores.summarise import summarise
from eval.scores.summary import Summary
from eval.studies.belief.stream_report import StreamBeliefReport, read_report, write_report
from eval.studies.same_episodes import (
    SAME_CONDITIONS,
    SAME_EPISODES,
    check_same_config,
    check_same_planners,
    versions_note,
)

SAME = (*(key for key in SAME_EPISODES if key != "data_sha256"), *SAME_CONDITIONS, "onset")  # of config.json


@dataclass(frozen=True, repr=False)
class Folds:
    """Runs of folds, and what they are together; it prints as tables, in a notebook as HTML.

    Args:
        run: the run that they make together.
        each: the runs.
    """

    run: Run
    each: tuple[Run, ...]

    def tables(self) -> list[Table]:
        """Return the tables of the run, and accuracies fold by fold."""
        return [*self.run.tables(), fold_table(self)]

    def __repr__(self) -> str:
        """Return one line: the runs, and what they are together."""
        return f"Folds({', '.join(str(run.directory) for run in self.each)}: {self.run!r})"

    def __str__(self) -> str:
        """Return the tables."""
        return text(*self.tables())

    def _repr_html_(self) -> str:
        """Return the tables for a notebook."""
        return "".join(map(html, self.tables()))


def take_together(
    runs: Sequence[str | Path], *, ideal: str | Path | None = None, out: str | Path | None = None
) -> Folds | StreamBeliefReport:
    """Take the runs of several folds together: one run, in which everybody of all test parts is tested once.

    Args:
        runs: folders of finished runs on the test parts of folds, each with a recogniser of its own; or of what
            `ehar study belief` wrote of streams.
        ideal: folder of a run of the same folds on the ideal track, written by this function, to compare flights with.
        out: folder for the run, which `ehar compare`, `study overview` and `report` take as any other.

    Raises:
        UsageError: a folder holds no run; or the runs have other conditions or classes, no planner in common, or
            another file or other arguments of one; or not the test part, the same recogniser, or a sequence twice.
        DataError: files cannot be read.
    """
    if len(runs) < 2:
        raise UsageError(f"folds: expected at least 2 folders of runs, got {len(runs)}")
    if all((Path(folder) / BELIEF_JSON).is_file() for folder in runs):
        return _beliefs([Path(folder) for folder in runs], out)
    each = tuple(read_run(folder) for folder in runs)
    _check(each)
    names = tuple(name for name in each[0].records if all(name in run.records for run in each))
    if not names:
        raise UsageError(f"{', '.join(map(str, runs))}: expected a planner that ran in all folds, there is none")
    config = _config(each, names, ideal)
    on_ideal = None if ideal is None else read_ideal_run(Path(ideal), config)
    records = {name: join_records([run.records[name] for run in each]) for name in names}
    together = Run(config, records, _class_names(each), made=_summary(each, config, records, on_ideal))
    found = Folds(together, each)
    if out is not None:
        together.save(out, tables=found.tables())
    return found


def _beliefs(folders: Sequence[Path], out: str | Path | None) -> StreamBeliefReport:
    """Return the report of what beliefs and recognisers said in several folds; `out` is a folder to write to."""
    each = [Run(read_config(folder), read_episodes(folder / EPISODES), directory=folder) for folder in folders]
    _check(each)
    records = {name: join_records([run.records[name] for run in each]) for name in each[0].records}
    fps = each[0].conditions.fps
    assert fps is not None
    report = read_report(_config(each, [planner.name for planner in each[0].config.planners], None), records, fps)
    if out is not None:
        check_out(Path(out), report.config.to_json())
        write_report(Path(out), report)
    return report


def _check(runs: Sequence[Run]) -> None:
    """Raise a UsageError unless the runs are those of folds."""
    for run in runs:
        if run.conditions.part != TEST:
            raise UsageError(f"{run.directory}: expected the {TEST} part of a fold, got the {run.conditions.part} part")
        if run.config.made_of:
            raise UsageError(f"{run.directory}: expected the run of one fold, this one is of {run.config.parts}")
    watched = Counter(name for run in runs for name in set(next(iter(run.records.values())).sequence))
    twice = [name for name, count in watched.items() if count > 1]
    for row, run in enumerate(runs):
        for before in runs[:row]:
            check_same_config(before, run, SAME, expected="runs under the same conditions")
            if before.config.recogniser_sha256 == run.config.recogniser_sha256:
                raise UsageError(f"{before.directory} and {run.directory}: expected a recogniser of each, got the same")
    if twice:
        raise UsageError(f"folds: expected each sequence in one of them, got {twice[0]!r} in {watched[twice[0]]}")
    check_same_planners(runs)


def _class_names(runs: Sequence[Run]) -> tuple[str, ...]:
    """Return the names of the classes, which all runs share."""
    notes: list[str] = []
    named = [class_names(run, notes.append) for run in runs]
    for run, names in zip(runs, named, strict=True):
        if names != named[0]:
            why = "; ".join(["got others", *notes])
            raise UsageError(f"{runs[0].directory} and {run.directory}: expected the same classes, {why}")
    return named[0]


def _config(runs: Sequence[Run], names: Sequence[str], ideal: str | Path | None) -> RunConfig:
    """Return the configuration of all folds: the first one's, but for what each fold has of its own."""
    configs = [run.config for run in runs]
    planners = [{planner.name: planner for planner in config.planners} for config in configs]
    return joined_config(
        configs,
        data=_title([config.data for config in configs]),
        data_sha256=hashed_together([config.data_sha256 for config in configs]) or "",
        planners=tuple(_planner([of_fold[name] for of_fold in planners]) for name in names),
        ideal=None if ideal is None else str(ideal),
        folds=tuple(_fold_config(run) for run in runs),
    )


def _fold_config(run: Run) -> FoldConfig:
    episodes = len(next(iter(run.records.values())))
    return FoldConfig(str(run.folder), str(run.conditions.data), run.config.data_sha256, episodes)


def _planner(of_folds: Sequence[PlannerConfig]) -> PlannerConfig:
    return replace(of_folds[0], weights_sha256=hashed_together([planner.weights_sha256 for planner in of_folds]))


def _title(titles: Sequence[str]) -> str:
    """Return the title of the data of all folds: their name without the fold's number, and how many they are."""
    shared = {re.sub(rf"-(fold)?\d+( {re.escape(SYNTHETIC)})?$", r"\2", title) for title in titles}
    return f"{shared.pop()}, {len(titles)} folds" if len(shared) == 1 else " + ".join(titles)


def _summary(
    runs: Sequence[Run],
    config: RunConfig,
    records: Mapping[str, EpisodeRecords],
    on_ideal: Mapping[str, EpisodeRecords] | None,
) -> Summary:
    """Return the results of all folds: of their records, and the mean of their planning times."""
    step_ms, solves = {}, {}
    for group in group_planners(records):
        told = [run.summary.planner(group.name) for run in runs]
        counted = [planner.solves for planner in told]
        for name in group.records:
            step_ms[name] = sum(planner.step_ms for planner in told) / len(told)
            solves[name] = join_solves(counted) if name == group.records[0] else None
    return summarise(
        records,
        config,
        privileged={planner.name: planner.privileged for planner in config.planners},
        step_ms=step_ms,
        solves=solves,
        on_ideal=on_ideal,
    )


def fold_table(folds: Folds) -> Table:
    """Return the mean accuracy [%]: a row for each planner, a column for each fold. The best without truth is bold."""
    # Of the trainings that all folds have: a fold's own summary counts its others too.
    groups = group_planners(folds.run.records)
    of_fold = [
        {group.name: np.mean([100 * run.scored[name].correct.mean() for name in group.records]) for group in groups}
        for run in folds.each
    ]
    planners = folds.run.summary.planners
    bold = set()
    for column, held in enumerate(of_fold, 1):
        free = {row: held[planner.name] for row, planner in enumerate(planners) if not planner.privileged}
        if free:
            bold.add((max(free, key=lambda row: free[row]), column))
    return Table(
        title="Mean accuracy fold by fold, in percent",
        header=("planner", *(run.config.data.split(" (")[0] for run in folds.each)),
        rows=(
            *(
                (
                    planner.name + PRIVILEGED * planner.privileged,
                    *(f"{held[planner.name]:.1f}" for held in of_fold),
                )
                for planner in planners
            ),
            ("tested on", *(run.summary.basis.text for run in folds.each)),
        ),
        footnotes=(
            "Each fold has a recogniser, and what is fitted on it, of its own. Bold: the best without the truth.",
            *filter(None, (versions_note(folds.each),)),
        ),
        bold=frozenset(bold),
    )
