"""What each part and setting of the next-best-view planner is worth: variants side by side on the same episodes."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

from ehar.data.motion_data import MotionData
from ehar.data.scenario import split_parts
from ehar.errors import UsageError
from ehar.files import json_text, write_text
from ehar.planner import Planner
from eval.records.episodes import episode_lines
from eval.records.run_files import CONFIG, EPISODES, SUMMARY, check_out, installed_versions
from eval.render.tables import Table, interval_text, markdown, no_interval_footnotes, share_text
from eval.running.benchmark import check_options, load_setting
from eval.running.choice import ModelPlace
from eval.running.episodes import cut_scenarios, random_starts
from eval.running.jobs import PlannerRun, World, run_planners
from eval.running.progress import ConsoleReporter, Reporter
from eval.running.tracks import IDEAL, load_track, track_name
from eval.scores.differences import NBV, Difference
from eval.scores.summary import NO_ACT, Conditions, PlannerSummary, Summary, summarise
from planners.heuristic import NoAct
from planners.oracle import Oracle
from planners.search.next_best_view import NextBestView
from planners.search.view_search import NextBestViewGreedy, NextBestViewSearch
from planners.value.model import GainModel

GROUPS = ("knowledge", "horizon", "replan", "effort", "solver", "search")


@dataclass(frozen=True)
class AblationConfig:
    """Everything that decides an ablation's episodes.jsonl."""

    source: str
    data: str
    data_sha256: str
    models: str | None
    recogniser_sha256: str
    gain_model_sha256: str
    sensor: str
    views: str
    groups: tuple[str, ...]
    tracks: tuple[str, ...]
    starts: int
    seed: int
    length: int
    fps: float | None
    versions: dict[str, str]


class Ablation(NamedTuple):
    """Variants of nbv beside no-act and the oracle, on the same episodes.

    Args:
        groups: the variants' names by group.
        tracks: the names of the vehicles that nbv flew, which are also what `summary` calls those flights.
        setting: what nbv's own settings are, in words.
        summary: of them all; differences are nbv's to each other.
    """

    groups: dict[str, tuple[str, ...]]
    tracks: tuple[str, ...]
    setting: str
    summary: Summary


def ablation(
    *,
    data: str | Path | MotionData = "duo",
    models: Path | None = None,
    sensor: str = "perfect",
    views: str = "moving",
    groups: Sequence[str] = GROUPS,
    tracks: Sequence[str] = (),
    starts: int = 1,
    seed: int = 0,
    length: int = 60,
    fps: float | None = None,
    out: Path | None = None,
    workers: int = 1,
    reporter: Reporter | None = None,
) -> Ablation:
    """Run variants of nbv, no-act and the oracle on the test scenarios of some data.

    Args:
        data: `duo`, `solo`, the path of a prepared .npz, or data in memory.
        models: folder of recogniser and gain field; None takes those that ship with ehar.
        sensor: `perfect` or `estimator`.
        views: the cameras that the recogniser was trained on, `moving` or `paper`.
        groups: of variants, among `GROUPS`.
        tracks: vehicles that nbv flies as well, as in `benchmark`.
        starts: start viewpoints for each test scenario.
        seed: of start viewpoints and the sensor's noise.
        length: L, frames in an episode.
        fps: frame rate to resample to [1/s]; None keeps the data's.
        out: folder for config.json, episodes.jsonl, summary.json and table.md.
        workers: processes; the numbers, but for times, are the same with any number.
        reporter: hears of progress; None reports on standard error.

    Raises:
        EharError: one line that says what was got and what was expected.
        KeyboardInterrupt: nothing has been written then.
    """
    reporter = reporter or ConsoleReporter()
    check_options(starts=starts, seed=seed, workers=workers)
    unknown = [group for group in groups if group not in GROUPS]
    if unknown:
        raise UsageError(f"unknown group {unknown[0]!r}; expected some of: {', '.join(GROUPS)}")
    vehicles = [vehicle for vehicle in map(load_track, tracks) if vehicle is not None]
    names = [NO_ACT, *map(track_name, vehicles)]
    if len(vehicles) < len(tracks) or len(set(names)) < len(names):
        raise UsageError(f"tracks: expected vehicles, each once and none of them {IDEAL}, got {', '.join(tracks)}")
    setting = load_setting(data=data, models=models, sensor=sensor, views=views, form="causal", fps=fps)
    scenarios = cut_scenarios(setting.data, split_parts(setting.data).test, length, reporter.note)
    model = ModelPlace(
        models=None if models is None else Path(models),
        data=setting.data,
        sensor=sensor,
        views=views,
        form="causal",
        recogniser_sha256=setting.recogniser_sha256,
    ).load_gain_model()
    config = AblationConfig(
        source=setting.source,
        data=setting.data.title,
        data_sha256=setting.data.sha256,
        models=None if models is None else str(models),
        recogniser_sha256=setting.recogniser_sha256,
        gain_model_sha256=model.sha256,
        sensor=sensor,
        views=views,
        groups=tuple(groups),
        tracks=tuple(names[1:]),
        starts=starts,
        seed=seed,
        length=length,
        fps=fps,
        versions=installed_versions(),
    )
    if out is not None:
        check_out(Path(out), asdict(config))
    nbv = NextBestView(model=model)
    chosen = {group: planners for group, planners in variants(model).items() if group in groups}
    together = [NoAct(), nbv, *(planner for planners in chosen.values() for planner in planners), Oracle()]
    episodes = random_starts(scenarios, starts, seed)
    world = World(episodes, setting.recogniser, setting.sensor)
    runs = run_planners(world, together, workers=workers, reporter=reporter)
    for vehicle in vehicles:
        world = World(episodes, setting.recogniser, setting.sensor, vehicle)
        flying = NextBestView(model=model, name=vehicle.name)
        runs |= run_planners(world, [flying], workers=workers, reporter=reporter)
    result = Ablation(
        groups={group: tuple(planner.name for planner in planners) for group, planners in chosen.items()},
        tracks=config.tracks,
        setting=f"horizon {nbv.horizon}, a plan every {nbv.replan} frames, effort weight {nbv.effort_weight:g}, fatrop",
        summary=_summarise(runs, config),
    )
    if out is not None:
        _write(Path(out), config, runs, result)
    return result


def variants(model: GainModel) -> dict[str, list[Planner]]:
    """Return planners by group, each of which differs from nbv in one thing; names say in which."""

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
    """Return one row a variant and, where nbv flew, one a vehicle."""
    summary = result.summary
    planners = {planner.name: planner for planner in summary.planners}
    differences = {difference.other: difference for difference in summary.differences}
    title = (
        f"{summary.data}: sensor {summary.sensor}, views {summary.views}, "
        f"{summary.episodes} episodes of {summary.length} frames from {summary.sequences} sequences"
    )
    header = ("mean acc [95 %]", "gap closed % [95 %]", "minus nbv [95 %]", "path [m]", "ms/step", "fallbacks")
    rows = [("", name) for name in (NO_ACT, NBV)]
    rows += [(group, name) for group, names in result.groups.items() for name in names]
    rows += [("", planner.name) for planner in summary.planners if planner.privileged]
    tables = [
        Table(
            title=title,
            header=("planner", "group", *header),
            rows=tuple(
                (name + "*" * planners[name].privileged, group, *_row(planners[name], differences.get(name)))
                for group, name in rows
            ),
            footnotes=(
                f"nbv: {result.setting}. Each variant differs in what it is called after.",
                "* privileged: is handed the label and the future.",
                *no_interval_footnotes(summary.no_intervals),
            ),
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
                    f"Gap closed is that of the {IDEAL} track's gap.",
                    f"Kept: (accuracy in flight - that of {NO_ACT}) / (nbv's on the {IDEAL} track - that of {NO_ACT}).",
                ),
            )
        )
    return tables


def _row(planner: PlannerSummary, difference: Difference | None) -> tuple[str, ...]:
    """Return the cells behind a planner's name; nbv's difference to it is turned around."""
    minus = "-"
    if difference is not None:
        turned = None if difference.ci95 is None else (-difference.ci95[1], -difference.ci95[0])
        minus = f"{-difference.acc_mean:+.1f} {interval_text(turned)}"
    solves = planner.solves
    return (
        f"{planner.acc_mean:.1f} {interval_text(planner.acc_mean_ci95)}",
        share_text(planner.gap_closed, planner.gap_closed_ci95),
        minus,
        f"{planner.path_length_m:.1f}",
        f"{planner.step_ms:.3f}",
        "-" if solves is None else f"{solves.fallbacks} of {solves.total}",
    )


def _peak(planner: PlannerSummary) -> str:
    return "-" if planner.flight is None else f"{planner.flight.peak_speed:.2f}"


def _summarise(runs: dict[str, PlannerRun], config: AblationConfig) -> Summary:
    """Return one summary of all: a flight is compared with nbv on the ideal track, in the same resamples."""
    on_ideal = {NO_ACT: runs[NO_ACT].records, **dict.fromkeys(config.tracks, runs[NBV].records)}
    return summarise(
        {name: run.records for name, run in runs.items()},
        Conditions(
            data=config.data,
            sensor=config.sensor,
            views=config.views,
            track=IDEAL,
            form="causal",
            readout="recogniser",
        ),
        privileged={name: name == Oracle.name for name in runs},
        step_ms={name: run.step_ms for name, run in runs.items()},
        solves={name: run.solves for name, run in runs.items()},
        on_ideal=on_ideal if config.tracks else None,
    )


def _write(out: Path, config: AblationConfig, runs: dict[str, PlannerRun], result: Ablation) -> None:
    """Write config, records, numbers and tables."""
    out.mkdir(parents=True, exist_ok=True)
    write_text(out / CONFIG, [json_text(asdict(config))])
    write_text(out / EPISODES, episode_lines({name: run.records for name, run in runs.items()}))
    write_text(out / SUMMARY, [json_text({"groups": result.groups, **result.summary.to_json()})])
    write_text(out / "table.md", [markdown(*ablation_tables(result))])
