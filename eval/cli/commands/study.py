"""`ehar study`: a question each."""

from pathlib import Path

from eval.cli.command import REQUIRED, Command, Flag
from eval.cli.commands.flags import AS_RECORDED, RUN, SEEN, SENSED
from eval.cli.commands.group import CommandGroup
from eval.cli.show import show_result, show_tables

STUDY = CommandGroup(
    """Study how much views can win, and what each part is worth.

    For example:
        ehar study headroom --data duo
        ehar study overview runs/duo runs/solo
    """,
    {
        "headroom": Command(
            "eval.studies.headroom.study:headroom",
            show_result,
            text="""Say what there is to win: accuracy of fixed cameras.

            A map of viewpoints, the best of them beside no-act and the oracles.

            A map of each class, and what it is worth to know the class.

            For example:
                ehar study headroom --data duo --out runs/headroom
            """,
            conditions=SEEN,
            flags={
                "data": Flag("duo, solo, or a prepared .npz of clips."),
                "world": Flag("paper, indoor, or a world file (.json) with nothing in the way."),
                "sensor": Flag("perfect, estimator or file.py:Class.", hint="perfect"),
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
                ehar study ablation --data solo-stream --groups knowledge
            """,
            conditions=(*SEEN[:4], "starts", *SEEN[4:]),
            flags={
                **SENSED,
                "length": Flag("frames of an episode.", hint="60; streams 30 s"),
                "seed": Flag("seed of start viewpoints and noise."),
                "groups": Flag(kind=tuple[str, ...], metavar="GROUP ...", hint="all"),
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
                "length": Flag("frames of an episode.", hint="60; streams 30 s"),
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
            text="""Take runs of several trainings together, as one run.

            Means over trainings of recogniser and gain field, and how far they lie apart.

            Of streams also what ehar study belief wrote of each training.

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
                "out": Flag("folder for the run, which other commands take as any.", hint="none"),
            },
        ),
        "folds": Command(
            "eval.studies.folds:take_together",
            show_result,
            text="""Take runs of several folds together, as one run.

            Everybody is tested once, by a recogniser that has not learned from them.

            Of streams also what ehar study belief wrote of each fold.

            For example:
                ehar study folds runs/mine-0 runs/mine-1 runs/mine-2 --out runs/mine
            """,
            flags={
                "runs": Flag(
                    "folders of runs under the same conditions, on the test parts of folds.",
                    kind=tuple[Path, ...],
                    positional=True,
                    metavar="RUN ...",
                    hint="at least two",
                ),
                "ideal": Flag("a run of the same folds on the ideal track, to compare flights with.", hint="none"),
                "out": Flag("folder for the run, which other commands take as any.", hint="none"),
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
                    "run on another part (--part validation or policy), to fit the rules on.",
                    metavar="RUN",
                    hint="of folds each other",
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
                "forms": Flag("ctrgcn, causal or both.", kind=tuple[str, ...], metavar="FORM ..."),
                "streams": Flag("joint, bone, or both and their ensemble.", kind=tuple[str, ...], metavar="STREAM ..."),
                "epochs": Flag("epochs of each training."),
                "device": Flag("torch device."),
                "threads": Flag("CPU threads of torch.", hint="torch decides"),
                "out": Flag("folder for results and checkpoints.", kind=Path, default=REQUIRED),
            },
        ),
        "trials": Command(
            "eval.studies.trials.study:trials",
            show_result,
            text="""Say what each part of a recogniser's training is worth.

            One thing is changed at a time. People who were left out of the training decide.

            For example:
                ehar study trials solo mine.npz --clips 12000 --out runs/trials
            """,
            flags={
                "data": Flag(
                    "built-in sets or prepared .npz.",
                    kind=tuple[str, ...],
                    positional=True,
                    metavar="DATA ...",
                    hint="at least one",
                ),
                "sensor": Flag("perfect or estimator."),
                "folds": Flag("groups in which people are left out."),
                "only": Flag(
                    "numbers of the folds to train now, from 0.",
                    kind=tuple[int, ...],
                    default=(),
                    metavar="FOLD ...",
                    hint="all",
                ),
                "changes": Flag(
                    'what to change now, such as "varied motion".',
                    kind=tuple[str, ...],
                    default=(),
                    metavar="NAME ...",
                    hint="everything",
                ),
                "clips": Flag(
                    "training clips of each trial: for all sets, or for each.",
                    kind=tuple[int, ...],
                    metavar="INT ...",
                    hint="12000",
                ),
                "device": Flag("torch device."),
                "threads": Flag("CPU threads of torch.", hint="torch decides"),
                "out": Flag("folder for results; what is done is kept.", kind=Path, default=REQUIRED),
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
        "scaling": Command(
            "eval.studies.scaling.forecast:scaling",
            show_result,
            text="""Say how long commands take on many machines.

            And what the jobs of finished runs took. `make left` asks it.

            For example:
                ehar study scaling runs/mine
                make -n pages | ehar study scaling --commands - --machines 4 16 64
            """,
            flags={
                "runs": Flag(
                    "folders of finished runs, whose jobs tell what planners take.",
                    kind=tuple[Path, ...],
                    default=(),
                    positional=True,
                    metavar="[RUN ...]",
                    hint="as measured on solo",
                ),
                "commands": Flag(metavar="FILE", hint="none"),
                "machines": Flag(kind=tuple[int, ...], metavar="COUNT ..."),
                "step": Flag(
                    "time of a core for a step of a recogniser's training on one person [s].", hint="one is timed"
                ),
            },
        ),
        "engines": Command(
            "eval.studies.scaling.engines:engines",
            show_result,
            text="""Say how much longer Ray takes than processes.

            The same benchmark by both, in turn, on a machine that is idle else.

            For example:
                ehar study engines --data solo --sensor estimator
                ehar study engines no-act nbv oracle --data solo-stream --sensor estimator
            """,
            conditions=(*SEEN[:4], "starts", *SEEN[4:]),
            flags={
                **SENSED,
                "planners": Flag(
                    "names.", kind=tuple[str, ...] | None, positional=True, metavar="[PLANNER ...]", hint="all of ours"
                ),
                "length": Flag("frames of an episode.", hint="60; streams 30 s"),
                "seed": Flag("seed of starts, noise and random."),
            },
        ),
        "overview": Command(
            "eval.studies.overview:overview",
            show_tables,
            text="""Show several finished runs side by side.

            One row a planner, one column a run: the share of the gap that it closes.

            Where no oracle ran, its accuracy.

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
