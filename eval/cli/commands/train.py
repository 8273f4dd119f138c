"""`ehar train`: recognisers, gain fields, places and agents."""

from eval.cli.command import REQUIRED, Command, Flag
from eval.cli.commands.flags import TRAINED, TRAINED_ANEW, TRAINED_FROM
from eval.cli.commands.group import CommandGroup
from eval.cli.show import show_trained

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
