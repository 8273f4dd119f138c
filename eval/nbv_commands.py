"""The commands that explain and take apart the planners that value views: `ehar explain`, `ablation`, `belief`."""

from dataclasses import dataclass, field
from pathlib import Path

from ehar.cores import cores
from eval.commands import output_console
from eval.tables import Rendered


@dataclass(frozen=True)
class Explain:
    """Draw one episode: what each view was worth, what was believed, and where the planner went.

    Args:
        data: duo, solo, or the path of a prepared .npz.
        models: folder of recogniser and gain field; by default those that ship, for duo and solo.
        sensor: perfect or estimator.
        views: the cameras the recogniser was trained on, moving or paper.
        planner: nbv, nbv-search or nbv-greedy.
        episode: which of the test scenarios, counted from 0.
        frames: how many moments to show, from 10 to 90 % of the episode.
        seed: of the start viewpoint and noise.
        length: frames in an episode.
        fps: frame rate to resample to.
        out: the picture to write: .png, .svg or .pdf.
    """

    data: str = "duo"
    models: Path | None = None
    sensor: str = "perfect"
    views: str = "moving"
    planner: str = "nbv"
    episode: int = 0
    frames: int = 4
    seed: int = 0
    length: int = 60
    fps: float | None = None
    out: Path = Path("explain.png")

    def __call__(self) -> None:
        """Run the episode, draw it, and print its table."""
        from eval.explain import explain, explain_table
        from eval.explain_figure import check_format, draw_explanation

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
        output_console().print(Rendered(explain_table(explanation)))
        print(f"drawn in {self.out}")


@dataclass(frozen=True)
class BeliefCommand:
    """Score the belief against the recogniser on test episodes, and say what each of its parts is worth.

    Args:
        data: duo, solo, or the path of a prepared .npz.
        models: folder of recogniser and gain field; by default those that ship, for duo and solo.
        sensor: perfect or estimator.
        views: the cameras the recogniser was trained on, moving or paper.
        starts: start viewpoints for each scenario.
        seed: of start viewpoints, noise, the random planner, and of the halves that the parts are fitted on.
        length: frames in an episode.
        fps: frame rate to resample to.
        out: folder for config.json, belief.json and table.md.
    """

    data: str = "duo"
    models: Path | None = None
    sensor: str = "perfect"
    views: str = "moving"
    starts: int = 1
    seed: int = 0
    length: int = 60
    fps: float | None = None
    out: Path | None = None

    def __call__(self) -> None:
        """Run the episodes and print the tables."""
        from eval.belief_report import belief_report, belief_tables

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
        output_console().print(Rendered(*belief_tables(report)))


@dataclass(frozen=True)
class AblationCommand:
    """Say what each part and setting of nbv is worth: its variants side by side on the same test episodes.

    Args:
        data: duo, solo, or the path of a prepared .npz.
        models: folder of recogniser and gain field; by default those that ship, for duo and solo.
        sensor: perfect or estimator.
        views: the cameras the recogniser was trained on, moving or paper.
        groups: of variants: knowledge, horizon, replan, effort, solver, search; none runs them all.
        tracks: vehicles that nbv flies as well: px4-auto, px4-max, tracking-drone, or vehicle files.
        starts: start viewpoints for each test scenario.
        seed: of start viewpoints and noise.
        length: frames in an episode.
        fps: frame rate to resample to.
        out: folder for config.json, episodes.jsonl, summary.json and table.md.
        workers: processes; the numbers, but for times, are the same with any number.
    """

    data: str = "duo"
    models: Path | None = None
    sensor: str = "perfect"
    views: str = "moving"
    groups: tuple[str, ...] = ()
    tracks: tuple[str, ...] = ()
    starts: int = 1
    seed: int = 0
    length: int = 60
    fps: float | None = None
    out: Path | None = None
    workers: int = field(default_factory=cores)

    def __call__(self) -> None:
        """Run the variants and print the tables."""
        from eval.ablation import GROUPS, ablation, ablation_tables

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
        output_console().print(Rendered(*ablation_tables(result)))
