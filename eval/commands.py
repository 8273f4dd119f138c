"""The commands of `ehar`, one class each: its fields are the options, calling it runs the command.

What a command needs is imported when it runs, so that `ehar --help` waits for none of it.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from ehar.cores import cores
from eval.progress import StageProgress, TrainingProgress
from eval.tables import Rendered, render_summary
from eval.train_all import TrainAllConfig
from planners.agent_training_config import AgentTrainingConfig
from planners.gain_training_config import GainTrainingConfig
from recognition.training_config import Form, TrainingConfig

PIPED_WIDTH = 160  # columns where standard output is no terminal


def output_console() -> Console:
    """Return where results are printed: standard output, wide where it is no terminal."""
    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=PIPED_WIDTH)


@dataclass(frozen=True)
class Benchmark:
    """Run planners on the test scenarios of some data, and say how well each did.

    For example: ehar benchmark ./spiral.py:Spiral --radius 6 no-act oracle --data duo

    Args:
        planners: names, or your own: file.py:Class or module:Class, then --argument value; none runs all of ours.
        data: duo, solo, or the path of a prepared .npz.
        models: folder of recogniser weights; by default those that ship, for duo and solo.
        sensor: perfect (exact 2D joints) or estimator (noise, occlusion, dropout, swaps).
        views: the cameras the recogniser was trained on, moving or paper.
        form: causal streams; ctrgcn is the published network, evaluated anew on every prefix.
        recogniser: your own instead: file.py:Class or module:Class, then --argument value.
        track: how cameras move: ideal is the paper's grid; px4-auto, px4-max, tracking-drone, or a vehicle file.
        ideal: folder of a finished run on the ideal track, to say how much of its accuracy flights keep.
        readout: whose probabilities are scored, the recogniser's or those of the belief; planners act the same.
        part: whose scenarios: test; validation to develop on; policy and recogniser, on which something was trained.
        starts: start viewpoints for each scenario.
        seed: of start viewpoints, noise and random planners.
        length: frames in an episode.
        fps: frame rate to resample to.
        out: folder for config.json, episodes.jsonl, summary.json, table.md, the accuracy curve and report.html.
        workers: processes; the numbers are the same with any number.
        report: write report.html into out, as `ehar report` does.
    """

    planners: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="[PLANNER ...]")] = ()
    data: str = "duo"
    models: Path | None = None
    sensor: str = "perfect"
    views: str = "moving"
    form: Form = "causal"
    recogniser: str | None = None
    track: str = "ideal"
    ideal: Path | None = None
    readout: str = "recogniser"
    part: str = "test"
    starts: int = 1
    seed: int = 0
    length: int = 60
    fps: float | None = None
    out: Path | None = None
    workers: int = field(default_factory=cores)
    report: bool = True

    def __call__(self) -> None:
        """Run the benchmark, print its table and write its report."""
        from eval.run import benchmark

        summary = benchmark(
            self.planners or None,
            data=self.data,
            models=self.models,
            sensor=self.sensor,
            views=self.views,
            form=self.form,
            recogniser=self.recogniser,
            track=self.track,
            ideal=self.ideal,
            readout=self.readout,
            part=self.part,
            starts=self.starts,
            seed=self.seed,
            length=self.length,
            fps=self.fps,
            out=self.out,
            workers=self.workers,
        )
        output_console().print(render_summary(summary))
        if self.report and self.out is not None:
            from eval.report import make_report

            print(f"report: {make_report(self.out)}")


@dataclass(frozen=True)
class HeadroomCommand:
    """Say what there is to win: accuracy over a map of fixed cameras, beside no-act and the oracles.

    Args:
        data: duo, solo, or the path of a prepared .npz.
        models: folder of recogniser weights; by default those that ship, for duo and solo.
        sensor: perfect or estimator.
        views: the cameras the recogniser was trained on, moving or paper.
        seed: of start viewpoints and noise.
        length: frames in an episode.
        fps: frame rate to resample to.
        distance: of the fixed cameras [m].
        azimuths: how many azimuths the map has.
        polars: how many polar angles the map has, from straight above to level.
        out: folder for config.json, headroom.json, table.md and the figure.
        workers: processes.
    """

    data: str = "duo"
    models: Path | None = None
    sensor: str = "perfect"
    views: str = "moving"
    seed: int = 0
    length: int = 60
    fps: float | None = None
    distance: float = 10.0
    azimuths: int = 12
    polars: int = 6
    out: Path | None = None
    workers: int = field(default_factory=cores)

    def __call__(self) -> None:
        """Run the map and print its tables."""
        from eval.fixed_views import headroom
        from eval.headroom_report import headroom_tables

        result = headroom(
            data=self.data,
            models=self.models,
            sensor=self.sensor,
            views=self.views,
            seed=self.seed,
            length=self.length,
            fps=self.fps,
            distance=self.distance,
            azimuths=self.azimuths,
            polars=self.polars,
            out=self.out,
            workers=self.workers,
        )
        output_console().print(Rendered(*headroom_tables(result)))


@dataclass(frozen=True)
class TrainRecogniser:
    """Train a recogniser on the recogniser part of some data; stopped and started again, it resumes.

    Args:
        config: how.
    """

    config: tyro.conf.OmitArgPrefixes[TrainingConfig]

    def __call__(self) -> None:
        """Train, resuming where a checkpoint lies in `out`."""
        from recognition.training import train_recogniser

        with TrainingProgress() as progress:
            best = train_recogniser(self.config, progress.report)
        print(
            f"best at step {best.step}: validation accuracy {100 * best.accuracy:.1f} % (mean over frames), "
            f"NLL {best.nll:.3f}; written to {self.config.out}"
        )


@dataclass(frozen=True)
class TrainGainField:
    """Train what a planner needs to value views: gain fields and belief, on the policy part of some data.

    Args:
        config: how.
    """

    config: tyro.conf.OmitArgPrefixes[GainTrainingConfig]

    def __call__(self) -> None:
        """Train, going on where a stopped run left off."""
        from planners.gain_training import train_gain_field

        with StageProgress() as progress:
            result = train_gain_field(self.config, progress.report)
        for name, fit in result.fits.items():
            print(
                f"{name}: explains {100 * fit.explained:.1f} % of what paths gain; the path it picks gains "
                f"{100 * fit.chosen_gain:.2f} % in probability, of {100 * fit.best_gain:.2f} % in hindsight"
            )
        print(f"in cross-validation over sequences; written to {result.path}")


@dataclass(frozen=True)
class TrainAgent:
    """Train the paper's agent by imitation, PPO, or one after the other, and by DAgger; what was stopped goes on.

    Args:
        config: how.
    """

    config: tyro.conf.OmitArgPrefixes[AgentTrainingConfig]

    def __call__(self) -> None:
        """Train what is missing."""
        from planners.agent_training import train_agents

        with StageProgress() as progress:
            paths = train_agents(self.config, progress.report, progress.note)
        print(f"{len(paths)} agents are in {paths[0].parent}: {', '.join(path.stem for path in paths)}")


@dataclass(frozen=True)
class TrainAll:
    """Train all that planners need on your data: recogniser, gain field and agents; what is done is skipped.

    Args:
        config: how.
    """

    config: tyro.conf.OmitArgPrefixes[TrainAllConfig]

    def __call__(self) -> None:
        """Train what is missing, and say what to do with it."""
        from eval.train_all import train_all

        train_all(self.config, lambda line: print(line, flush=True))
        print(f"next: ehar benchmark {self.config.benchmark_options}")


@dataclass(frozen=True)
class Bench:
    """Measure the speed of the recogniser and of the world.

    Args:
        out: the .json to write.
    """

    out: Path

    def __call__(self) -> None:
        """Measure, write, and print the figures beside their targets."""
        from eval.bench import bench, bench_table

        output_console().print(Rendered(bench_table(bench(self.out))))
