"""The commands `ehar data ...`: prepare original files, describe prepared ones."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ehar.errors import UsageError
from ehar.motion_data import MotionData
from eval.commands import output_console


@dataclass(frozen=True)
class PrepareExpi:
    """Read the original ExPI files.

    Args:
        source: the folder that holds acro1 and acro2.
        out: the .npz to write.
    """

    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE")]
    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="OUT.npz")]

    def __call__(self) -> None:
        """Read and save."""
        from ehar.datasets.expi import prepare_expi

        _save(self.out, prepare_expi(self.source))


@dataclass(frozen=True)
class PrepareAistpp:
    """Read the original AIST++ files.

    Args:
        source: the folder that holds keypoints3d and the lists.
        out: the .npz to write.
    """

    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE")]
    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="OUT.npz")]

    def __call__(self) -> None:
        """Read and save."""
        from ehar.datasets.aistpp import prepare_aistpp

        _save(self.out, prepare_aistpp(self.source))


@dataclass(frozen=True)
class PrepareBvh:
    """Read a folder of BVH files.

    Args:
        source: the folder.
        out: the .npz to write.
        pattern: of the files' names, with {label} for the class and other fields in braces.
        label_from: take the class from the name, by the pattern, or from the folder a file lies in.
        unit: metres in one unit of the files.
        up: the axis of the files that points up.
    """

    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE")]
    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="OUT.npz")]
    pattern: str = "{label}_{style}_{number}.bvh"
    label_from: Literal["name", "folder"] = "name"
    unit: float = 0.01
    up: Literal["y", "z"] = "y"

    def __call__(self) -> None:
        """Read and save."""
        from ehar.datasets.bvh import prepare_bvh

        data = prepare_bvh(self.source, pattern=self.pattern, label_from=self.label_from, unit=self.unit, up=self.up)
        _save(self.out, data)


@dataclass(frozen=True)
class Describe:
    """Print what some data holds, class by class.

    Args:
        data: duo, solo, or the path of a prepared .npz.
        figure: a picture to draw, a few skeletons of each class.
        fps: frame rate to resample to.
    """

    data: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
    figure: Path | None = None
    fps: float | None = None

    def __call__(self) -> None:
        """Print the table, and draw the figure."""
        from ehar.datasets.source import load_data
        from eval.describe import describe, describe_figure

        data = load_data(self.data, fps=self.fps)
        output_console().print(describe(data))
        if self.figure is not None:
            describe_figure(data, self.figure)


def _save(out: Path, data: MotionData) -> None:
    """Write prepared data and say what was written."""
    from ehar.motion_file import save_motion

    if out.suffix != ".npz":
        raise UsageError(f"{out}: expected a path that ends in .npz")
    save_motion(out, data)
    output_console().print(
        f"{out}: {len(data.labels)} sequences of {len(data.class_names)} classes, {data.fps:g} frames/s"
    )
