"""Everything that planners need on someone's own data, trained in order: recogniser, gain field, and agents."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from ehar.errors import ModelError
from ehar.files import read_json
from ehar.processes import cores
from planners.agents.config import AgentTrainingConfig, Setting
from planners.value.config import GainTrainingConfig
from recognition.training.config import TrainingConfig

PAPER_CLIPS = 200_000  # about as many as 32 views of each training scenario of ExPI (Sec. 4.2 and 5.1)


@dataclass(frozen=True)
class _Run:
    """What the JSON of a recogniser says about its training; None where it does not say it."""

    data_sha256: str | None = None
    size: str | None = None


@dataclass(frozen=True)
class _Training:
    run: _Run = _Run()


@dataclass(frozen=True)
class _Trained:
    training: _Training = _Training()


@dataclass(frozen=True, kw_only=True)
class TrainAllConfig:
    """How everything is trained.

    Args:
        data: duo, solo, or a prepared .npz.
        out: folder to write to.
        sensor: perfect (exact joints) or estimator (noisy joints).
        views: cameras to train on: moving, or paper (32 static ones).
        length: L, frames of an episode.
        fps: frame rate to resample to [Hz]; None keeps the data's.
        seeds: how many training seeds, each an agent of its own.
        setting: quick, for 2 CPU cores; paper, as published, for a GPU.
        workers: processes; numbers do not depend on it.
        device: of the recogniser's and of PPO's network: cpu or cuda.
    """

    data: str
    out: Path
    sensor: str = "perfect"
    views: str = "moving"
    length: int = 60
    fps: float | None = None
    seeds: int = 1
    setting: Setting = "quick"
    workers: int = field(default_factory=cores)
    device: str = "cpu"

    @property
    def benchmark_options(self) -> str:
        """The options with which a benchmark runs under these conditions; its own defaults are left out."""
        options = {"data": self.data, "models": self.out}
        for name in ("sensor", "views", "length", "fps"):
            if getattr(self, name) != getattr(TrainAllConfig, name):
                options[name] = getattr(self, name)
        return " ".join(f"--{name} {value}" for name, value in options.items())

    @property
    def recogniser(self) -> TrainingConfig:
        """How the recogniser is trained."""
        return TrainingConfig(
            data=self.data,
            out=self.out,
            sensor=self.sensor,
            views=self.views,
            size="small" if self.setting == "quick" else "published",
            length=self.length,
            fps=self.fps,
            clips=TrainingConfig.clips if self.setting == "quick" else PAPER_CLIPS,
            device=self.device,
        )

    @property
    def gain_field(self) -> GainTrainingConfig:
        """How the gain field is trained."""
        return GainTrainingConfig(
            data=self.data,
            models=self.out,
            sensor=self.sensor,
            views=self.views,
            length=self.length,
            fps=self.fps,
            workers=self.workers,
        )

    @property
    def agents(self) -> AgentTrainingConfig:
        """How the agents are trained."""
        return AgentTrainingConfig(
            data=self.data,
            models=self.out,
            sensor=self.sensor,
            views=self.views,
            length=self.length,
            fps=self.fps,
            seeds=self.seeds,
            setting=self.setting,
            workers=self.workers,
            device=self.device,
        )


def train_all(config: TrainAllConfig, note: Callable[[str], None]) -> None:
    """Train recogniser, gain field and the four agents; what is there is kept, what was stopped goes on.

    Args:
        config: how.
        note: hears what is kept, and what comes next.

    Raises:
        EharError: as the trainings do; an option of the agents that makes no sense is refused before anything begins.
    """
    config.agents.check()
    # Here, as they bring torch and rich, which `ehar --help` does not wait for.
    from eval.running.progress import StageProgress, TrainingProgress
    from planners.agents.training import train_agents
    from planners.value.training import train_gain_field
    from recognition.training.trainer import train_recogniser

    if has_recogniser(config):
        note(f"1 of 3: the recogniser in {config.out} is kept")
    else:
        note("1 of 3: the recogniser")
        with TrainingProgress() as training:
            train_recogniser(config.recogniser, training.report)
    if has_gain_field(config):
        note(f"2 of 3: the gain field in {config.out} is kept")
    else:
        note("2 of 3: the gain field")
        with StageProgress() as stages:
            train_gain_field(config.gain_field, stages.report)
    note("3 of 3: the agents il, ppo, il-ppo and dagger")
    with StageProgress() as stages:
        train_agents(config.agents, stages.report, stages.note)


def has_recogniser(config: TrainAllConfig) -> bool:
    """Return whether a recogniser that fits the data is there.

    Raises:
        EharError: there is one, and it does not fit.
    """
    from ehar.data.source import load_data
    from recognition.storage import load_recogniser, recogniser_path

    path = recogniser_path(config.out, form="causal", sensor=config.sensor, views=config.views)
    description = path.with_suffix(".json")
    if not (path.is_file() and description.is_file()):
        return False
    data = load_data(config.data, fps=config.fps)
    load_recogniser(config.out, data, sensor=config.sensor, views=config.views)
    # Classes and joints can be the same where recordings were added: other sequences are then held out for the test.
    run = read_json(description, _Trained, "a recogniser", unknown=True, defaults=True, wrong=ModelError).training.run
    sha256 = run.data_sha256
    if sha256 not in (None, data.sha256):
        raise ModelError(
            f"{description}: trained on another data set: its sha256 was {sha256[:12]}..., that of {config.data} is "
            f"{data.sha256[:12]}...: remove it to train again, or choose another --out"
        )
    wanted = config.recogniser.size
    if config.setting == "paper" and run.size not in (None, wanted):
        raise ModelError(
            f"{description}: got a recogniser of size {run.size}, expected {wanted}, as --setting paper trains it: "
            "remove it to train again, or choose another --out"
        )
    return True


def has_gain_field(config: TrainAllConfig) -> bool:
    """Return whether a gain field for the recogniser is there; one for another recogniser is trained anew."""
    from ehar.data.source import load_data
    from planners.value.model import load_gain_model
    from recognition.storage import load_recogniser

    data = load_data(config.data, fps=config.fps)
    sha256 = load_recogniser(config.out, data, sensor=config.sensor, views=config.views).sha256
    try:
        load_gain_model(config.out, data, sensor=config.sensor, views=config.views, recogniser_sha256=sha256)
    except ModelError:
        return False
    return True
