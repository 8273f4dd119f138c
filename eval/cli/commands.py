"""The commands of `ehar`: the function that each command runs, and how its result is printed."""

from collections.abc import Mapping
from inspect import cleandoc
from pathlib import Path
from typing import NamedTuple, Union

from ehar.data.readers import READERS
from eval.cli.command import REQUIRED, Command, Flag
from eval.cli.show import (
    save_data,
    save_stitched,
    show_conformance,
    show_live,
    show_path,
    show_replay,
    show_result,
    show_run,
    show_speed,
    show_table,
    show_tables,
    show_trained,
    show_verification,
)


class CommandGroup(NamedTuple):
    """Commands that share their first words; its text has a first line and examples, as a command's has."""

    text: str
    commands: Mapping[str, Union["CommandGroup", Command]]

    @property
    def help(self) -> str:
        """The text above the list of its commands in its help."""
        return cleandoc(self.text)


RUN = Flag(kind=Path, positional=True, metavar="RUN")  # folder of a finished run
AS_RECORDED = {  # inputs of a finished run
    "data": Flag("present place of the run's data.", kind=str | None, hint="as recorded"),
    "models": Flag("present place of its weights.", hint="as recorded"),
}
SEEN = ("data", "models", "sensor", "views", "seed", "length", "fps", "recogniser", "world")  # conditions of any run
TRAINED = ("data", "sensor", "views", "length", "fps", "world")  # conditions of any training
SENSED = {"sensor": Flag("perfect, estimator (noisy), or your own: file.py:Class.")}
TRAINED_FROM = {  # flags of trainings for a recogniser
    **SENSED,
    "data": Flag(default=REQUIRED),
    "models": Flag("folder of the recogniser, and to write to.", metavar="PATH", hint="ours"),
    "out": Flag("folder to write to instead.", hint="that of --models"),
    "recogniser": Flag("your own: file.py:Class.", hint="ours"),
}
TRAINED_ANEW = {  # flags of trainings of a recogniser
    **SENSED,
    "data": Flag(default=REQUIRED),
    "views": Flag("cameras to train on: moving, paper (32 static), or recorded."),
}


BENCHMARK = Command(
    "eval.running.benchmark:benchmark",
    show_run,
    text="""Run planners on test episodes, and say how well each did.

    For example:
        ehar benchmark --data duo
        ehar benchmark --data mine.npz --models models/mine --out runs/mine
        ehar benchmark ./spiral.py:Spiral --distance 6 no-act oracle
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
        "world": Flag("paper, indoor, or a world's .json."),
        "readout": Flag("what is scored: recogniser or belief."),
        "ideal": Flag("ideal run to compare flights with.", hint="none"),
        "engine": Flag("processes, or ray: a cluster.", kind=str),
        "address": Flag("of a Ray cluster, or auto.", hint="started here"),
        "device": Flag("cpu or cuda."),
    },
)
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
            text="""Print what some data hold, class by class.

            For example:
                ehar data describe mine.npz --figure mine.png
            """,
            flags={"data": Flag(kind=str, positional=True, metavar="DATA"), "figure": Flag(hint="none")},
        ),
        "stitch": Command(
            "ehar.data.stitching:stitch",
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
    },
)
TRAIN = CommandGroup(
    """Train what planners need on data of your own.

    For example:
        ehar train all --data mine.npz --out models/mine
    """,
    {
        "all": Command(
            "eval.running.sweep:train_sets",
            show_trained,
            text="""Train recogniser, gain field, fixed-best, agents, in order.

            What is done is kept; stopped and started again, it goes on.

            Several sets are trained side by side. If one fails, the others go on.

            Exit code 0: all is trained; 1: a stage failed, and which; 2: it can't run.

            For example:
                ehar train all --data mine.npz --out models/mine
                ehar train all --data one.npz two.npz --seeds 0 1 2 --out models
            """,
            conditions=tuple(name for name in TRAINED if name != "data"),
            flags={
                **TRAINED_ANEW,
                "data": Flag(
                    "duo, solo, or a prepared .npz; or several, each to a folder in --out.",
                    kind=tuple[str, ...],
                    default=REQUIRED,
                    metavar="DATA ...",
                ),
                "engine": Flag("processes, or ray: a cluster that shares --out and data.", kind=str),
                "address": Flag("of a Ray cluster, or auto.", hint="started here"),
            },
        ),
        "recogniser": Command(
            "eval.running.training:train_recogniser",
            show_trained,
            text="""Train a recogniser, on the recogniser part of data.

            Stopped and started again, it goes on where it was.

            For example:
                ehar train recogniser --data mine.npz --out models/mine
            """,
            conditions=(*TRAINED, "form", "seed"),
            flags={
                **TRAINED_ANEW,
                "form": Flag("causal streams; ctrgcn, as published, is trained on prefixes."),
                "length": Flag("frames of a clip.", hint="60; streams 4 s"),
                "seed": Flag("seed of initial weights, clips and dropout."),
                "init": Flag(hint="none"),
            },
        ),
        "gain-field": Command(
            "eval.running.training:train_gain_field",
            show_trained,
            text="""Train gain fields and belief, on the policy part of data.

            For the recogniser in --models, or the one that ships; what is done is kept.

            For example:
                ehar train gain-field --data mine.npz --models models/mine
            """,
            conditions=(*TRAINED, "models", "recogniser", "seed"),
            flags={**TRAINED_FROM, "seed": Flag("seed of episodes, forks and noise.")},
        ),
        "fixed-best": Command(
            "eval.running.training:train_fixed_best",
            show_trained,
            text="""Find the place that is best on validation, for fixed-best.

            For the recogniser in --models, or the one that ships. What is done is kept.

            For example:
                ehar train fixed-best --data mine.npz --models models/mine
            """,
            conditions=(*TRAINED, "models", "recogniser", "seed"),
            flags={**TRAINED_FROM, "seed": Flag("seed of start viewpoints and noise.")},
        ),
        "agent": Command(
            "eval.running.training:train_agents",
            show_trained,
            text="""Train il, ppo, il-ppo and dagger; what is done is kept.

            For example:
                ehar train agent --data mine.npz --models models/mine --stages il,il-ppo
            """,
            conditions=(*TRAINED, "models", "form", "recogniser"),
            flags={
                **TRAINED_FROM,
                "views": Flag("of the recogniser: moving, paper or recorded."),
                "form": Flag("of the recogniser; ctrgcn is as published."),
                "stages": Flag("agents, with commas.", hint="all; il,ppo,il-ppo in paper"),
                "setting": Flag("paper takes a GPU, and --views paper --form ctrgcn."),
                "episodes": Flag("demonstrated episodes.", hint="1,536; 10,000 in paper"),
                "frames": Flag("most of PPO.", hint="600,000; 10 million in paper"),
                "variations": Flag("variations of each sequence.", hint="3; 0 in paper"),
                "tensorboard": Flag(hint="none"),
            },
        ),
    },
)
CHECK = CommandGroup(
    """Check your own planner, recogniser, sensor or motion.

    For example:
        ehar check planner ./spiral.py:Spiral
        ehar check sensor ./mine.py:Blurred
    """,
    {
        "planner": Command(
            "eval.conformance.planner:check_planner",
            show_conformance,
            text="""Check that a planner keeps its contract.

            Shapes, independent rows, seed, reset, no peeking, time a step.

            Exit code 0: all passed; 1: a check failed, and how to mend it; 2: it can't run.

            For example:
                ehar check planner ./spiral.py:Spiral --distance 6
            """,
            conditions=("data", "models", "world"),
            flags={
                "planner": Flag(
                    "a name, or your own: file.py:Class or module:Class, then --argument value.",
                    kind=str,
                    positional=True,
                    metavar="PLANNER",
                ),
                "data": Flag("data whose test episodes it runs: duo, solo, or a prepared .npz."),
            },
        ),
        "recogniser": Command(
            "eval.conformance.recogniser:check_recogniser",
            show_conformance,
            text="""Check that a recogniser keeps its contract.

            Shapes, probabilities, independent rows, states that are forked and reset.

            Exit code 0: all passed; 1: a check failed, and how to mend it; 2: it can't run.

            For example:
                ehar check recogniser ./mine.py:Mine --weights mine.safetensors
            """,
            conditions=("data", "world"),
            flags={
                "recogniser": Flag(
                    "your own: file.py:Class or module:Class, then --argument value.",
                    kind=str,
                    positional=True,
                    metavar="RECOGNISER",
                ),
                "data": Flag("data whose test episodes it sees: duo, solo, or a prepared .npz."),
            },
        ),
        "sensor": Command(
            "eval.conformance.sensor:check_sensor",
            show_conformance,
            text="""Check that a sensor keeps its contract.

            Shapes, confidence, independent rows, noise, forks, no peeking, time a frame.

            Exit code 0: all passed; 1: a check failed, and how to mend it; 2: it can't run.

            For example:
                ehar check sensor ./mine.py:Blurred --pixels 8
            """,
            conditions=("data", "world"),
            flags={"sensor": Flag(kind=str, positional=True, metavar="SENSOR")},
        ),
        "motion": Command(
            "eval.conformance.motion:check_motion",
            show_conformance,
            text="""Check that a motion keeps its contract.

            Rest at the start, workspace, targets that are held, independent rows, reset.

            Exit code 0: all passed; 1: a check failed, and how to mend it; 2: it can't run.

            For example:
                ehar check motion ./mine.py:Slow
            """,
            conditions=("data", "fps", "world"),
            flags={"motion": Flag(kind=str, positional=True, metavar="MOTION")},
        ),
    },
)
STUDY = CommandGroup(
    """Study how much views can win, and what each part is worth.

    For example:
        ehar study headroom --data duo
        ehar study overview runs/duo runs/solo
    """,
    {
        "headroom": Command(
            "eval.studies.headroom:headroom",
            show_result,
            text="""Say what there is to win: accuracy of fixed cameras.

            A map of viewpoints and the best of them, beside no-act and the oracles.

            For example:
                ehar study headroom --data duo --out runs/headroom
            """,
            conditions=SEEN,
            flags={
                **SENSED,
                "seed": Flag("seed of start viewpoints and noise."),
                "distance": Flag("distance of the fixed cameras [m].", hint="the middle of the world's"),
            },
        ),
        "ablation": Command(
            "eval.studies.ablation:ablation",
            show_result,
            text="""Say what each part and setting of nbv is worth.

            Its variants run side by side on the same test episodes.

            For example:
                ehar study ablation --data duo --groups horizon effort
            """,
            conditions=(*SEEN[:4], "starts", *SEEN[4:]),
            flags={
                **SENSED,
                "seed": Flag("seed of start viewpoints and noise."),
                "groups": Flag(kind=tuple[str, ...], default=(), metavar="GROUP ...", hint="all"),
                "tracks": Flag(
                    "vehicles that nbv flies too: px4-auto, px4-max, tracking-drone, ground-robot, or files.",
                    kind=tuple[str, ...],
                    default=(),
                    metavar="TRACK ...",
                    hint="none",
                ),
            },
        ),
        "belief": Command(
            "eval.studies.belief.study:belief_report",
            show_result,
            text="""Score the belief against the recogniser, part by part.

            For example:
                ehar study belief --data duo --sensor estimator
                ehar study belief --data solo-stream --models models/solo-stream
            """,
            conditions=(*SEEN[:4], "starts", *SEEN[4:]),
            flags={
                **SENSED,
                "length": Flag("frames of an episode.", hint="60; streams 30 s"),
                "seed": Flag("seed of starts, noise, random, and the halves that parts are fitted on."),
            },
        ),
        "explain": Command(
            "eval.studies.explain:explain",
            show_result,
            text="""Draw one episode: what views were worth, and where it went.

            For example:
                ehar study explain --data duo --episode 3 --out explain.png
            """,
            conditions=SEEN,
            flags={
                **SENSED,
                "seed": Flag("seed of the start viewpoint and noise."),
                "planner": Flag("nbv, nbv-search or nbv-greedy."),
                "episode": Flag("number of the test episode, from 0."),
                "out": Flag(default=Path("explain.png")),
            },
        ),
        "analyse": Command(
            "eval.studies.behaviour.analyse:analyse",
            show_result,
            text="""Analyse a finished run as the paper does.

            Tables of encoders and predictability; figures of views, moves and states.

            For example:
                ehar study analyse runs/mine --states il-ppo/0
            """,
            flags={
                "run": RUN,
                "planners": Flag(
                    "planners to show beside no-act.",
                    kind=tuple[str, ...],
                    default=(),
                    metavar="PLANNER ...",
                    hint="il-ppo, or else nbv",
                ),
                "states": Flag(
                    "agent whose states are mapped, such as il-ppo/0; it runs its episodes again.",
                    metavar="AGENT",
                    hint="none",
                ),
                "out": Flag("folder for analysis.json, analysis.md and figures.", hint="RUN/analysis"),
            },
        ),
        "trainings": Command(
            "eval.studies.trainings:trainings",
            show_result,
            text="""Take runs of several trainings together, in one table.

            Means over trainings of recogniser and gain field, and how far they lie apart.

            For example:
                ehar study trainings runs/duo-0 runs/duo-1 runs/duo-2
            """,
            flags={
                "runs": Flag(
                    "folders of runs with the same episodes and conditions, and other weights.",
                    kind=tuple[Path, ...],
                    positional=True,
                    metavar="RUN ...",
                    hint="at least two",
                ),
                "planner": Flag("planner to compare with each other one.", metavar="PLANNER"),
                "out": Flag("folder for table.md and summary.json.", hint="none"),
            },
        ),
        "decide": Command(
            "eval.studies.deciding.decide:decide",
            show_result,
            text="""Say when to answer, if waiting costs.

            Each activity is answered once. Accuracy against time, for four rules.

            For example:
                ehar study decide runs/mine --fitted-on runs/mine-validation
            """,
            flags={
                "run": RUN,
                "fitted_on": Flag(
                    "run on another part (--part validation or policy), to fit the rules on.", metavar="RUN"
                ),
                "planners": Flag(
                    "planners to show.",
                    kind=tuple[str, ...],
                    default=(),
                    metavar="PLANNER ...",
                    hint="no-act, nbv and oracle, as far as they ran",
                ),
                "data": AS_RECORDED["data"],
                "out": Flag("folder for table.md and the picture.", hint="none"),
            },
        ),
        "learning": Command(
            "eval.studies.learning:learning",
            show_result,
            text="""Show what is left to win, the longer the recogniser learned.

            For runs whose recognisers saw more or fewer training clips.

            For example:
                ehar study learning runs/duo-15k runs/duo-60k runs/duo --out runs/learning
            """,
            flags={
                "runs": Flag(
                    "folders of runs with the same episodes and conditions, and other clips of training.",
                    kind=tuple[Path, ...],
                    positional=True,
                    metavar="RUN ...",
                    hint="at least two",
                ),
                "planner": Flag("planner to show.", metavar="PLANNER"),
                "out": Flag("folder for table.md and the picture.", hint="none"),
            },
        ),
        "published": Command(
            "eval.studies.published:published",
            show_result,
            text="""Hold both forms to published figures, by their protocol.

            3D joints, the data's own split; joints, bones and both together.

            For example:
                ehar study published nwucla.npz --out runs/published
            """,
            flags={
                "data": Flag(positional=True, metavar="FILE.npz"),
                "size": Flag("widths: small, half or published."),
                "seeds": Flag(
                    "seeds of the trainings of each form and stream.", kind=tuple[int, ...], metavar="SEED ..."
                ),
                "epochs": Flag("epochs of each training."),
                "device": Flag("torch device."),
                "threads": Flag("CPU threads of torch.", hint="torch decides"),
                "out": Flag("folder for results and checkpoints.", kind=Path, default=REQUIRED),
            },
        ),
        "real-views": Command(
            "eval.studies.real_views.study:real_views",
            show_result,
            text="""Ask whether what is simulated holds for real cameras.

            For executions that several real cameras recorded at once.

            For example:
                ehar study real-views nwucla.npz --out runs/real-views
            """,
            flags={
                "data": Flag(positional=True, metavar="FILE.npz"),
                "length": Flag("frames of a window."),
                "clips": Flag("the most training clips of each recogniser."),
                "threads": Flag("CPU threads of torch.", hint="torch decides"),
                "out": Flag("folder for results and recognisers.", kind=Path, default=REQUIRED),
            },
        ),
        "paper": Command(
            "eval.studies.paper:paper",
            show_tables,
            text="""Show the paper's Tables 1 to 4 of finished runs.

            Every planner, learned ones over their trainings; and where Figures 5 to 7 are.

            For example:
                ehar study paper runs/duo-paper runs/duo-encoders --out tables.md
            """,
            flags={"runs": Flag(kind=tuple[Path, ...], positional=True, metavar="RUN ...", hint="at least one")},
        ),
        "overview": Command(
            "eval.studies.overview:overview",
            show_tables,
            text="""Show several finished runs side by side.

            One row a planner, one column a run: the share of the gap that it closes.

            For example:
                ehar study overview runs/duo runs/solo --planner nbv
            """,
            flags={
                "runs": Flag(kind=tuple[Path, ...], positional=True, metavar="RUN ...", hint="at least one"),
                "planner": Flag(metavar="PLANNER", hint="none"),
            },
        ),
    },
)
LIVE = Command(
    "eval.live.start:live",
    show_live,
    text="""Watch people live, and say where a drone should fly.

    Frames of a pose estimator in, a JSON object a line; setpoints out.

    For example:
        ehar live --models models/mine --source udp:127.0.0.1:5005
        ehar live --models models/mine --rehearse mine.npz --page 8000
    """,
    flags={
        "models": Flag(default=REQUIRED, metavar="PATH"),
        "belief": Flag(hint="believe the recogniser"),
        "mavlink": Flag(metavar="ADDRESS", hint="none"),
        "origin": Flag(metavar="EAST NORTH UP"),
        "page": Flag(metavar="PORT", hint="none"),
        "rehearse": Flag(metavar="DATA", hint="none"),
    },
)
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
                "models": Flag("recogniser of solo-stream, to see how soon it lets go.", metavar="PATH", hint="none"),
            },
        ),
    },
)
