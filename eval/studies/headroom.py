"""Headroom: how much accuracy better views could win, read from a map of fixed cameras."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.conditions import Conditions
from ehar.data.scenario import split_parts, windows
from ehar.errors import UsageError
from ehar.files import json_text, write_text
from ehar.processes import Processes, check_workers
from ehar.viewpoint import Workspace
from ehar.world import load_world
from eval.records.config import CONFIG, RunConfig, planner_config, run_config
from eval.records.run_files import check_out
from eval.render.tables import Table, markdown
from eval.running.choice import make_planners
from eval.running.episodes import Episodes, cut_scenarios, random_starts
from eval.running.jobs import Workload, run_planners
from eval.running.progress import ConsoleReporter, Reporter
from eval.scores.metrics import mean_acc
from eval.scores.planner_summary import NO_ACT, ORACLE
from recognition.setting import load_setting

REFERENCES = (NO_ACT, ORACLE, "oracle-lookahead")  # planners in the same table as the fixed cameras


@dataclass(frozen=True)
class HeadroomRow:
    """The accuracy [%], mean over frames, of one way to place cameras."""

    name: str
    acc_mean: float
    chosen_on: str  # the episodes that decided the choice: none (-), validation or test


@dataclass(frozen=True)
class ClassRow:
    """The fixed viewpoint that shows one class best, chosen on test, and the accuracy [%] there."""

    class_name: str
    azimuth_deg: float
    polar_deg: float
    acc_mean: float
    acc_mean_map: float  # mean accuracy [%] of the class over the map


@dataclass(frozen=True, eq=False)
class Headroom:
    """The headroom on the test scenarios of some data.

    Args:
        config: configuration of the study.
        distance: distance of the fixed cameras [m].
        viewpoints: (polars, azimuths, 3), the map of fixed cameras.
        acc_mean: (polars, azimuths) accuracy [%] on test, mean over frames and scenarios.
        rows: the ways to place cameras.
        classes: the best fixed viewpoint of each class that has test scenarios.
        scenarios: number of test scenarios.
    """

    config: RunConfig
    distance: float
    viewpoints: FloatArray
    acc_mean: FloatArray
    rows: tuple[HeadroomRow, ...]
    classes: tuple[ClassRow, ...]
    scenarios: int

    def to_json(self) -> dict[str, Any]:
        """Return the content of headroom.json."""
        return {
            "data": self.config.data,
            "sensor": self.config.conditions.sensor,
            "views": self.config.conditions.views,
            "scenarios": self.scenarios,
            "rows": [asdict(row) for row in self.rows],
            "classes": [asdict(row) for row in self.classes],
            "map": {
                "distance_m": self.distance,
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

    It scores a map of viewpoints, and the best of them, beside no-act and the oracles. A viewpoint that is chosen and
    scored on the same scenarios looks better than it is, so each choice is also made on the validation part. The best
    viewpoint per sample is chosen from the outcome of the sample; no camera can do that.

    For example:
        ehar study headroom --data duo --out runs/headroom

    Args:
        conditions: conditions of all cameras; None takes the defaults.
        distance: distance of the fixed cameras [m]; None takes the middle of the world's.
        azimuths: number of azimuths of the map, evenly spaced.
        polars: number of polar angles of the map, from the least of the world to the greatest.
        out: folder for config.json, headroom.json, table.md and the figure.
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
    fixed = Episodes(both, np.repeat(np.arange(len(both)), len(flat)), np.tile(flat, (len(both), 1)), conditions.seed)
    runs = run_planners(Workload(setting.runner, fixed), references[:1], engine=Processes(workers), reporter=reporter)
    acc = 100 * mean_acc(runs[NO_ACT].records.correct).reshape(len(both), len(flat))
    random = random_starts(test, conditions.starts, conditions.seed, setting.world)
    runs = run_planners(Workload(setting.runner, random), references, engine=Processes(workers), reporter=reporter)
    acc_references = {name: 100 * float(mean_acc(run.records.correct).mean()) for name, run in runs.items()}
    is_test = np.isin(both.sequence, parts.test)
    acc_test, labels = acc[is_test], both.labels[is_test]
    result = Headroom(
        config=config,
        distance=distance,
        viewpoints=viewpoints,
        acc_mean=acc_test.mean(axis=0).reshape(viewpoints.shape[:2]),
        rows=_rows(acc_test, labels, acc[~is_test], both.labels[~is_test], acc_references),
        classes=_class_rows(acc_test, labels, motion.class_names, flat),
        scenarios=len(acc_test),
    )
    if out is not None:
        _write(Path(out), written, result)
    return result


def viewpoint_map(workspace: Workspace, distance: float, azimuths: int, polars: int) -> FloatArray:
    """Return fixed viewpoints (polars, azimuths, 3) on the grid, from the least polar angle to the greatest.

    Raises:
        UsageError: the distance is outside the workspace, or there are too few angles.
    """
    if not workspace.distance_min <= distance <= workspace.distance_max:
        raise UsageError(
            f"distance: expected {workspace.distance_min:g} to {workspace.distance_max:g} m, got {distance:g}"
        )
    if azimuths < 1 or polars < 2:
        raise UsageError(f"expected a map of at least 1 azimuth and 2 polar angles, got {azimuths} and {polars}")
    polar = np.linspace(workspace.polar_min, workspace.polar_max, polars)
    azimuth = 2 * np.pi * np.arange(azimuths) / azimuths
    wanted = np.stack(np.broadcast_arrays(distance, azimuth, polar[:, None]), axis=-1)
    return workspace.from_cells(workspace.to_cells(wanted))


def best_per_class(acc: FloatArray, labels: IntArray, classes: int) -> IntArray:
    """Return the best viewpoint of each class, (K,), from accuracies (N, M); without samples, the best of all."""
    overall = int(acc.mean(axis=0).argmax())
    return np.array(
        [
            int(acc[labels == label].mean(axis=0).argmax()) if (labels == label).any() else overall
            for label in range(classes)
        ]
    )


def _rows(
    acc: FloatArray, labels: IntArray, acc_val: FloatArray, labels_val: IntArray, references: dict[str, float]
) -> tuple[HeadroomRow, ...]:
    """Return the rows of the first table, from accuracies (N, M) on test and on validation."""
    scenario, classes = np.arange(len(acc)), int(labels.max()) + 1
    rows = [
        HeadroomRow("no-act, random starts", references[NO_ACT], "-"),
        HeadroomRow("fixed, mean over the map", float(acc.mean()), "-"),
    ]
    if len(acc_val):
        best = acc[:, acc_val.mean(axis=0).argmax()].mean()
        per_class = acc[scenario, best_per_class(acc_val, labels_val, classes)[labels]].mean()
        rows += [
            HeadroomRow("best fixed", float(best), "validation"),
            HeadroomRow("best fixed per class", float(per_class), "validation"),
        ]
    rows += [
        HeadroomRow("best fixed", float(acc.mean(axis=0).max()), "test"),
        HeadroomRow(
            "best fixed per class", float(acc[scenario, best_per_class(acc, labels, classes)[labels]].mean()), "test"
        ),
        HeadroomRow("best fixed per sample", float(acc.max(axis=1).mean()), "test"),
        *(HeadroomRow(f"{name}*", value, "-") for name, value in references.items() if name != NO_ACT),
    ]
    return tuple(rows)


def _class_rows(
    acc: FloatArray, labels: IntArray, class_names: tuple[str, ...], viewpoints: FloatArray
) -> tuple[ClassRow, ...]:
    best = best_per_class(acc, labels, len(class_names))
    degrees = np.degrees(viewpoints)
    return tuple(
        ClassRow(
            class_name=name,
            azimuth_deg=round(float(degrees[best[label], 1]), 3),
            polar_deg=round(float(degrees[best[label], 2]), 3),
            acc_mean=float(acc[labels == label, best[label]].mean()),
            acc_mean_map=float(acc[labels == label].mean()),
        )
        for label, name in enumerate(class_names)
        if (labels == label).any()
    )


def headroom_tables(result: Headroom) -> list[Table]:
    """Return three tables: ways to place cameras, accuracy by polar angle, and the best viewpoint of each class."""
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
                "Rows chosen on test are chosen and scored on the same episodes: they are upper bounds.",
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
        Table(
            title="The fixed viewpoint that shows each class best, chosen on test",
            header=("class", "azimuth [deg]", "polar [deg]", "mean acc", "over the map"),
            rows=tuple(
                (
                    row.class_name,
                    f"{row.azimuth_deg:.1f}",
                    f"{row.polar_deg:.1f}",
                    f"{row.acc_mean:.1f}",
                    f"{row.acc_mean_map:.1f}",
                )
                for row in result.classes
            ),
            footnotes=(),
        ),
    ]


def _write(out: Path, config: Mapping[str, Any], result: Headroom) -> None:
    """Write the configuration, numbers, tables and figure."""
    from eval.studies.headroom_figure import draw_map  # matplotlib takes a second to import

    write_text(out / CONFIG, [json_text(config)])
    write_text(out / "headroom.json", [json_text(result.to_json())])
    write_text(out / "table.md", [markdown(*headroom_tables(result))])
    sensor = result.config.conditions.sensor
    title = f"{result.config.data}, {sensor} sensor: fixed cameras at {result.distance:g} m"
    draw_map(result.viewpoints, result.acc_mean, title, out / "headroom")
