"""The commands of `ehar`, one class each: its fields are the options, calling it runs the command.

What a command needs is imported when it runs, so that `ehar --help` waits for none of it.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from ehar.processes import cores
from eval.cli.options import Fps, Models, Out
from eval.render.console import output_console, print_tables
from eval.running.train_all import TrainAllConfig
from planners.agents.config import AgentTrainingConfig
from planners.value.config import GainTrainingConfig
from recognition.training.config import Form, TrainingConfig


@dataclass(frozen=True)
class Benchmark:
    """Run planners on test episodes, and say how well each did.

    For example:
        ehar benchmark --data duo
        ehar benchmark --data mine.npz --models models/mine --out runs/mine
        ehar benchmark ./spiral.py:Spiral --distance 6 no-act oracle

    Args:
        planners: names, or your own: file.py:Class or module:Class, then --argument value.
        data: duo, solo, or a prepared .npz.
        models: folder of weights.
        out: folder for records, tables and report.
        report: write report.html too, as ehar report does.
        sensor: perfect (exact joints) or estimator (noise, occlusion, dropout, swaps).
        track: ideal (grid moves), px4-auto, px4-max, tracking-drone, or a vehicle file.
        starts: start viewpoints of each scenario.
        length: frames of an episode.
        fps: frame rate to resample to [Hz].
        seed: of start viewpoints, noise and random planners.
        part: of the data: test, validation, policy or recogniser.
        views: cameras the recogniser was trained on: moving or paper.
        form: causal (streams) or ctrgcn (as published, on each prefix).
        recogniser: your own: file.py:Class, then --argument value.
        readout: whose probabilities count: recogniser or belief.
        ideal: finished run on the ideal track to compare flights with.
        workers: processes; numbers do not depend on it.
    """

    planners: Annotated[
        tuple[str, ...],
        tyro.conf.Positional,
        tyro.conf.arg(metavar="[PLANNER ...]", help_behavior_hint="(default: all of ours)"),
    ] = ()
    data: str = "duo"
    models: Models = None
    out: Out = None
    report: bool = True
    sensor: str = "perfect"
    track: str = "ideal"
    starts: int = 1
    length: int = 60
    fps: Fps = None
    seed: int = 0
    part: str = "test"
    views: str = "moving"
    form: Form = "causal"
    recogniser: Annotated[str | None, tyro.conf.arg(help_behavior_hint="(default: ours)")] = None
    readout: str = "recogniser"
    ideal: Annotated[Path | None, tyro.conf.arg(help_behavior_hint="(default: none)")] = None
    workers: int = field(default_factory=cores)

    def __call__(self) -> None:
        """Run the benchmark, print its table and write its report."""
        from eval.render.summary_table import render_summary
        from eval.running.benchmark import benchmark

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
            from eval.reports.page import make_report

            print(f"report: {make_report(self.out)}")


@dataclass(frozen=True)
class HeadroomCommand:
    """Say what there is to win: accuracy of fixed cameras.

    A map of viewpoints and the best of them, beside no-act and the oracles.

    For example:
        ehar headroom --data duo --out runs/headroom

    Args:
        data: duo, solo, or a prepared .npz.
        models: folder of weights.
        sensor: perfect (exact joints) or estimator (noisy joints).
        views: cameras the recogniser was trained on: moving or paper.
        seed: of start viewpoints and noise.
        length: frames of an episode.
        fps: frame rate to resample to [Hz].
        distance: of the fixed cameras [m].
        azimuths: how many azimuths the map has.
        polars: how many polar angles the map has, from straight above to level.
        out: folder for config.json, headroom.json, table.md and the figure.
        workers: processes; numbers do not depend on it.
    """

    data: str = "duo"
    models: Models = None
    sensor: str = "perfect"
    views: str = "moving"
    seed: int = 0
    length: int = 60
    fps: Fps = None
    distance: float = 10.0
    azimuths: int = 12
    polars: int = 6
    out: Out = None
    workers: int = field(default_factory=cores)

    def __call__(self) -> None:
        """Run the map and print its tables."""
        from eval.studies.headroom import headroom, headroom_tables

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
        print_tables(*headroom_tables(result))


@dataclass(frozen=True)
class TrainRecogniser:
    """Train a recogniser, on the recogniser part of data.

    Stopped and started again, it goes on where it was.

    For example:
        ehar train recogniser --data mine.npz --out models/mine

    Args:
        config: how.
    """

    config: Annotated[TrainingConfig, tyro.conf.arg(name="")]

    def __call__(self) -> None:
        """Train, resuming where a checkpoint lies in `out`."""
        from eval.running.progress import TrainingProgress
        from recognition.training.trainer import train_recogniser

        with TrainingProgress() as progress:
            best = train_recogniser(self.config, progress.report)
        print(
            f"best at step {best.step}: validation accuracy {100 * best.accuracy:.1f} % (mean over frames), "
            f"NLL {best.nll:.3f}; written to {self.config.out}"
        )


@dataclass(frozen=True)
class TrainGainField:
    """Train gain fields and belief, on the policy part of data.

    For the recogniser in --models, or the one that ships; what is done is kept.

    For example:
        ehar train gain-field --data mine.npz --models models/mine

    Args:
        config: how.
    """

    config: Annotated[GainTrainingConfig, tyro.conf.arg(name="")]

    def __call__(self) -> None:
        """Train, going on where a stopped run left off."""
        from eval.running.progress import StageProgress
        from planners.value.training import train_gain_field

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
    """Train agents: il, ppo, il-ppo and dagger.

    For the recogniser in --models, or the one that ships; what is done is kept.

    For example:
        ehar train agent --data mine.npz --models models/mine --stages il,il-ppo

    Args:
        config: how.
    """

    config: Annotated[AgentTrainingConfig, tyro.conf.arg(name="")]

    def __call__(self) -> None:
        """Train what is missing."""
        from eval.running.progress import StageProgress
        from planners.agents.training import train_agents

        with StageProgress() as progress:
            paths = train_agents(self.config, progress.report, progress.note)
        print(f"{len(paths)} agents are in {paths[0].parent}: {', '.join(path.stem for path in paths)}")


@dataclass(frozen=True)
class TrainAll:
    """Train recogniser, gain field and agents, in this order.

    What is done is kept; stopped and started again, it goes on.

    For example:
        ehar train all --data mine.npz --out models/mine

    Args:
        config: how.
    """

    config: Annotated[TrainAllConfig, tyro.conf.arg(name="")]

    def __call__(self) -> None:
        """Train what is missing, and say what to do with it."""
        from eval.running.train_all import train_all

        train_all(self.config, lambda line: print(line, flush=True))
        print(f"next: ehar benchmark {self.config.benchmark_options}")


@dataclass(frozen=True)
class Bench:
    """Measure how fast recognition, planning and training are.

    For example:
        ehar bench --out bench.json --report runs/duo-perfect-moving/report.html

    Args:
        out: .json to write.
        report: report.html to open too; takes chromium, and playwright from ehar[dev].
    """

    out: Path
    report: Path | None = None

    def __call__(self) -> None:
        """Measure, write, and print the figures beside their targets."""
        from eval.speed.bench import bench, bench_table

        print_tables(bench_table(bench(self.out, report=self.report)))
