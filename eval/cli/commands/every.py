"""All commands of `ehar`, by their words."""

from pathlib import Path

from eval.cli.command import REQUIRED, Command, Flag
from eval.cli.commands.benchmark import BENCHMARK
from eval.cli.commands.check import CHECK
from eval.cli.commands.data import DATA
from eval.cli.commands.flags import AS_RECORDED, RUN
from eval.cli.commands.group import CommandGroup
from eval.cli.commands.live import LIVE
from eval.cli.commands.study import STUDY
from eval.cli.commands.train import TRAIN
from eval.cli.show import show_path, show_replay, show_result, show_speed, show_verification

COMMANDS = CommandGroup(
    """Embodied human activity recognition: which planner of views recognises earliest?

    For example:
        ehar benchmark --data duo  # all planners, on a synthetic set that ships
        ehar benchmark --help      # its options and examples; so each command
    """,
    {  # what a newcomer needs first stands first
        "benchmark": BENCHMARK,
        "report": Command(
            "eval.reports.page:make_report",
            show_path,
            text="""Write a finished run as one HTML file, for any browser.

            Tables, figures and replays; it needs neither a server nor a network.

            It runs the files of your own classes that the run names.

            For example:
                ehar report runs/duo-perfect-moving
            """,
            flags={"run": RUN, "out": Flag("file to write.", hint="RUN/report.html"), **AS_RECORDED},
        ),
        "replay": Command(
            "eval.replays.replay:make_replay",
            show_replay,
            text="""Show one episode of a finished run as a film.

            It shows the people, the cameras, their views, and the beliefs.

            It runs the files of your own classes that the run names.

            For example:
                ehar replay runs/mine gain
                ehar replay runs/mine 12 --planners nbv il-ppo --out nbv.gif
            """,
            flags={
                "run": RUN,
                "episode": Flag(
                    "number, from 0; or gain, loss or typical, for the first planner against the second.",
                    kind=str,
                    positional=True,
                    metavar="EPISODE",
                ),
                "planners": Flag(
                    "one or two planners; il-ppo/3 is one of several trainings.",
                    kind=tuple[str, ...],
                    default=(),
                    metavar="PLANNER ...",
                    hint="the most accurate, and no-act",
                ),
                "out": Flag("film to write, .mp4 or .gif, or recording, .rrd.", hint="RUN/replay-EPISODE.mp4"),
                "slower": Flag("times slower than life; 1 is as in life.", hint="4; of a stream 1"),
                "since": Flag("second of the episode to begin at."),
                "until": Flag("second to end at.", hint="the end; of a stream 30 s later"),
                "rerun": Flag("write a recording for Rerun's viewer instead; needs rerun-sdk."),
                **AS_RECORDED,
            },
        ),
        "live": LIVE,
        "data": DATA,
        "train": TRAIN,
        "check": CHECK,
        "compare": Command(
            "eval.studies.compare:compare",
            show_result,
            text="""Compare two finished runs on the same episodes: A minus B.

            For example:
                ehar compare runs/before runs/after
                ehar compare runs/before runs/after --planners nbv il-ppo
            """,
            flags={
                "run_a": Flag("folder of a finished run.", kind=Path, positional=True, metavar="A"),
                "run_b": Flag(
                    "folder of another run, with the same data, starts, seed, length and sensor.",
                    kind=Path,
                    positional=True,
                    metavar="B",
                ),
                "planners": Flag(
                    "a planner of A and a planner of B.",
                    kind=tuple[str, ...],
                    default=(),
                    metavar="PLANNER-A PLANNER-B",
                    hint="each with itself",
                ),
                "out": Flag("folder for table.md.", hint="none"),
            },
        ),
        "verify": Command(
            "eval.verification.verify:verify",
            show_verification,
            text="""Check that a finished run's figures follow from its records.

            It also checks the hashes of its data and weights.

            Exit code 0: verified; 1: the first difference is printed; 2: it can't be read.

            For example:
                ehar verify runs/mine
                ehar verify runs/mine --rerun-episodes 20  # runs files that the run names
            """,
            flags={
                "run": RUN,
                **AS_RECORDED,
                "ideal": Flag("for a flight: present folder of its run on the ideal track.", hint="as recorded"),
            },
        ),
        "study": STUDY,
        "bench": Command(
            "eval.speed.bench:bench",
            show_speed,
            text="""Measure how fast recognition, planning and training are.

            For example:
                ehar bench --out bench.json --report runs/duo-perfect-moving/report.html
            """,
            flags={
                "out": Flag(".json to write.", default=REQUIRED),
                "report": Flag("report.html to open too; takes chromium, and playwright from ehar[dev].", hint="none"),
                "models": Flag("recogniser of solo-stream, to see how soon it lets go.", metavar="PATH", hint="ours"),
                "device": Flag("cuda: measure a GPU alone."),
            },
        ),
    },
)
