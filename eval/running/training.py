"""Trainings with their progress: each alone, or all that planners need on your own data, in order."""

import shlex
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from ehar.conditions import Conditions
from ehar.data.streams.data import StreamData
from ehar.errors import ModelError
from ehar.files import read_json, shortened
from ehar.processes import cores
from ehar.world import load_world
from eval.running.choice import ModelPlace
from eval.running.outlook import outlook
from planners.agents.config import PAPER_FORM, AgentTrainingConfig
from planners.place.config import FixedBestConfig
from planners.value.config import GainTrainingConfig
from recognition.setting import load_recordings_of, load_setting, with_length
from recognition.training.config import PUBLISHED_BATCH, WINDOW, TrainingConfig

Effort = Literal["tiny", "quick", "paper"]
# A first try, which shows that everything runs on some data, and nothing more.
TINY_CLIPS, TINY_INTERVAL, TINY_BATCHES, TINY_EPISODES = 640, 320, 1, 64
PAPER_CLIPS = 200_000  # about as many as 32 views of each training scenario of ExPI (Sec. 4.2 and 5.1)

if TYPE_CHECKING:
    from ehar.planner import Planner
    from planners.value.model import GainModel


@dataclass(frozen=True)
class _Run:
    """The training that a recogniser's JSON describes; None for anything that it leaves out."""

    data_sha256: str | None = None
    size: str | None = None
    interval: int | None = None
    seed: int | None = None
    length: int | None = None
    in_the_way: bool = False


@dataclass(frozen=True)
class _Training:
    run: _Run = _Run()


@dataclass(frozen=True)
class _Trained:
    training: _Training = _Training()


@dataclass(frozen=True)
class Trained:
    """The result of a training.

    Args:
        paths: paths of the weights.
        lines: lines that describe the result.
        failed: whether a part of it failed; the lines say which.
    """

    paths: tuple[Path, ...]
    lines: tuple[str, ...]
    failed: bool = False


@dataclass(frozen=True, kw_only=True)
class TrainAllConfig:
    """The configuration of all trainings together.

    Args:
        conditions: conditions of all trainings.
        out: folder to write to.
        seeds: the agents' training seeds, by name: 7 8 9.
        setting: tiny, a first try in a minute or two: recogniser, field and il; quick, for 2 CPU cores; paper, as
            published, for a GPU: it takes --views paper, and trains no field.
        in_the_way: whether the recogniser learns with pillars, boxes and passers-by in the way, in an open world.
        workers: number of processes; results do not depend on it.
        device: device of the recogniser's and of PPO's network: cpu or cuda.
    """

    conditions: Conditions
    out: Path
    seeds: tuple[int, ...] = (0,)
    setting: Effort = "quick"
    in_the_way: bool = False
    workers: int = field(default_factory=cores)
    device: str = "cpu"

    @property
    def told(self) -> Conditions:
        """The conditions of every training; in the paper setting, with the published form."""
        return replace(self.conditions, form=PAPER_FORM) if self.setting == "paper" else self.conditions

    @property
    def with_models(self) -> Conditions:
        """These conditions with the weights that are trained here."""
        return replace(self.told, models=self.out)

    @property
    def benchmark_options(self) -> str:
        """The options of a benchmark under these conditions, without those that equal its defaults."""
        usual, told = Conditions(), self.with_models
        options = {name: getattr(told, name) for name in ("data", "models", "sensor", "views", "form", "length", "fps")}
        options["world"] = told.world_name
        said = (name for name in options if name in ("data", "models") or options[name] != getattr(usual, name))
        return " ".join(f"--{name} {shlex.quote(str(options[name]))}" for name in said)

    @property
    def recogniser(self) -> TrainingConfig:
        """The configuration of the recogniser's training."""
        paper, tiny = self.setting == "paper", self.setting == "tiny"
        return TrainingConfig(
            conditions=self.told,
            out=self.out,
            size="published" if paper else "small",
            optimiser="published" if paper else "adamw",
            batch=PUBLISHED_BATCH if paper else TrainingConfig.batch,
            clips=PAPER_CLIPS if paper else TINY_CLIPS if tiny else TrainingConfig.clips,
            interval=TINY_INTERVAL if tiny else TrainingConfig.interval,
            in_the_way=self.in_the_way,
            device=self.device,
        )

    @property
    def gain_field(self) -> GainTrainingConfig:
        """The configuration of the gain field's training."""
        batches = TINY_BATCHES if self.setting == "tiny" else GainTrainingConfig.batches
        return GainTrainingConfig(
            conditions=self.with_models, batches=batches, workers=self.workers, device=self.device
        )

    @property
    def fixed_best(self) -> FixedBestConfig:
        """The configuration of the fit of `fixed-best`."""
        return FixedBestConfig(conditions=self.with_models, workers=self.workers, device=self.device)

    @property
    def agents(self) -> AgentTrainingConfig:
        """The configuration of the agents' training."""
        tiny = self.setting == "tiny"
        return AgentTrainingConfig(
            conditions=self.with_models,
            seeds=self.seeds,
            setting="paper" if self.setting == "paper" else "quick",
            stages="il" if tiny else None,
            episodes=TINY_EPISODES if tiny else None,
            variations=0 if tiny else None,
            workers=self.workers,
            device=self.device,
        )


def train_recogniser(config: TrainingConfig, planned: tuple[Path, ...] = ()) -> Trained:
    """Train a recogniser, with a bar on standard error; resumes where a checkpoint lies in `out`.

    Args:
        config: the settings of the training.
        planned: folders of runs of the benchmark on the recogniser's part: half of the clips are seen from where their
            planners went.
    """
    from eval.running.planned import planned_views  # these bring rich and torch, which `ehar --help` does not need
    from eval.running.progress import TrainingProgress
    from recognition.storage import recogniser_path
    from recognition.training import trainer

    views = None
    if planned:
        data = load_recordings_of(config.conditions)
        views = planned_views(planned, data, with_length(config.conditions, data, WINDOW))
    with TrainingProgress() as progress:
        outcome = trainer.train_recogniser(config, progress.report, views)
    best = outcome.best
    lines = (
        f"best after {best.clips:,} clips: validation accuracy {100 * best.accuracy:.1f} % (mean over frames), "
        f"NLL {best.nll:.3f}; written to {config.out}",
        f"{'warning: ' * outcome.cut_short}{outcome.reason}",
    )
    return Trained((recogniser_path(config.out, config.conditions),), lines)


def train_gain_field(config: GainTrainingConfig) -> Trained:
    """Train gain fields and belief, with bars on standard error; goes on where a stopped run left off."""
    from eval.running.progress import StageProgress  # these bring rich and torch, which `ehar --help` does not need
    from planners.value import training

    with StageProgress() as progress:
        result = training.train_gain_field(config, searching, progress.report, progress.note)
    lines = [
        f"{name}: explains {100 * fit.scores.explained:.1f} % of what paths gain; the path it picks gains "
        f"{100 * fit.scores.chosen_gain:.2f} % in probability, of {100 * fit.scores.best_gain:.2f} % in hindsight"
        for name, fit in result.fits.items()
    ]
    before, after = (100 * scores.chosen_gain for scores in result.second_round)
    lines.append(
        "in cross-validation; on validation, where six cameras in ten follow nbv-search and the others stay, "
        f"{before:.2f} % before the second round and {after:.2f} % after it; written to {result.path}"
    )
    return Trained((result.path,), (*lines, f"{'warning: ' * result.cut_short}{result.reason}"))


def searching(model: "GainModel") -> "Planner":
    """Return the planner that leads the second round of a gain field's training."""
    from planners.registry import make_planner  # imported here: torch takes seconds

    return make_planner("nbv-search", lambda: model)


def train_fixed_best(config: FixedBestConfig) -> Trained:
    """Find the place of `fixed-best`, with a bar on standard error; goes on where a stopped run left off."""
    from eval.running.progress import StageProgress  # these bring rich and torch, which `ehar --help` does not need
    from planners.place import fit

    with StageProgress() as progress:
        result = fit.fit_fixed_best(config, progress.report, progress.note)
    best, worst = result.tried[0], result.tried[-1]
    found = f"the best of {len(result.tried)} places: {best.place}"
    accuracy = f"accuracy {100 * best.accuracy:.1f} % (mean over frames), {100 * worst.accuracy:.1f} % at the worst"
    return Trained((result.path,), (found, f"{accuracy}, on the {result.part} part; written to {result.path}"))


def train_agents(config: AgentTrainingConfig) -> Trained:
    """Train the agents that are missing, with bars on standard error."""
    from eval.running.progress import StageProgress  # these bring rich and torch, which `ehar --help` does not need
    from planners.agents import training

    with StageProgress() as progress:
        paths = training.train_agents(config, progress.report, progress.note)
    line = f"{len(paths)} agents are in {paths[0].parent}: {', '.join(path.stem for path in paths)}"
    return Trained(tuple(paths), (line,))


def train_all(config: TrainAllConfig, foretell: Callable[[], str] | None = None) -> Trained:
    """Train recogniser, gain field, fixed-best and the four agents; finished parts are kept, and stopped parts go on.

    Args:
        config: the trainings.
        foretell: returns a line that says how long they will take; it is asked for after all that could be wrong.

    Raises:
        EharError: a training raised it. An option of the agents that is wrong, and data with too few sequences that are
            long enough, are told before anything begins.
    """
    config.agents.check()
    for line in outlook(load_recordings_of(config.told), config.told.length):
        print(line, flush=True)
    if foretell is not None:
        print(foretell(), flush=True)
    agents = " and ".join(", ".join(config.agents.stage_names).rsplit(", ", 1))
    stages: list[tuple[str, Callable[[TrainAllConfig], bool], Callable[[], Trained]]] = [
        ("the recogniser", has_recogniser, lambda: train_recogniser(config.recogniser)),
        ("the gain field", has_gain_field, lambda: train_gain_field(config.gain_field)),
        ("the place of fixed-best", has_fixed_best, lambda: train_fixed_best(config.fixed_best)),
        (f"the agents {agents}", lambda _: False, lambda: train_agents(config.agents)),
    ]
    if config.setting == "paper":
        del stages[1:3]  # gain fields and places are for the causal form, and no part of the paper
    if config.setting == "tiny":
        del stages[2]  # it tries every place, which takes longer than all others
    paths: list[Path] = []
    for number, (name, is_there, train) in enumerate(stages, 1):
        kept = is_there(config)
        print(f"{number} of {len(stages)}: {name}{f' in {config.out} is kept' * kept}", flush=True)
        if not kept:
            paths += train().paths
    return Trained(tuple(paths), (f"next: ehar benchmark {config.benchmark_options}",))


def has_recogniser(config: TrainAllConfig) -> bool:
    """Return whether there is a recogniser that fits the data.

    Raises:
        EharError: there is a recogniser that does not fit.
    """
    from recognition.storage import load_recogniser, recogniser_path  # imported here: torch takes seconds

    path = recogniser_path(config.out, config.told)
    description = path.with_suffix(".json")
    if not (path.is_file() and description.is_file()):
        return False
    data = load_recordings_of(config.told)
    trained, asked = load_recogniser(config.with_models, data).spec.world, load_world(config.told.world)
    if isinstance(data, StreamData) and trained.localisation != asked.localisation:
        raise ModelError(
            f"{description}: trained with another localisation: {trained.localisation}, asked for "
            f"{asked.localisation}: remove it to train again, or choose another --out"
        )
    # Added recordings may leave classes and joints unchanged, but then other sequences are held out for the test.
    run = read_json(description, _Trained, "a recogniser", unknown=True, defaults=True, wrong=ModelError).training.run
    sha256 = run.data_sha256
    if sha256 not in (None, data.sha256):
        raise ModelError(
            f"{description}: trained on another data set: its sha256 was {shortened(sha256)}..., that of {data.name} "
            f"is {shortened(data.sha256)}...: remove it to train again, or choose another --out"
        )
    length = with_length(config.told, data, WINDOW).frames
    for name, found, expected in (("seed", run.seed, config.told.seed), ("length", run.length, length)):
        if found not in (None, expected):
            raise ModelError(
                f"{description}: trained with --{name} {found}, asked for {expected}: remove it to train again, or "
                "choose another --out"
            )
    if run.in_the_way != config.in_the_way:
        raise ModelError(
            f"{description}: trained {'with' if run.in_the_way else 'without'} --in-the-way, asked for a training "
            f"{'with' if config.in_the_way else 'without'} it: remove it to train again, or choose another --out"
        )
    tiny = run.interval == TINY_INTERVAL
    if run.interval is not None and tiny != (config.setting == "tiny"):
        raise ModelError(
            f"{description}: got a recogniser {'of' if tiny else 'that is not of'} --setting tiny: "
            "remove it to train again, or choose another --out"
        )
    wanted = config.recogniser.size
    if config.setting == "paper" and run.size not in (None, wanted):
        raise ModelError(
            f"{description}: got a recogniser of size {run.size}, expected {wanted}, as --setting paper trains it: "
            "remove it to train again, or choose another --out"
        )
    return True


def has_fixed_best(config: TrainAllConfig) -> bool:
    """Return whether there is a place of fixed-best for the recogniser and localisation; any other is found anew."""
    setting = load_setting(config.with_models)
    try:
        found = ModelPlace.of(setting).load_fixed_place()
    except ModelError:
        return False
    return found.localisation in (None, setting.world.localisation)


def has_gain_field(config: TrainAllConfig) -> bool:
    """Return whether there is a gain field for the recogniser and localisation; any other is trained anew."""
    setting = load_setting(config.with_models)
    try:
        found = ModelPlace.of(setting).load_gain_model()
    except ModelError:
        return False
    return found.localisation in (None, setting.world.localisation)
