"""The command `ehar replay`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import FlagCreatePairsOff, Positional, arg

from eval.cli.options import AS_RECORDED


@dataclass(frozen=True)
class ReplayCommand:
    """Show one episode of a finished run as a film.

    The people, the cameras, what these see, and what is believed.

    Of planners and recognisers of one's own it runs the files that the run names.

    For example:
        ehar replay runs/mine gain
        ehar replay runs/mine 12 --planners nbv il-ppo --out nbv.gif

    Args:
        run: folder of a finished run.
        episode: its number, from 0; or gain, loss or typical: of the first planner against the second.
        planners: one or two; il-ppo/3 is one of several trainings.
        out: film to write, .mp4 or .gif, or recording, .rrd.
        slower: than life, so many times; 1 is life.
        data: where the run's data lie now.
        models: where its weights lie now.
        rerun: write a recording for Rerun's viewer instead; needs rerun-sdk.
    """

    run: Annotated[Path, Positional, arg(metavar="RUN")]
    episode: Annotated[str, Positional, arg(metavar="EPISODE")]
    planners: Annotated[
        tuple[str, ...], arg(metavar="PLANNER ...", help_behavior_hint="(default: the most accurate, and no-act)")
    ] = ()
    out: Annotated[Path | None, arg(help_behavior_hint="(default: RUN/replay-EPISODE.mp4)")] = None
    slower: float = 4.0
    data: Annotated[str | None, AS_RECORDED] = None
    models: Annotated[Path | None, AS_RECORDED] = None
    rerun: Annotated[bool, FlagCreatePairsOff] = False

    def __call__(self) -> None:
        """Write the film or the recording, and say what it shows and where it is."""
        from eval.replays.replay import make_replay

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
