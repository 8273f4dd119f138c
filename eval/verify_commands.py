"""The command that checks a finished run: `ehar verify`."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class VerifyCommand:
    """Check a finished run: recompute all its figures, and compare data, weights and, run once more, episodes.

    Exit code 0: verified; 1: something differs, the first difference is printed; 2: a file cannot be read.
    Example: ehar verify runs/mine --rerun-episodes 20

    Args:
        run: folder of a run of ehar benchmark.
        rerun_episodes: how many episodes to draw and run once more, with those that share a chunk of 32 with them;
            planners and a recogniser of one's own are made again: the files that config.json names are run.
        seed: of that draw.
        data: where the run's data lie now; by default where they lay.
        models: where the run's weights lie now; by default where they lay.
        ideal: where the run lies now that flights were compared with; by default where it lay.
    """

    run: Annotated[Path, tyro.conf.Positional]
    rerun_episodes: int = 0
    seed: int = 0
    data: str | None = None
    models: Path | None = None
    ideal: Path | None = None

    def __call__(self) -> None:
        """Verify the run, print what was checked, and exit with 1 where something differs."""
        from eval.commands import output_console
        from eval.verify import verify

        found = verify(
            self.run,
            data=self.data,
            models=self.models,
            ideal=self.ideal,
            rerun_episodes=self.rerun_episodes,
            seed=self.seed,
        )
        output_console().print(found.table())
        for line in (*found.notes, found.verdict):
            print(line)
        if found.difference is not None:
            sys.exit(1)
