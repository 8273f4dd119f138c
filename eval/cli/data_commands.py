"""The commands `ehar data ...`: prepare original files, describe prepared ones."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ehar.data.motion_data import MotionData
from ehar.errors import UsageError
from eval.cli.options import Fps
from eval.render.console import output_console, print_tables


@dataclass(frozen=True)
class PrepareExpi:
    """Read the original ExPI files.

    For example:
        ehar data prepare expi ExPI expi.npz

    Args:
        source: folder that holds acro1 and acro2.
        out: .npz to write.
    """

    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE")]
    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="OUT.npz")]

    def __call__(self) -> None:
        """Read and save."""
        from ehar.data.readers.expi import prepare_expi

        _save(self.out, prepare_expi(self.source))


@dataclass(frozen=True)
class PrepareAistpp:
    """Read the original AIST++ files.

    For example:
        ehar data prepare aistpp AIST++ aistpp.npz

    Args:
        source: folder that holds keypoints3d and the lists.
        out: .npz to write.
    """

    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE")]
    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="OUT.npz")]

    def __call__(self) -> None:
        """Read and save."""
        from ehar.data.readers.aistpp import prepare_aistpp

        _save(self.out, prepare_aistpp(self.source))


@dataclass(frozen=True)
class PrepareBvh:
    """Read a folder of BVH files.

    For example:
        ehar data prepare bvh recordings mine.npz --pattern '{label}_{number}.bvh'
        ehar data prepare bvh recordings mine.npz --label-from folder --unit 1

    Args:
        source: folder of the files.
        out: .npz to write.
        pattern: of the files' names: {label} is the class, other words in braces are free.
        label_from: where the class stands: in the name, or as the folder that a file lies in.
        unit: of length in the files [m].
        up: axis that points up in the files.
    """

    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE")]
    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="OUT.npz")]
    pattern: str = "{label}_{style}_{number}.bvh"
    label_from: Literal["name", "folder"] = "name"
    unit: float = 0.01
    up: Literal["y", "z"] = "y"

    def __call__(self) -> None:
        """Read and save."""
        from ehar.data.readers.bvh import prepare_bvh

        data = prepare_bvh(self.source, pattern=self.pattern, label_from=self.label_from, unit=self.unit, up=self.up)
        _save(self.out, data)


@dataclass(frozen=True)
class Describe:
    """Print what some data hold, class by class.

    For example:
        ehar data describe mine.npz --figure mine.png

    Args:
        data: duo, solo, or a prepared .npz.
        figure: to draw, a few skeletons of each class: .png, .svg or .pdf.
        fps: frame rate to resample to [Hz].
    """

    data: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
    figure: Path | None = None
    fps: Fps = None

    def __call__(self) -> None:
        """Print the table, and draw the figure."""
        from ehar.data.source import load_data
        from eval.studies.describe import describe, describe_figure

        data = load_data(self.data, fps=self.fps)
        print_tables(describe(data))
        if self.figure is not None:
            describe_figure(data, self.figure)


def _save(out: Path, data: MotionData) -> None:
    """Write prepared data and say what was written."""
    from ehar.data.motion_file import save_motion

    if out.suffix != ".npz":
        raise UsageError(f"{out}: expected a path that ends in .npz")
    save_motion(out, data)
    output_console().print(
        f"{out}: {len(data.labels)} sequences of {len(data.class_names)} classes, {data.fps:g} frames/s"
    )
