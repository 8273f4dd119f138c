"""The commands of `ehar`: which function each runs, and what is printed of what that returns."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol, Union

from eval.cli.command import REQUIRED, Command, Flag
from eval.render.console import output_console, print_tables

if TYPE_CHECKING:
    from ehar.data.motion_data import MotionData
    from eval.conformance.checks import Conformance
    from eval.render.tables import Table
    from eval.replays.replay import WrittenReplay
    from eval.running.run import Run
    from eval.running.training import Trained
    from eval.studies.compare import Comparison
    from eval.verification.checks import Verification


class HasTables(Protocol):
    """What a study returns."""

    def tables(self) -> "list[Table]":
        """Return what there is to read."""
        ...


class Group(NamedTuple):
    """Commands that share their first words. Its text is, as a command's, a line and then examples."""

    text: str
    commands: Mapping[str, Union["Group", Command]]


RUN = Flag(kind=Path, positional=True, metavar="RUN")  # folder of a finished run
AS_RECORDED = {"data": Flag(hint="as recorded"), "models": Flag(hint="as recorded")}  # of a finished run
SEEN = ("data", "models", "sensor", "views", "seed", "length", "fps", "recogniser")  # conditions of any run
TRAINED = ("data", "sensor", "views", "length", "fps")  # conditions of any training
ON_DATA = {"data": Flag(default=REQUIRED), "out": Flag(hint="that of --models")}


def show_run(run: "Run", *, report: bool = True) -> None:
    """Print a run's tables.

    Args:
        run: as it ran.
        report: write report.html too, as ehar report does.
    """
    print_tables(*run.summary.tables())
    if report and run.directory is not None:
        from eval.reports.page import make_report  # here, as it brings plotly

        print(f"report: {make_report(run.directory)}")


def show_tables(tables: "Table | list[Table] | tuple[Table, ...]") -> None:
    """Print a table, or several."""
    print_tables(*(tables if isinstance(tables, list | tuple) and not hasattr(tables, "title") else [tables]))


def show_result(result: "HasTables") -> None:
    """Print the tables of a study."""
    print_tables(*result.tables())


def show_comparison(comparison: "Comparison") -> None:
    """Print the table of two runs."""
    from eval.studies.compare_table import compare_table  # here, as `ehar --help` does not wait for it

    show_tables(compare_table(comparison))


def show_speed(figures: dict[str, float]) -> None:
    """Print the figures beside their targets."""
    from eval.speed.bench import bench_table  # here, as it brings torch

    show_tables(bench_table(figures))


def show_path(path: Path) -> None:
    """Say where something was written."""
    print(f"written to {path}")


def show_replay(written: "WrittenReplay") -> None:
    """Say what a replay shows, and where it is."""
    print("; ".join([f"episode {written.episode}, {' and '.join(written.planners)}", *written.why]))
    show_path(written.path)


def save_data(data: "MotionData", *, out: Path) -> None:
    """Write prepared data, and say what was written.

    Args:
        data: prepared.
        out: .npz to write.
    """
    from ehar.data.motion_file import save_motion
    from ehar.errors import UsageError

    if out.suffix != ".npz":
        raise UsageError(f"{out}: expected a path that ends in .npz")
    save_motion(out, data)
    output_console().print(
        f"{out}: {len(data.labels)} sequences of {len(data.class_names)} classes, {data.fps:g} frames/s"
    )


def show_trained(trained: "Trained") -> None:
    """Print what a training gave."""
    for line in trained.lines:
        print(line)


def show_conformance(found: "Conformance") -> int:
    """Print the checks; 1 where one failed."""
    print(found)
    return 0 if found.passed else 1


def show_verification(found: "Verification") -> int:
    """Print what was checked; 1 where something differs."""
    print_tables(found.table)
    for line in (*found.notes, found.verdict):
        print(line)
    return 0 if found.difference is None else 1


BENCHMARK = Command(
    """Run planners on test episodes, and say how well each did.

    For example:
        ehar benchmark --data duo
        ehar benchmark --data mine.npz --models models/mine --out runs/mine
        ehar benchmark ./spiral.py:Spiral --distance 6 no-act oracle
    """,
    "eval.running.benchmark:benchmark",
    show_run,
    conditions=(
        *("data", "models", "sensor", "track", "starts", "length", "fps", "seed", "part", "views", "form"),
        "recogniser",
    ),
    flags={
        "planners": Flag(
            kind=tuple[str, ...], default=(), positional=True, metavar="[PLANNER ...]", hint="all of ours"
        ),
        "ideal": Flag(hint="none"),
    },
)
PREPARED = {
    "source": Flag(positional=True, metavar="SOURCE"),
    "out": Flag(positional=True, metavar="OUT.npz"),
}
PREPARE = Group(
    """Read motion files, and write a prepared .npz.

    For example:
        ehar data prepare aistpp AIST++ aistpp.npz
    """,
    {
        "bvh": Command(
            """Read a folder of BVH files.

            For example:
                ehar data prepare bvh recordings mine.npz --pattern '{label}_{number}.bvh'
                ehar data prepare bvh recordings mine.npz --label-from folder --unit 1
            """,
            "ehar.data.readers.bvh:prepare_bvh",
            save_data,
            flags=PREPARED,
        ),
        "expi": Command(
            """Read the original ExPI files.

            For example:
                ehar data prepare expi ExPI expi.npz
            """,
            "ehar.data.readers.expi:prepare_expi",
            save_data,
            flags=PREPARED,
        ),
        "aistpp": Command(
            """Read the original AIST++ files.

            For example:
                ehar data prepare aistpp AIST++ aistpp.npz
            """,
            "ehar.data.readers.aistpp:prepare_aistpp",
            save_data,
            flags=PREPARED,
        ),
    },
)
DATA = Group(
    """Prepare motion data of your own, and describe it.

    For example:
        ehar data prepare bvh recordings mine.npz
        ehar data describe mine.npz
    """,
    {
        "prepare": PREPARE,
        "describe": Command(
            """Print what some data hold, class by class.

            For example:
                ehar data describe mine.npz --figure mine.png
            """,
            "eval.studies.describe:describe",
            show_tables,
            flags={"data": Flag(kind=str, positional=True, metavar="DATA"), "figure": Flag(hint="none")},
        ),
    },
)
TRAIN = Group(
    """Train what planners need on data of your own.

    For example:
        ehar train all --data mine.npz --out models/mine
    """,
    {
        "all": Command(
            """Train recogniser, gain field and agents, in this order.

            What is done is kept; stopped and started again, it goes on.

            For example:
                ehar train all --data mine.npz --out models/mine
            """,
            "eval.running.training:train_all",
            show_trained,
            conditions=TRAINED,
            flags=ON_DATA,
        ),
        "recogniser": Command(
            """Train a recogniser, on the recogniser part of data.

            Stopped and started again, it goes on where it was.

            For example:
                ehar train recogniser --data mine.npz --out models/mine
            """,
            "eval.running.training:train_recogniser",
            show_trained,
            conditions=(*TRAINED, "form", "seed"),
            flags={**ON_DATA, "init": Flag(hint="none")},
        ),
        "gain-field": Command(
            """Train gain fields and belief, on the policy part of data.

            For the recogniser in --models, or the one that ships; what is done is kept.

            For example:
                ehar train gain-field --data mine.npz --models models/mine
            """,
            "eval.running.training:train_gain_field",
            show_trained,
            conditions=(*TRAINED, "models", "recogniser", "seed"),
            flags=ON_DATA,
        ),
        "agent": Command(
            """Train agents: il, ppo, il-ppo and dagger.

            For the recogniser in --models, or the one that ships; what is done is kept.

            For example:
                ehar train agent --data mine.npz --models models/mine --stages il,il-ppo
            """,
            "eval.running.training:train_agents",
            show_trained,
            conditions=(*TRAINED, "models", "recogniser"),
            flags={**ON_DATA, "tensorboard": Flag(hint="none")},
        ),
    },
)
CHECK = Group(
    """Check your own planner, recogniser, sensor or motion.

    For example:
        ehar check planner ./spiral.py:Spiral
        ehar check sensor ./mine.py:Blurred
    """,
    {
        "planner": Command(
            """Check that a planner keeps its contract.

            Shapes, independent rows, seed, reset, no peeking, time a step.

            Exit code 0: all passed; 1: a check failed, and how to mend it; 2: it can't run.

            For example:
                ehar check planner ./spiral.py:Spiral --distance 6
            """,
            "eval.conformance.planner:check_planner",
            show_conformance,
            conditions=("data", "models"),
            flags={"planner": Flag(kind=str, positional=True, metavar="PLANNER")},
        ),
        "recogniser": Command(
            """Check that a recogniser keeps its contract.

            Shapes, probabilities, independent rows, states that are forked and reset.

            Exit code 0: all passed; 1: a check failed, and how to mend it; 2: it can't run.

            For example:
                ehar check recogniser ./mine.py:Mine --weights mine.safetensors
            """,
            "eval.conformance.recogniser:check_recogniser",
            show_conformance,
            conditions=("data",),
            flags={"recogniser": Flag(kind=str, default=REQUIRED, positional=True, metavar="RECOGNISER")},
        ),
        "sensor": Command(
            """Check that a sensor keeps its contract.

            Shapes, confidence, independent rows, noise, forks, no peeking, time a frame.

            Exit code 0: all passed; 1: a check failed, and how to mend it; 2: it can't run.

            For example:
                ehar check sensor ./mine.py:Blurred --pixels 8
            """,
            "eval.conformance.sensor:check_sensor",
            show_conformance,
            conditions=("data",),
            flags={"sensor": Flag(kind=str, positional=True, metavar="SENSOR")},
        ),
        "motion": Command(
            """Check that a motion keeps its contract.

            Rest at the start, workspace, targets that are held, independent rows, reset.

            Exit code 0: all passed; 1: a check failed, and how to mend it; 2: it can't run.

            For example:
                ehar check motion ./mine.py:Slow
            """,
            "eval.conformance.motion:check_motion",
            show_conformance,
            conditions=("data", "fps"),
            flags={"motion": Flag(kind=str, positional=True, metavar="MOTION")},
        ),
    },
)
STUDY = Group(
    """Ask what there is to win, what parts are worth, and what planners do.

    For example:
        ehar study headroom --data duo
        ehar study overview runs/duo runs/solo
    """,
    {
        "headroom": Command(
            """Say what there is to win: accuracy of fixed cameras.

            A map of viewpoints and the best of them, beside no-act and the oracles.

            For example:
                ehar study headroom --data duo --out runs/headroom
            """,
            "eval.studies.headroom:headroom",
            show_result,
            conditions=SEEN,
        ),
        "ablation": Command(
            """Say what each part and setting of nbv is worth.

            Its variants run side by side on the same test episodes.

            For example:
                ehar study ablation --data duo --groups horizon effort
            """,
            "eval.studies.ablation:ablation",
            show_result,
            conditions=(*SEEN[:4], "starts", *SEEN[4:]),
            flags={
                "groups": Flag(kind=tuple[str, ...], default=(), metavar="GROUP ...", hint="all"),
                "tracks": Flag(kind=tuple[str, ...], default=(), metavar="TRACK ...", hint="none"),
            },
        ),
        "belief": Command(
            """Score the belief against the recogniser, part by part.

            For example:
                ehar study belief --data duo --sensor estimator
            """,
            "eval.studies.belief:belief_report",
            show_result,
            conditions=(*SEEN[:4], "starts", *SEEN[4:]),
        ),
        "explain": Command(
            """Draw one episode: what views were worth, and where it went.

            For example:
                ehar study explain --data duo --episode 3 --out explain.png
            """,
            "eval.studies.explain:explain",
            show_result,
            conditions=SEEN,
            flags={"out": Flag(default=Path("explain.png"))},
        ),
        "analyse": Command(
            """Analyse a finished run as the paper does.

            Tables of encoders and predictability; figures of views, moves and states.

            For example:
                ehar study analyse runs/mine --states il-ppo/0
            """,
            "eval.studies.analyse:analyse",
            show_result,
            flags={
                "run": RUN,
                "planners": Flag(kind=tuple[str, ...], default=(), metavar="PLANNER ...", hint="il-ppo, or else nbv"),
                "states": Flag(metavar="AGENT", hint="none"),
                "out": Flag(hint="RUN/analysis"),
            },
        ),
        "overview": Command(
            """Show several finished runs side by side.

            One row a planner, one column a run: the share of the gap that it closes.

            For example:
                ehar study overview runs/duo runs/solo --planner nbv
            """,
            "eval.studies.overview:overview",
            show_tables,
            flags={
                "runs": Flag(kind=tuple[Path, ...], positional=True, metavar="RUN ..."),
                "planner": Flag(metavar="PLANNER", hint="none"),
            },
        ),
    },
)
COMMANDS = Group(
    """Embodied human activity recognition: which planner of views recognises earliest?

    For example:
        ehar benchmark --data duo  # all planners, on a synthetic set that ships
        ehar benchmark --help      # its options and examples; so each command
    """,
    {  # what a newcomer needs first stands first
        "benchmark": BENCHMARK,
        "report": Command(
            """Write a finished run as one HTML file, for any browser.

            Tables, figures and replays; it needs neither a server nor a network.

            It runs the files of your own classes that the run names.

            For example:
                ehar report runs/duo-perfect-moving
            """,
            "eval.reports.page:make_report",
            show_path,
            flags={"run": RUN, "out": Flag(hint="RUN/report.html"), **AS_RECORDED},
        ),
        "replay": Command(
            """Show one episode of a finished run as a film.

            The people, the cameras, what these see, and what is believed.

            It runs the files of your own classes that the run names.

            For example:
                ehar replay runs/mine gain
                ehar replay runs/mine 12 --planners nbv il-ppo --out nbv.gif
            """,
            "eval.replays.replay:make_replay",
            show_replay,
            flags={
                "run": RUN,
                "episode": Flag(kind=str, positional=True, metavar="EPISODE"),
                "planners": Flag(
                    kind=tuple[str, ...], default=(), metavar="PLANNER ...", hint="the most accurate, and no-act"
                ),
                "out": Flag(hint="RUN/replay-EPISODE.mp4"),
                **AS_RECORDED,
            },
        ),
        "data": DATA,
        "train": TRAIN,
        "check": CHECK,
        "compare": Command(
            """Compare two finished runs on the same episodes: A minus B.

            For example:
                ehar compare runs/before runs/after
                ehar compare runs/before runs/after --planners nbv il-ppo
            """,
            "eval.studies.compare:compare",
            show_comparison,
            flags={
                "run_a": Flag(kind=Path, positional=True, metavar="A"),
                "run_b": Flag(kind=Path, positional=True, metavar="B"),
                "planners": Flag(
                    kind=tuple[str, ...], default=(), metavar="PLANNER-A PLANNER-B", hint="each with itself"
                ),
            },
        ),
        "verify": Command(
            """Check that a finished run's figures follow from its records.

            And that data and weights are those that it names, by their hashes.

            Exit code 0: verified; 1: the first difference is printed; 2: it can't be read.

            For example:
                ehar verify runs/mine
                ehar verify runs/mine --rerun-episodes 20  # runs files that the run names
            """,
            "eval.verification.verify:verify",
            show_verification,
            flags={"run": RUN, "ideal": Flag(hint="as recorded"), **AS_RECORDED},
        ),
        "study": STUDY,
        "bench": Command(
            """Measure how fast recognition, planning and training are.

            For example:
                ehar bench --out bench.json --report runs/duo-perfect-moving/report.html
            """,
            "eval.speed.bench:bench",
            show_speed,
            flags={"out": Flag(default=REQUIRED), "report": Flag(hint="none")},
        ),
    },
)
