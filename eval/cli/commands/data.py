"""`ehar data`: prepare, describe, stitch, divide and check motion."""

from pathlib import Path

from ehar.data.readers import READERS
from eval.cli.command import REQUIRED, Command, Flag
from eval.cli.commands.group import CommandGroup
from eval.cli.show import save_data, save_fold, save_stitched, show_conformance, show_table

PREPARED = {
    "source": Flag(kind=Path, positional=True, metavar="SOURCE"),
    "out": Flag(positional=True, metavar="OUT.npz"),
    "fps": Flag(hint="the reader's"),
    "skeleton": Flag(hint="the data's"),
}
OF_READERS = {  # flags of some readers
    "own": {"reader": Flag(kind=str, positional=True, metavar="READER")},
    "npz": {"joints": Flag(hint="the data's names"), "persons": Flag(hint="all")},
    "pyskl": {"split": Flag(hint="none"), "classes": Flag(hint="numbers")},
    "humanml3d": {"labels": Flag(hint="captions")},
}
PREPARE = CommandGroup(
    """Read motion files, and write a prepared .npz.

    For example:
        ehar data prepare aistpp AIST++ aistpp.npz
    """,
    {name: Command(place, save_data, flags=PREPARED | OF_READERS.get(name, {})) for name, place in READERS.items()},
)
DATA = CommandGroup(
    """Prepare motion data of your own, and describe it.

    For example:
        ehar data prepare bvh recordings mine.npz
        ehar data describe mine.npz
    """,
    {
        "prepare": PREPARE,
        "check": Command(
            "eval.conformance.data:check_data",
            show_conformance,
            text="""Check units, axes, sides, rate and gaps of a prepared .npz.

            Exit code 0: all passed; 1: a check failed, and how to mend it; 2: it can't run.

            For example:
                ehar data check mine.npz
            """,
            flags={"data": Flag(kind=str, positional=True, metavar="DATA")},
        ),
        "describe": Command(
            "eval.studies.describe:describe",
            show_table,
            text="""Print what sequences or streams hold, class by class.

            For example:
                ehar data describe mine.npz --figure mine.png
            """,
            flags={
                "data": Flag(kind=str, positional=True, metavar="DATA"),
                "figure": Flag(hint="none"),
                "length": Flag(hint="60; streams 30 s"),
            },
        ),
        "stitch": Command(
            "ehar.data.stitching.streams:stitch",
            save_stitched,
            text="""Make streams out of sequences: one activity after another.

            For example:
                ehar data stitch mine.npz --out mine-stream.npz --seconds 60
            """,
            flags={
                "data": Flag(kind=str, positional=True, metavar="DATA"),
                "seconds": Flag("length of a stream [s]."),
                "seed": Flag("of the order, if the data do not say when sequences were recorded."),
                "out": Flag(".npz to write.", kind=Path, default=REQUIRED),
            },
        ),
        "fold": Command(
            "ehar.data.folds:fold",
            save_fold,
            text="""Make other people the test part, so that all are tested once.

            Fold 0 is the data's own test part. The others share out the rest.

            For example:
                ehar data fold mine.npz --number 1 --out mine-1.npz
            """,
            flags={
                "data": Flag(
                    "duo, solo, duo-stream, solo-stream, or a prepared .npz.", kind=str, positional=True, metavar="DATA"
                ),
                "number": Flag("of the fold, from 0.", kind=int, default=REQUIRED),
                "folds": Flag("how many there are."),
                "out": Flag(".npz to write.", kind=Path, default=REQUIRED),
            },
        ),
    },
)
