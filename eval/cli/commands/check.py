"""`ehar check`: does your own part keep its contract?"""

from eval.cli.command import Command, Flag
from eval.cli.commands.group import CommandGroup
from eval.cli.show import show_conformance

CLIPS = "data whose test clips it is tried on: duo, solo, or a prepared .npz that is no stream."

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
                ehar check planner ./spiral.py:Spiral
            """,
            conditions=("data", "models", "world"),
            flags={
                "planner": Flag(
                    "a name, or your own: file.py:Class or module:Class, then --argument value.",
                    kind=str,
                    positional=True,
                    metavar="PLANNER",
                ),
                "data": Flag("data whose test episodes it runs: a built-in set or a prepared .npz."),
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
                "data": Flag(CLIPS),
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
            flags={"sensor": Flag(kind=str, positional=True, metavar="SENSOR"), "data": Flag(CLIPS)},
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
            flags={"motion": Flag(kind=str, positional=True, metavar="MOTION"), "data": Flag(CLIPS)},
        ),
    },
)
