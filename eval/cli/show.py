"""Prints what the functions behind the commands return."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from ehar.data.motion_file import save_motion
from ehar.data.preparing.axes import Up
from ehar.data.preparing.mapping import Target
from ehar.data.preparing.mending import mended
from ehar.data.scenario import split_parts
from ehar.data.streams.data import NO_ACTIVITY, StreamData
from ehar.data.streams.file import save_streams
from ehar.errors import UsageError
from eval.live.figures import LoopFigures
from eval.render.console import output_console, print_tables

if TYPE_CHECKING:
    from ehar.data.motion_data import MotionData
    from eval.conformance.checks import Conformance
    from eval.live.rehearsal import Rehearsal
    from eval.render.tables import Table
    from eval.replays.replay import WrittenReplay
    from eval.running.run import Run
    from eval.running.training import Trained
    from eval.verification.checks import Verification


class HasTables(Protocol):
    """The result of a study."""

    def tables(self) -> "list[Table]":
        """Return the tables of the result."""
        ...


def show_run(run: "Run", *, report: bool = True) -> None:
    """Print a run's tables and, at the end, what was found and how sure it is.

    Args:
        run: the finished run.
        report: write report.html too, as ehar report does.
    """
    from eval.scores.closing import closing_sentences  # imported here: it brings what `ehar --help` does not need

    print_tables(*run.tables())
    if report and run.directory is not None:
        from eval.reports.page import make_report  # imported here: it brings plotly

        print(f"report: {make_report(run.directory)}")
    output_console().print(f"\n{closing_sentences(run.summary)}", markup=False)


def show_table(table: "Table") -> None:
    """Print a table."""
    print_tables(table)


def show_tables(tables: "list[Table]") -> None:
    """Print tables one below the other."""
    print_tables(*tables)


def show_result(result: HasTables) -> None:
    """Print the tables of a study."""
    print_tables(*result.tables())


def show_live(result: "LoopFigures | Rehearsal") -> None:
    """Print the tables of a rehearsal; of a loop, whose lines go to standard output, a line on standard error."""
    if isinstance(result, LoopFigures):
        print(result, file=sys.stderr)
    else:
        show_result(result)


def show_speed(figures: dict[str, float]) -> None:
    """Print the measured times beside their targets."""
    from eval.speed.bench import bench_table  # imported here: it brings torch

    show_table(bench_table(figures))


def show_path(path: Path) -> None:
    """Print the path that was written."""
    print(f"written to {path}")


def show_replay(written: "WrittenReplay") -> None:
    """Print what a replay shows, and its path."""
    print("; ".join([f"episode {written.episode}, {' and '.join(written.planners)}", *written.why]))
    show_path(written.path)


def save_data(
    data: "MotionData",
    *,
    out: Path,
    unit: str = "m",
    up: Up = "z",
    fps: float | None = None,
    mirror: bool = False,
    skeleton: Target | None = None,
) -> int:
    """Write prepared data, print a summary and the checks; return 1 if a check failed.

    Args:
        data: the prepared data.
        out: .npz to write.
        unit: unit that files were read with, for advice.
        up: axis that files were read with, for advice.
        fps: frames per second, if the reader is wrong; nothing is resampled.
        mirror: change the sign of x, for bodies whose left is right.
        skeleton: map joints to those of a pose estimator, by their names.
    """
    # Imported here: it brings scipy, which `ehar --help` does not need.
    from eval.conformance.advice import ReadWith
    from eval.conformance.data import check_bodies

    data = mended(data, fps=fps, mirror=mirror, skeleton=skeleton)
    save_motion(_npz(out), data)
    console = output_console()
    classes = f"{len(data.class_names)} class{'es' * (len(data.class_names) != 1)}"
    console.print(f"{out}: {len(data.labels)} sequences of {classes}, {data.fps:g} frames/s")
    for note in data.notes:
        console.print(f"note: {note}", markup=False)
    found = check_bodies(data, ReadWith(unit, up, mirror))
    print(found)
    return 0 if found.passed else 1


def save_stitched(streams: StreamData, *, out: Path) -> None:
    """Write streams, and print a summary.

    Args:
        streams: the streams.
        out: .npz to write.
    """
    save_streams(_npz(out), streams)
    seconds = streams.lengths / streams.fps
    output_console().print(
        f"{out}: {len(seconds)} streams of {seconds.min():.0f} to {seconds.max():.0f} s, "
        f"{seconds.sum() / 60:.1f} minutes, {len(streams.segments)} activities of {len(streams.class_names)} classes, "
        f"{100 * (streams.labels == NO_ACTIVITY).mean():.0f} % of the time none"
    )


def save_fold(data: "MotionData | StreamData", *, out: Path) -> None:
    """Write the data of a fold, and print who is tested.

    Args:
        data: the data.
        out: .npz to write.
    """
    if isinstance(data, StreamData):
        save_streams(_npz(out), data)
    else:
        save_motion(_npz(out), data)
    test = split_parts(data).test
    people = sorted({tuple(sorted(performers)) for performers in data.subjects[test].tolist()})
    named = ", ".join("-".join(map(str, performers)) for performers in people)
    output_console().print(f"{out}: {len(test)} of {len(data.lengths)} sequences for the test, by {named}")


def _npz(out: Path) -> Path:
    """Return the path if it is one of an .npz, or else raise a UsageError."""
    if out.suffix != ".npz":
        raise UsageError(f"{out}: expected a path that ends in .npz")
    return out


def show_trained(trained: "Trained") -> int:
    """Print the results of a training; return 1 if a part of it failed."""
    for line in trained.lines:
        print(line)
    return int(trained.failed)


def show_conformance(found: "Conformance") -> int:
    """Print the checks; return 1 if one failed."""
    print(found)
    return 0 if found.passed else 1


def show_verification(found: "Verification") -> int:
    """Print the checks; return 1 if one failed."""
    print_tables(found.table)
    for line in (*found.notes, found.verdict):
        print(line)
    return 0 if found.difference is None else 1
