"""`ehar benchmark`."""

from eval.cli.command import Command, Flag
from eval.cli.show import show_run

BENCHMARK = Command(
    "eval.running.benchmark:benchmark",
    show_run,
    text="""Run planners on test episodes, and say how well each did.

    For example:
        ehar benchmark --data duo
        ehar benchmark --data mine.npz --models models/mine --out runs/mine
        ehar benchmark ./spiral.py:Spiral no-act oracle
    """,
    conditions=(
        *("data", "models", "sensor", "track", "starts", "length", "fps", "seed", "part", "views", "form"),
        *("recogniser", "world", "onset"),
    ),
    flags={
        "planners": Flag(
            "names, or your own: file.py:Class or module:Class, then --argument value.",
            kind=tuple[str, ...] | None,
            positional=True,
            metavar="[PLANNER ...]",
            hint="all of ours",
        ),
        "out": Flag("folder for records, tables, report.", hint="none"),
        "data": Flag("duo, solo, solo-stream, duo-stream, or an .npz."),
        "length": Flag("frames of an episode.", hint="60; streams 30 s"),
        "fps": Flag("rate to resample to [Hz].", hint="the data's"),
        "onset": Flag("unknown, or known: when activities of streams begin.", kind=str),
        "views": Flag("of the recogniser: moving, paper or recorded."),
        "form": Flag("causal (streams) or ctrgcn (published, on prefixes)."),
        "part": Flag("test, validation, policy or recogniser part."),
        "seed": Flag("seed of starts, noise and random."),
        "world": Flag("indoor, room, crowd, or a .json."),
        "readout": Flag("what is scored: recogniser or belief."),
        "ideal": Flag("ideal run to compare flights with.", hint="none"),
        "engine": Flag("processes, or ray: a cluster.", kind=str),
        "address": Flag("of a Ray cluster, or auto.", hint="started here"),
        "device": Flag("cpu or cuda."),
    },
)
