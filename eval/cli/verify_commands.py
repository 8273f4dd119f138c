"""The command that checks a finished run: `ehar verify`."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from eval.cli.options import AS_RECORDED


@dataclass(frozen=True)
class VerifyCommand:
    """Check that a finished run's figures follow from its records.

    And that data and weights are those that it names, by their hashes.

    Exit code 0: verified; 1: the first difference is printed; 2: it can't be read.

    For example:
        ehar verify runs/mine
        ehar verify runs/mine --rerun-episodes 20  # runs files that the run names

    Args:
        run: folder of a finished run.
        rerun_episodes: how many to draw and run once more, each with its chunk of 32.
        seed: of that draw.
        data: where the run's data lie now.
        models: where its weights lie now.
        ideal: where the run on the ideal track lies now, for a run in flight.
    """

    run: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    rerun_episodes: int = 0
    seed: int = 0
    data: Annotated[str | None, AS_RECORDED] = None
    models: Annotated[Path | None, AS_RECORDED] = None
    ideal: Annotated[Path | None, AS_RECORDED] = None

    def __call__(self) -> None:
        """Verify the run, print what was checked, and exit with 1 where something differs."""
        from eval.render.console import print_tables
        from eval.verification.verify import verify

        found = verify(
            self.run,
            data=self.data,
            models=self.models,
            ideal=self.ideal,
            rerun_episodes=self.rerun_episodes,
            seed=self.seed,
        )
        print_tables(found.table)
        for line in (*found.notes, found.verdict):
            print(line)
        if found.difference is not None:
            sys.exit(1)
