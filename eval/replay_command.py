"""The command `ehar replay`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class ReplayCommand:
    """Show one episode of a finished run as a film: people, cameras, what they see, and what is believed.

    Planners and a recogniser of one's own are made again: the files that config.json names are run.

    For example:

    ehar replay runs/duo-perfect-moving gain --planners nbv il-ppo --out nbv.gif

    Args:
        run: folder of a run of ehar benchmark.
        episode: its number, from 0, as in episodes.jsonl; or gain, loss or typical: where the first planner gains most
            or loses most against the second, or is at its median.
        planners: one or two; il-ppo is its first training, il-ppo/3 another. By default the most accurate one that is
            not handed the truth, and no-act.
        out: the film to write, .mp4 or .gif; by default replay-EPISODE.mp4 in the run's folder.
        slower: than life, so many times; 1 is life.
        data: where the run's data lie now; by default where they lay.
        models: where the run's weights lie now; by default where they lay.
        rerun: write a recording for Rerun's viewer (.rrd), not a film; needs rerun-sdk.
    """

    run: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    episode: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="EPISODE")]
    planners: tuple[str, ...] = ()
    out: Path | None = None
    slower: float = 4.0
    data: str | None = None
    models: Path | None = None
    rerun: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False

    def __call__(self) -> None:
        """Write the film or the recording, and say what it shows and where it is."""
        from eval.replay import make_replay

        written = make_replay(
            self.run,
            self.episode,
            planners=self.planners,
            out=self.out,
            slower=self.slower,
            data=self.data,
            models=self.models,
            rerun=self.rerun,
        )
        print("; ".join([f"episode {written.episode}, {' and '.join(written.planners)}", *written.why]))
        print(f"written to {written.path}")
