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
            conditions=(*(name for name in TRAINED if name != "data"), "seed"),
            flags={
                **TRAINED_ANEW,
                "data": Flag(
                    "a built-in set or a prepared .npz, in clips or in streams; or several, each to a folder in --out.",
                    kind=tuple[str, ...],
                    default=REQUIRED,
                    metavar="DATA ...",
                ),
                "length": Flag("frames of an episode.", hint="60; streams 4 s or 8 s"),
                "seed": Flag("seed of recogniser, field and fixed-best."),
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
                "clips": Flag("the most training clips; adamw stops once it has learned."),
                "interval": Flag("clips between checkpoints, and first evaluations."),
                "init": Flag(".safetensors of the same shape to start from.", hint="none"),
                "folds": Flag("groups of people left out to calibrate on."),
                "planned": Flag(
                    "runs whose planners show where to look.",
                    metavar="RUN",
                    hint="none",
                ),
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
            conditions=(*TRAINED, "track", "models", "recogniser", "seed"),
            flags={
                **TRAINED_FROM,
                "track": Flag("ideal, or a vehicle in which paths are flown."),
                "length": Flag("frames of an episode.", hint="60; streams 8 s, flown 9 s"),
                "seed": Flag("seed of episodes, forks and noise."),
            },
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
            flags={
                **TRAINED_FROM,
                "length": Flag("frames of an episode.", hint="60; streams 8 s"),
                "seed": Flag("seed of start viewpoints and noise."),
            },
        ),
        "agent": Command(
            "eval.running.training:train_agents",
            show_trained,
            text="""Train il, ppo, il-ppo and dagger; what is done is kept.

            For example:
                ehar train agent --data mine.npz --models models/mine --stages il,il-ppo
            """,
            conditions=(*TRAINED, "track", "models", "form", "recogniser"),
            flags={
                **TRAINED_FROM,
                "track": Flag("ideal, or a vehicle in which teachers and agents fly."),
                "length": Flag("frames of an episode.", hint="60; streams 8 s"),
                "views": Flag("moving, paper or recorded cameras."),
                "form": Flag("of the recogniser; ctrgcn is as published."),
                "stages": Flag("agents, with commas.", hint="all; no dagger in paper"),
                "seeds": Flag(metavar="INT ..."),
                "setting": Flag("paper takes a GPU, and --views paper --form ctrgcn."),
                "episodes": Flag("demonstrated.", hint="1,536; streams 384; paper 10,000"),
                "frames": Flag("most of PPO.", hint="600,000; streams 2.4 M; paper 10 M"),
                "variations": Flag("variations of each sequence.", hint="3; 0 in paper"),
                "tensorboard": Flag(hint="none"),
            },
        ),
    },
)
