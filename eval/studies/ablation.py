"""The ablation study: variants of the next-best-view planner, side by side on the same episodes."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from ehar.conditions import Conditions
from ehar.errors import UsageError
from ehar.files import json_text, write_text
from ehar.planner import Planner
from ehar.processes import Processes, check_workers
from ehar.track import IDEAL, load_track
from eval.records.config import CONFIG, planner_config, run_config
from eval.records.episode_lines import episode_lines
from eval.records.run_files import EPISODES, SUMMARY, TABLE, check_out
from eval.render.tables import Table, interval_text, markdown, share_text
from eval.running.benchmark import summarise_runs
from eval.running.choice import ModelPlace
from eval.running.episodes import check_scored, cut_scenarios, random_starts
from eval.running.jobs import PlannerRun, Workload, run_planners
from eval.running.progress import ConsoleReporter, Reporter
from eval.scores.differences import NBV, Difference
from eval.scores.planner_metrics import PATH_LENGTH
from eval.scores.planner_summary import NO_ACT, PlannerSummary
from eval.scores.summary import Summary
from eval.scores.summary_table import TOGETHER, basis_lines
from planners.heuristic import NoAct
from planners.oracle import Oracle
from planners.search.next_best_view import NextBestView
from planners.search.view_search import NextBestViewGreedy, NextBestViewSearch
from planners.value.model import GainModel
from recognition.setting import load_setting

GROUPS = ("knowledge", "horizon", "replan", "effort", "solver", "search")


class Ablation(NamedTuple):
    """The results of variants of nbv, no-act and the oracle on the same episodes.

    Args:
        groups: names of the variants by group.
        tracks: names of the vehicles that nbv flew; `summary` lists each flight under the name of its vehicle.
        setting: the settings of nbv itself, in words.
        summary: summary of all planners; its differences compare nbv with each other planner.
    """

    groups: dict[str, tuple[str, ...]]
    tracks: tuple[str, ...]
    setting: str
    summary: Summary

    def tables(self) -> list[Table]:
        """Return the tables of the study."""
        return ablation_tables(self)


def ablation(
    conditions: Conditions | None = None,
    *,
    groups: Sequence[str] = GROUPS,
    tracks: Sequence[str] = (),
    out: str | Path | None = None,
    workers: int = 1,
    reporter: Reporter | None = None,
) -> Ablation:
    """Say what each part and setting of nbv is worth.

    It runs variants of nbv, no-act and the oracle on the same episodes.

    For example:
        ehar study ablation --data duo --groups knowledge search --out runs/ablation

    Args:
        conditions: conditions of all variants, on the grid; None takes the defaults.
        groups: groups of variants: knowledge, horizon, replan, effort, solver, search.
        tracks: vehicles that nbv flies as well.
        out: folder for config.json, episodes.jsonl, summary.json and table.md.
        workers: number of processes; only times depend on it.
        reporter: receives progress; None reports on standard error.

    Raises:
        EharError: one line that says what was got and what was expected.
        KeyboardInterrupt: Ctrl-C; nothing is written then.
    """
    conditions, reporter = conditions or Conditions(), reporter or ConsoleReporter()
    check_workers(workers)
    unknown = [group for group in groups if group not in GROUPS]
    if unknown:
        raise UsageError(f"unknown group {unknown[0]!r}; expected some of: {', '.join(GROUPS)}")
    flown = [track for track in map(load_track, tracks) if track.vehicle is not None]
    names = [NO_ACT, *(track.name for track in flown)]
    if len(flown) < len(tracks) or len(set(names)) < len(names):
        raise UsageError(f"tracks: expected vehicles, each once and none of them {IDEAL}, got {', '.join(tracks)}")
    setting = load_setting(conditions)
    conditions = setting.conditions
    scenarios = cut_scenarios(setting.recordings, setting.sequences, conditions.frames, reporter.note)
    check_scored(scenarios)
    flights = [replace(setting.runner, track=track) for track in flown]
    for runner in flights:
        runner.check_followed(scenarios)
    model = ModelPlace.of(setting).load_gain_model()
    nbv = NextBestView(model=model)
    chosen = {group: planners for group, planners in variants(model).items() if group in groups}
    together = [NoAct(), nbv, *(planner for planners in chosen.values() for planner in planners), Oracle()]
    flying = [NextBestView(model=model, name=track.name) for track in flown]
    config = run_config(
        setting,
        [planner_config(planner) for planner in (*together, *flying)],
        gain_model_sha256=model.sha256,
        lengths={"gain field": model.length},
        localisations={"gain field": model.localisation},
    )
    for warning in config.warnings:
        reporter.note(f"warning: {warning}")
    written = {**config.to_json(), "groups": list(groups), "tracks": names[1:]}
    if out is not None:
        check_out(Path(out), written)
    episodes = random_starts(scenarios, conditions.starts, conditions.seed, setting.world)
    workload = Workload(setting.runner, episodes)
    runs = dict(run_planners(workload, together, engine=Processes(workers), reporter=reporter))
    for runner, planner in zip(flights, flying, strict=True):
        runs |= run_planners(Workload(runner, episodes), [planner], engine=Processes(workers), reporter=reporter)
    # Each flight is compared with nbv on the ideal track, in the same resamples.
    on_ideal = {NO_ACT: runs[NO_ACT].records, **dict.fromkeys(names[1:], runs[NBV].records)} if flown else None
    result = Ablation(
        groups={group: tuple(planner.name for planner in planners) for group, planners in chosen.items()},
        tracks=tuple(names[1:]),
        setting=f"horizon {nbv.horizon}, a plan every {nbv.replan} frames, effort weight {nbv.effort_weight:g}, fatrop",
        summary=summarise_runs(runs, config, on_ideal),
    )
    if out is not None:
        _write(Path(out), written, runs, result)
    return result


def variants(model: GainModel) -> dict[str, list[Planner]]:
    """Return planners by group; each differs from nbv in one thing, and its name says in which."""

    def nbv(name: str, **changes: int | float | str) -> Planner:
        return NextBestView(model=model, name=name, **changes)  # type: ignore[arg-type]

    return {
        "knowledge": [nbv(f"without {part}", variant=f"no-{part}") for part in ("belief", "embedding", "facing")],
        "horizon": [nbv(f"horizon {nodes}", horizon=nodes) for nodes in (1, 5, 30)],
        "replan": [nbv(f"plan every {frames}", replan=frames) for frames in (1, 6, 15)],
        "effort": [nbv(f"effort {weight:g}", effort_weight=weight) for weight in (0.0, 0.01, 0.1)],
        "solver": [
            nbv("ipopt", solver="ipopt"),
            *(nbv(f"at most {count} iterations", max_iterations=count) for count in (8, 5)),
        ],
        "search": [NextBestViewSearch(model=model), NextBestViewGreedy(model=model)],
    }


def ablation_tables(result: Ablation) -> list[Table]:
    """Return a table with one row for each variant and, if nbv flew, a table with one row for each vehicle."""
    summary = result.summary
    planners = {planner.name: planner for planner in summary.planners}
    differences = {difference.other: difference for difference in summary.differences}
    notice, footnotes = basis_lines(summary.basis, summary.no_intervals)
    header = ("mean acc [95 %]", "gap closed % [95 %]", "minus nbv [95 %]", "path [m]", "ms/step", "fallbacks")
    rows = [("", name) for name in (NO_ACT, NBV)]
    rows += [(group, name) for group, names in result.groups.items() for name in names]
    rows += [("", planner.name) for planner in summary.planners if planner.privileged]
    tables = [
        Table(
            title=summary.title,
            header=("planner", "group", *header),
            rows=tuple(
                (name + "*" * planners[name].privileged, group, *_row(planners[name], differences.get(name)))
                for group, name in rows
            ),
            footnotes=(
                f"nbv: {result.setting}. Each variant differs in the one thing that its name says.",
                "* privileged: is handed the label and the future.",
                TOGETHER,
                *footnotes,
            ),
            notice=notice,
        )
    ]
    if result.tracks:
        tables.append(
            Table(
                title="nbv in flight, on the same episodes",
                header=("track", *header, "kept % [95 %]", "peak [m/s]"),
                rows=tuple(
                    (
                        IDEAL if name == NBV else name,
                        *_row(planners[name], differences.get(name)),
                        share_text(planners[name].accuracy_kept, planners[name].accuracy_kept_ci95),
                        _peak(planners[name]),
                    )
                    for name in (NBV, *result.tracks)
                ),
                footnotes=(
                    f"Gap closed is a share of the gap on the {IDEAL} track.",
                    f"Kept: (acc in flight - acc of {NO_ACT}) / (acc of nbv on the {IDEAL} track - acc of {NO_ACT}).",
                ),
            )
        )
    return tables


def _row(planner: PlannerSummary, difference: Difference | None) -> tuple[str, ...]:
    """Return the cells after the planner's name; the difference is the planner's accuracy minus that of nbv."""
    minus = "-"
    if difference is not None:
        ends = difference.ci95_corrected
        turned = None if ends is None else (-ends[1], -ends[0])
        minus = f"{-difference.acc_mean:+.1f} {interval_text(turned)}"
    solves = planner.solves
    return (
        f"{planner.acc_mean:.1f} {interval_text(planner.acc_mean_ci95)}",
        share_text(planner.gap_closed, planner.gap_closed_ci95),
        minus,
        f"{planner.metrics[PATH_LENGTH.key]:.1f}",
        f"{planner.step_ms:.3f}",
        "-" if solves is None else f"{solves.fallbacks} of {solves.total}",
    )


def _peak(planner: PlannerSummary) -> str:
    return "-" if planner.flight is None else f"{planner.flight.peak_speed:.2f}"


def _write(out: Path, config: Mapping[str, Any], runs: dict[str, PlannerRun], result: Ablation) -> None:
    """Write the configuration, records, numbers and tables."""
    write_text(out / CONFIG, [json_text(config)])
    write_text(out / EPISODES, episode_lines({name: run.records for name, run in runs.items()}))
    write_text(out / SUMMARY, [json_text({"groups": result.groups, **result.summary.to_json()})])
    write_text(out / TABLE, [markdown(*ablation_tables(result))])
