"""The commands that explain and take apart the planners that value views: `ehar explain`, `ablation`, `belief`."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from ehar.processes import cores
from eval.cli.options import Fps, Models, Out
from eval.render.console import print_tables


@dataclass(frozen=True)
class Explain:
    """Draw one episode: what views were worth, and where it went.

    For example:
        ehar explain --data duo --episode 3 --out explain.png

    Args:
        data: duo, solo, or a prepared .npz.
        models: folder of weights.
        sensor: perfect (exact joints) or estimator (noisy joints).
        views: cameras the recogniser was trained on: moving or paper.
        planner: nbv, nbv-search or nbv-greedy.
        episode: which of the test episodes, counted from 0.
        frames: how many moments to show, from 10 to 90 % of the episode.
        seed: of the start viewpoint and noise.
        length: frames of an episode.
        fps: frame rate to resample to [Hz].
        out: the picture to write: .png, .svg or .pdf.
    """

    data: str = "duo"
    models: Models = None
    sensor: str = "perfect"
    views: str = "moving"
    planner: str = "nbv"
    episode: int = 0
    frames: int = 4
    seed: int = 0
    length: int = 60
    fps: Fps = None
    out: Path = Path("explain.png")

    def __call__(self) -> None:
        """Run the episode, draw it, and print its table."""
        from eval.studies.explain import explain
        from eval.studies.explain_figure import check_format, draw_explanation
        from eval.studies.explanation import explain_table

        check_format(self.out)
        explanation = explain(
            data=self.data,
            models=self.models,
            sensor=self.sensor,
            views=self.views,
            planner=self.planner,
            episode=self.episode,
            frames=self.frames,
            seed=self.seed,
            length=self.length,
            fps=self.fps,
        )
        draw_explanation(explanation, self.out)
        print_tables(explain_table(explanation))
        print(f"drawn in {self.out}")


@dataclass(frozen=True)
class BeliefCommand:
    """Score the belief against the recogniser, part by part.

    For example:
        ehar belief --data duo --sensor estimator

    Args:
        data: duo, solo, or a prepared .npz.
        models: folder of weights.
        sensor: perfect (exact joints) or estimator (noisy joints).
        views: cameras the recogniser was trained on: moving or paper.
        starts: start viewpoints of each scenario.
        seed: of start viewpoints, noise, random, and the halves that parts are fitted on.
        length: frames of an episode.
        fps: frame rate to resample to [Hz].
        out: folder for config.json, belief.json and table.md.
    """

    data: str = "duo"
    models: Models = None
    sensor: str = "perfect"
    views: str = "moving"
    starts: int = 1
    seed: int = 0
    length: int = 60
    fps: Fps = None
    out: Out = None

    def __call__(self) -> None:
        """Run the episodes and print the tables."""
        from eval.studies.belief import belief_report, belief_tables

        report = belief_report(
            data=self.data,
            models=self.models,
            sensor=self.sensor,
            views=self.views,
            starts=self.starts,
            seed=self.seed,
            length=self.length,
            fps=self.fps,
            out=self.out,
        )
        print_tables(*belief_tables(report))


@dataclass(frozen=True)
class AblationCommand:
    """Say what each part and setting of nbv is worth.

    Its variants run side by side on the same test episodes.

    For example:
        ehar ablation --data duo --groups horizon effort

    Args:
        data: duo, solo, or a prepared .npz.
        models: folder of weights.
        sensor: perfect (exact joints) or estimator (noisy joints).
        views: cameras the recogniser was trained on: moving or paper.
        groups: of variants: knowledge, horizon, replan, effort, solver, search.
        tracks: that nbv flies as well: px4-auto, px4-max, tracking-drone, or vehicle files.
        starts: start viewpoints of each scenario.
        seed: of start viewpoints and noise.
        length: frames of an episode.
        fps: frame rate to resample to [Hz].
        out: folder for config.json, episodes.jsonl, summary.json and table.md.
        workers: processes; numbers do not depend on it.
    """

    data: str = "duo"
    models: Models = None
    sensor: str = "perfect"
    views: str = "moving"
    groups: Annotated[tuple[str, ...], arg(metavar="GROUP ...", help_behavior_hint="(default: all)")] = ()
    tracks: Annotated[tuple[str, ...], arg(metavar="TRACK ...", help_behavior_hint="(default: none)")] = ()
    starts: int = 1
    seed: int = 0
    length: int = 60
    fps: Fps = None
    out: Out = None
    workers: int = field(default_factory=cores)

    def __call__(self) -> None:
        """Run the variants and print the tables."""
        from eval.studies.ablation import GROUPS, ablation, ablation_tables

        result = ablation(
            data=self.data,
            models=self.models,
            sensor=self.sensor,
            views=self.views,
            groups=self.groups or GROUPS,
            tracks=self.tracks,
            starts=self.starts,
            seed=self.seed,
            length=self.length,
            fps=self.fps,
            out=self.out,
            workers=self.workers,
        )
        print_tables(*ablation_tables(result))
