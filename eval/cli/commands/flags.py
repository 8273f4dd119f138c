"""Flags that several commands share."""

from pathlib import Path

from eval.cli.command import OF_SENSOR, REQUIRED, Flag

RUN = Flag(kind=Path, positional=True, metavar="RUN")  # folder of a finished run
AS_RECORDED = {  # inputs of a finished run
    "data": Flag("present place of the run's data.", kind=str | None, hint="as recorded"),
    "models": Flag("present place of its weights.", hint="as recorded"),
}
SEEN = ("data", "models", "sensor", "views", "seed", "length", "fps", "recogniser", "world")  # conditions of any run
TRAINED = ("data", "sensor", "views", "length", "fps", "world")  # conditions of any training
SENSED = {"sensor": Flag("perfect, estimator or file.py:Class.", hint=OF_SENSOR)}
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
    "in_the_way": Flag("things hide joints in half of the clips."),
}
