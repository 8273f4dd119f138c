"""Headroom: how much accuracy better views could win, read from a map of fixed cameras around people."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ehar.arrays import FloatArray
from ehar.conditions import Conditions
from ehar.data.scenario import split_parts, windows
from ehar.errors import UsageError
from ehar.files import json_text, write_text
from ehar.processes import Processes, check_workers
from ehar.world import load_world
from eval.records.config import CONFIG, RunConfig, planner_config, run_config
from eval.records.run_files import TABLE, check_out
from eval.render.tables import Table, markdown
from eval.running.choice import make_planners
from eval.running.episodes import Episodes, cut_scenarios, random_starts
from eval.running.jobs import Workload, run_planners
from eval.running.progress import ConsoleReporter, Reporter
from eval.scores.metrics import mean_acc
from eval.scores.planner_summary import NO_ACT, ORACLE
from eval.studies.headroom.class_maps import (
    ClassMaps,
    Watched,
    chosen_by_others,
    class_maps,
    class_tables,
    scores_at,
    worth_on_the_same,
)
from eval.studies.headroom.places import counted_from, placed_around, viewpoint_map
from recognition.setting import load_setting

REFERENCES = (NO_ACT, ORACLE, "oracle-lookahead")  # planners in the same table as the fixed cameras


@dataclass(frozen=True)
class HeadroomRow:
    """The accuracy [%], mean over frames, of one way to place cameras."""

    name: str
    acc_mean: float
    chosen_on: str  # the episodes that decided the choice: none (-), others than those that are scored, or test


@dataclass(frozen=True, eq=False)
class Headroom:
    """The headroom on the test scenarios of some data.

    Args:
        config: configuration of the study.
        distance: distance of the fixed cameras [m].
        viewpoints: (polars, azimuths, 3), the map of fixed cameras; azimuths are counted from people's front.
        acc_mean: (polars, azimuths) accuracy [%] on test, mean over frames and scenarios.
        rows: the ways to place cameras.
        maps: where each class is best seen, and what it is worth to know the class.
        scenarios: number of test scenarios.
        counted_from: what azimuths are counted from, in words.
    """

    config: RunConfig
    distance: float
    viewpoints: FloatArray
    acc_mean: FloatArray
    rows: tuple[HeadroomRow, ...]
    maps: ClassMaps
    scenarios: int
    counted_from: str

    def to_json(self) -> dict[str, Any]:
        """Return the content of headroom.json."""
        return {
            "data": self.config.data,
            "sensor": self.config.conditions.sensor,
            "views": self.config.conditions.views,
            "scenarios": self.scenarios,
            "rows": [asdict(row) for row in self.rows],
            "classes": self.maps.to_json(),
            "map": {
                "distance_m": self.distance,
                "azimuth_from": self.counted_from,
                "polar_deg": np.degrees(self.viewpoints[:, 0, 2]).round(3).tolist(),
                "azimuth_deg": np.degrees(self.viewpoints[0, :, 1]).round(3).tolist(),
                "acc_mean": self.acc_mean.tolist(),
                "acc_mean_by_polar": self.acc_mean.mean(axis=1).tolist(),
            },
        }

    def tables(self) -> list[Table]:
        """Return the tables of the study."""
        return headroom_tables(self)


def headroom(
    conditions: Conditions | None = None,
    *,
    distance: float | None = None,
    azimuths: int = 12,
    polars: int = 6,
    out: str | Path | None = None,
    workers: int = 1,
    reporter: Reporter | None = None,
) -> Headroom:
    """Say what there is to win: accuracy of fixed cameras.

    It scores a map of viewpoints around people, and the best of them, beside no-act and the oracles. Azimuths are
    counted from people's true front in the first frame. For several people they are counted from the direction from the
    first to the second. A viewpoint that is chosen and scored on the same scenarios looks better than it is, so each
    choice is also made on other people. The best viewpoint per sample is chosen from the outcome of the sample; no
    camera can do that. For each class there is a map, the place that shows it best, and what that is worth.

    For example:
        ehar study headroom --data duo --out runs/headroom

    Args:
        conditions: conditions of all cameras; None takes the defaults.
        distance: distance of the fixed cameras [m]; None takes the middle of the world's.
        azimuths: number of azimuths of the map, evenly spaced.
        polars: number of polar angles of the map, from the least of the world to the greatest.
        out: folder for config.json, headroom.json, table.md and the figures.
        workers: number of processes; results do not depend on it.
        reporter: receives progress; None reports on standard error.

    Raises:
        EharError: one line that says what was got and what was expected.
    """
    conditions, reporter = conditions or Conditions(), reporter or ConsoleReporter()
    check_workers(workers)
    world = load_world(conditions.world)
    if not world.is_open:
        raise UsageError(f"world: expected a world without obstacles, got {world}: fixed cameras may stand in them")
    workspace = world.workspace
    distance = (workspace.distance_min + workspace.distance_max) / 2 if distance is None else distance
    viewpoints = viewpoint_map(workspace, distance, azimuths, polars)
    setting = load_setting(conditions)
    motion, parts = setting.data, split_parts(setting.data)
    references = make_planners(REFERENCES).planners
    config = run_config(setting, [planner_config(planner) for planner in references])
    for warning in config.warnings:
        reporter.note(f"warning: {warning}")
    written = {**config.to_json(), "distance": distance, "azimuths": azimuths, "polars": polars}
    if out is not None:
        check_out(Path(out), written)
    test = cut_scenarios(motion, parts.test, conditions.frames, reporter.note)
    both = windows(motion, np.concatenate([parts.validation, parts.test]), conditions.frames, stride=conditions.frames)
    flat = viewpoints.reshape(-1, 3)
    around = placed_around(both, flat, workspace).reshape(-1, 3)
    fixed = Episodes(both, np.repeat(np.arange(len(both)), len(flat)), around, conditions.seed)
    runs = run_planners(Workload(setting.runner, fixed), references[:1], engine=Processes(workers), reporter=reporter)
    watched = Watched(
        acc=100 * mean_acc(runs[NO_ACT].records.correct).reshape(len(both), len(flat)),
        labels=both.labels,
        sequence=both.sequence,
        subjects=motion.subjects[both.sequence],
        scored=np.isin(both.sequence, parts.test),
    )
    random = random_starts(test, conditions.starts, conditions.seed, setting.world)
    runs = run_planners(Workload(setting.runner, random), references, engine=Processes(workers), reporter=reporter)
    acc_references = {name: 100 * float(mean_acc(run.records.correct).mean()) for name, run in runs.items()}
    acc_test = watched.acc[watched.scored]
    result = Headroom(
        config=config,
        distance=distance,
        viewpoints=viewpoints,
        acc_mean=acc_test.mean(axis=0).reshape(viewpoints.shape[:2]),
        rows=_rows(watched, acc_references),
        maps=class_maps(watched, flat, motion.class_names),
        scenarios=len(acc_test),
        counted_from=counted_from(motion),
    )
    if out is not None:
        _write(Path(out), written, result)
    return result


def _rows(watched: Watched, references: dict[str, float]) -> tuple[HeadroomRow, ...]:
    """Return the rows of the first table."""
    acc, labels = watched.acc[watched.scored], watched.labels[watched.scored]
    chosen, one_on_test = chosen_by_others(watched), float(acc.mean(axis=0).max())
    return (
        HeadroomRow("no-act, random starts", references[NO_ACT], "-"),
        HeadroomRow("fixed, mean over the map", float(acc.mean()), "-"),
        HeadroomRow("best fixed", float(scores_at(watched, chosen.one).mean()), "others"),
        HeadroomRow("best fixed per class", float(scores_at(watched, chosen.own).mean()), "others"),
        HeadroomRow("best fixed", one_on_test, "test"),
        HeadroomRow("best fixed per class", one_on_test + worth_on_the_same(acc, labels), "test"),
        HeadroomRow("best fixed per sample", float(acc.max(axis=1).mean()), "test"),
        *(HeadroomRow(f"{name}*", value, "-") for name, value in references.items() if name != NO_ACT),
    )


def headroom_tables(result: Headroom) -> list[Table]:
    """Return the tables: ways to place cameras, accuracy by polar angle, and what classes have to do with it."""
    config = result.config
    polars, azimuths = result.acc_mean.shape
    title = (
        f"{config.data}: sensor {config.conditions.sensor}, views {config.conditions.views}{config.in_world}, "
        f"{result.scenarios} test scenarios, {azimuths} x {polars} fixed cameras at {result.distance:g} m"
    )
    polar = np.degrees(result.viewpoints[:, 0, 2])
    return [
        Table(
            title=title,
            header=("camera", "mean acc", "chosen on"),
            rows=tuple((row.name, f"{row.acc_mean:.1f}", row.chosen_on) for row in result.rows),
            footnotes=(
                "Rows chosen on test are chosen and scored on the same episodes: they are upper bounds. Others: other "
                f"{'people' if result.maps.by_strangers else 'sequences'} of the validation and the test part choose.",
                f"A fixed camera stays at an angle from {result.counted_from}. It is told the true one.",
                "* privileged: is handed the label and the future. It begins at random starts, like no-act.",
            ),
        ),
        Table(
            title="By polar angle (0 looks down from straight above), mean over azimuths",
            header=("polar [deg]", "mean acc", "worst azimuth", "best azimuth"),
            rows=tuple(
                (f"{angle:.1f}", f"{acc.mean():.1f}", f"{acc.min():.1f}", f"{acc.max():.1f}")
                for angle, acc in zip(polar, result.acc_mean, strict=True)
            ),
            footnotes=(),
        ),
        *class_tables(result.maps, result.counted_from),
    ]


def _write(out: Path, config: Mapping[str, Any], result: Headroom) -> None:
    """Write the configuration, numbers, tables and figure."""
    from eval.studies.headroom.figure import draw_class_maps, draw_map  # matplotlib takes a second to import

    write_text(out / CONFIG, [json_text(config)])
    write_text(out / "headroom.json", [json_text(result.to_json())])
    sensor = result.config.conditions.sensor
    title = f"{result.config.data}, {sensor} sensor: fixed cameras at {result.distance:g} m"
    draw_map(result.viewpoints, result.acc_mean, title, out / "headroom")
    draw_class_maps(result.viewpoints, result.maps, title, out / "class-maps")
    write_text(out / TABLE, [markdown(*headroom_tables(result))])
