"""The conformance commands: do a planner or a recogniser of one's own do what the benchmark relies on?"""

import sys
from dataclasses import dataclass
from typing import Annotated

import tyro
from tyro.conf import arg

from eval.cli.options import Models


@dataclass(frozen=True)
class CheckPlanner:
    """Check that a planner keeps its contract.

    Shapes, independent rows, seed, reset, no peeking, time a step.

    Exit code 0: all passed; 1: a check failed, and how to mend it; 2: it can't run.

    For example:
        ehar check planner ./spiral.py:Spiral --distance 6

    Args:
        planner: a name, or your own: file.py:Class or module:Class, then --argument value.
        data: in whose test episodes it acts: duo, solo, or a prepared .npz.
        models: folder of weights.
    """

    planner: Annotated[str, tyro.conf.Positional, arg(metavar="PLANNER")]
    data: str = "duo"
    models: Models = None

    def __call__(self) -> None:
        """Check, and print what was found."""
        from eval.conformance.planner import check_planner

        found = check_planner(self.planner, data=self.data, models=self.models)
        print(found)
        sys.exit(0 if found.passed else 1)


@dataclass(frozen=True)
class CheckRecogniser:
    """Check that a recogniser keeps its contract.

    Shapes, probabilities, independent rows, states that are forked and reset.

    Exit code 0: all passed; 1: a check failed, and how to mend it; 2: it can't run.

    For example:
        ehar check recogniser ./mine.py:Mine --weights mine.safetensors

    Args:
        recogniser: your own: file.py:Class or module:Class, then --argument value.
        data: whose test episodes it sees: duo, solo, or a prepared .npz.
    """

    recogniser: Annotated[str, tyro.conf.Positional, arg(metavar="RECOGNISER")]
    data: str = "duo"

    def __call__(self) -> None:
        """Check, and print what was found."""
        from eval.conformance.recogniser import check_recogniser

        found = check_recogniser(self.recogniser, data=self.data)
        print(found)
        sys.exit(0 if found.passed else 1)
