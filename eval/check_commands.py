"""The conformance commands: do a planner or a recogniser of one's own do what the benchmark relies on?"""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from tyro.conf import arg, subcommand


@dataclass(frozen=True)
class CheckPlanner:
    """Check a planner: shapes, independent rows, its seed, its reset, no peeking, time a step.

    Exits with 1 if a check fails. For example: ehar check planner ./spiral.py:Spiral --radius 6

    Args:
        planner: a name, or your own: file.py:Class or module:Class, then --argument value.
        data: whose test episodes it acts in: duo, solo, or the path of a prepared .npz.
        models: folder of weights, for a prepared .npz.
    """

    planner: Annotated[str, tyro.conf.Positional, arg(metavar="PLANNER")]
    data: str = "duo"
    models: Path | None = None

    def __call__(self) -> None:
        """Check, and print what was found."""
        from eval.check_planner import check_planner

        found = check_planner(self.planner, data=self.data, models=self.models)
        print(found)
        sys.exit(0 if found.passed else 1)


@dataclass(frozen=True)
class CheckRecogniser:
    """Check a recogniser: shapes, probabilities, independent rows, states that are forked, reset and kept.

    Exits with 1 if a check fails. For example: ehar check recogniser ./mine.py:Mine --weights mine.safetensors

    Args:
        recogniser: your own: file.py:Class or module:Class, then --argument value.
        data: whose test episodes it sees: duo, solo, or the path of a prepared .npz.
    """

    recogniser: Annotated[str, tyro.conf.Positional, arg(metavar="RECOGNISER")]
    data: str = "duo"

    def __call__(self) -> None:
        """Check, and print what was found."""
        from eval.check_recogniser import check_recogniser

        found = check_recogniser(self.recogniser, data=self.data)
        print(found)
        sys.exit(0 if found.passed else 1)


@dataclass(frozen=True)
class CheckCommand:
    """Check that a planner or a recogniser of your own does what the benchmark relies on."""

    action: Annotated[
        Annotated[CheckPlanner, subcommand("planner")] | Annotated[CheckRecogniser, subcommand("recogniser")],
        arg(name=""),
    ]

    def __call__(self) -> None:
        """Run the checks."""
        self.action()
