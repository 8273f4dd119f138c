"""Trains a recogniser on all observation ratios at once, until more clips bring no more; resumes from checkpoints."""

import hashlib
import json
import math
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from ehar.arrays import FloatArray
from ehar.errors import ModelError, UsageError
from ehar.files import as_json, check_folder, parse_json
from ehar.world import PAPER
from recognition.calibration import fit_temperature
from recognition.devices import check_device
from recognition.freed_memory import keep_freed_memory
from recognition.networks.spec import Network, NetworkSpec
from recognition.storage import load_weights, recogniser_path, save_recogniser
from recognition.torch_threads import one_torch_thread, use_threads
from recognition.training.arithmetic import arithmetic_on
from recognition.training.batches import Batch, draw_batches
from recognition.training.checkpoints import Checkpoint, load_checkpoint, save_checkpoint
from recognition.training.config import TrainingConfig
from recognition.training.learner import Learner
from recognition.training.material import Material, gather, who_is_left_out
from recognition.training.planned_views import PlannedViews
from recognition.training.recorded_step import FIRST_STEPS
from recognition.training.stopping import (
    Evaluation,
    Outcome,
    conclude,
    enough_clips,
    has_learned,
    next_evaluation,
)
from recognition.weight_files import description_path, recorded_run


@dataclass(frozen=True)
class _Held:
    """The JSON of a checkpoint: the identity and the progress of its run."""

    run: dict[str, Any]
    step: int
    evaluations: tuple[Evaluation, ...]
    losses: tuple[float, ...]  # of the steps since the last evaluation


# (clips so far, clips after which it would stop if nothing got better, all evaluations if there is a new one)
Report = Callable[[int, int, "Sequence[Evaluation] | None"], None]


def train_recogniser(
    config: TrainingConfig, report: Report | None = None, planned: PlannedViews | None = None
) -> Outcome:
    """Train, calibrate and save a recogniser.

    Training stops when twice the clips have gained too little on validation (`recognition.training.stopping`), so no
    length has to be known beforehand. How a step goes, and which weights count, is the `Learner`'s. With folds, people
    of the recogniser's part are left out of further trainings, and asked about, before temperatures are fitted.

    The clips and dropout of a step depend only on its number and the seed. So a run that is stopped and started again
    ends like one that ran through.

    Args:
        config: the settings of the training.
        report: called after every step.
        planned: views that planners chose in episodes of the recogniser's part: half of the clips are seen from there.

    Raises:
        UsageError: an option is unknown or wrong; `out` cannot be written to, or holds a checkpoint of another run;
            there are more folds than people, or other weights to start from.
        DataError: the data is malformed, has no training sequence of `length` frames, or does not name people who are
            to be left out.
        ModelError: the loss is not finite, the checkpoint is damaged, or `init` does not fit.
    """
    # A batch norm of the published form cannot learn from one clip of one frame.
    for field, least in (("clips", 1), ("batch", 2), ("interval", 1), ("folds", 0)):
        if getattr(config, field) < least:
            raise UsageError(f"--{field}: got {getattr(config, field)}, expected at least {least}")
    if not 0 <= config.learning_rate < math.inf:
        raise UsageError(f"--learning-rate: got {config.learning_rate}, expected a finite number, at least 0")
    if not 0 <= config.weight_decay < math.inf:
        raise UsageError(f"--weight-decay: got {config.weight_decay}, expected a finite number, at least 0")
    if config.folds and config.init is not None:
        raise UsageError("--folds: expected no --init: its weights may have learned from who is to be left out")
    check_device(config.device)
    check_folder(config.out)
    use_threads(config.threads)
    keep_freed_memory()
    run = _Run(config, planned)
    _refuse_finished(run.path, run.identity)
    run.folds = [_Run(config, planned, number) for number in range(config.folds)]  # here: what is wrong is told at once
    return run.train(report or (lambda clips, expected, evaluations: None))


def time_step(config: TrainingConfig, steps: int = 3) -> float:
    """Return how long a step takes on one thread of this machine [s]; nothing is kept.

    It is time of a core, which other programs do not lengthen; on a GPU it is time of the clock.

    Args:
        config: the settings of the training.
        steps: number of steps that are timed, after the first, which take longer.

    Raises:
        EharError: as `train_recogniser`.
    """
    clock = time.process_time if config.device == "cpu" else time.perf_counter
    with one_torch_thread():
        run = _Run(config)
        first = FIRST_STEPS + 1 if config.device != "cpu" else 1  # a GPU records the last of them
        with closing(run.batches(first + steps)) as batches:
            for _ in range(first):
                run._learn(next(batches))
            begin = clock()
            for _ in range(steps):
                run._learn(next(batches))
            return (clock() - begin) / steps


class _Run:
    """One training run: its data, network, optimiser and evaluations; of a fold, one that leaves people out."""

    def __init__(self, config: TrainingConfig, planned: PlannedViews | None = None, fold: int | None = None) -> None:
        material = gather(config, planned, fold)
        self.config = config = material.config
        self.material = material
        self.spec = NetworkSpec.of(
            material.data,
            form=config.conditions.form,
            size=config.size,
            length=config.conditions.frames,
            world=material.world,
        )
        self.device = torch.device(config.device)
        network: Network = self.spec.build(config.conditions.seed).to(self.device)
        if config.init is not None:
            load_weights(config.init, network)
        self.learner = Learner(
            network,
            optimiser=config.optimiser,
            learning_rate=config.learning_rate,
            weight_decay=config.weight_decay,
            batch=config.batch,
            class_weights=material.weights,
            late=material.late,
        )
        self.identity = _identify(material, fold)
        self.steps = max(1, config.clips // config.batch)
        self.step = 0
        self.evaluations: list[Evaluation] = []
        self.losses: list[float] = []
        self.best: dict[str, Tensor] = {}
        self.folds: list[_Run] = []
        self.path = recogniser_path(config.out, config.conditions)
        if fold is not None:
            self.path = self.path.with_stem(f"{self.path.stem}-without-{fold}")
        self.checkpoint = self.path.with_suffix(".checkpoint")
        self.interval = max(1, config.interval // config.batch)  # steps

    def train(self, report: Report) -> Outcome:
        """Train to the end, calibrate and save."""
        self._resume()
        with closing(self.batches(self.steps)) as batches:
            while self.step < self.steps and (self.runs_to_end or not has_learned(self.evaluations)):
                self.losses.append(self._learn(next(batches)))
                evaluated = self.step >= next_evaluation(self.evaluations, self.interval) or self.step == self.steps
                if evaluated:
                    self._evaluate()
                if evaluated or self.step % self.interval == 0:
                    self._save_checkpoint()
                report(self.clips, self._expected_clips(), self.evaluations if evaluated else None)
        return self._finish(report)

    def answer_after(self, steps: int, report: Report) -> FloatArray:
        """Train for so many steps, and return the logits of the clips of those who were left out."""
        self._resume()
        with closing(self.batches(steps)) as batches:
            while self.step < steps:
                self._learn(next(batches))
                if self.step % self.interval == 0 or self.step == steps:
                    self.best = _copied(self.learner.averaged)
                    self._save_checkpoint()
                report(self.clips, steps * self.config.batch, None)
        return self.learner.logits(self.learner.averaged, self.material.validation.features)

    @property
    def clips(self) -> int:
        """The number of clips seen so far."""
        return self.step * self.config.batch

    @property
    def runs_to_end(self) -> bool:
        """Whether the schedule decides when training ends: the published one does."""
        return self.config.optimiser == "published"

    def _expected_clips(self) -> int:
        """Return the clips after which training stops if nothing gets better from now on."""
        most = self.config.clips
        return most if self.runs_to_end else min(enough_clips(self.evaluations, self.clips), most)

    def batches(self, steps: int) -> Generator[Batch]:
        """Return the batches of the steps from the present one to `steps`, to be closed."""
        seed, size = self.config.conditions.seed, self.config.batch
        steps_left = range(self.step, steps)
        return draw_batches(self.material.source, seed=seed, size=size, steps=steps_left, device=self.config.device)

    def _learn(self, batch: Batch) -> float:
        """Make one step and return its loss."""
        clips, rng = batch
        loss = self.learner.learn(clips, rng, step=self.step, steps=self.steps)
        if not np.isfinite(loss):
            raise ModelError(f"{self.path.name}: the loss is {loss} at step {self.step}: expected a finite one")
        self.step += 1
        return loss

    def _evaluate(self) -> None:
        """Evaluate the weights that count now on the validation clips, and remember the best."""
        network = self.learner.averaged
        logits = torch.from_numpy(self.learner.logits(network, self.material.validation.features))
        labels = self.material.validation.frame_labels
        weight = None if self.material.weights is None else torch.from_numpy(self.material.weights.astype(np.float32))
        nll = float(functional.cross_entropy(logits.flatten(0, 1), labels.flatten(), weight=weight))
        right = (logits.argmax(dim=-1) == labels).float()
        accuracy = float(right.mean() if weight is None else (right * weight[labels]).sum() / weight[labels].sum())
        if not np.isfinite(nll):
            raise ModelError(
                f"{self.path.name}: the validation loss is {nll} at step {self.step}: expected a finite one"
            )
        if accuracy >= max((past.accuracy for past in self.evaluations), default=0.0):
            self.best = _copied(network)
        train_loss = float(np.mean(self.losses))
        self.losses = []
        self.evaluations.append(Evaluation(self.step, self.clips, train_loss, nll, accuracy))

    def _finish(self, report: Report) -> Outcome:
        """Calibrate and save the best weights, and remove the checkpoints."""
        network = self.learner.network
        network.load_state_dict(self.best)
        begun = self.config.init is not None
        outcome = conclude(self.evaluations, self.clips, runs_to_end=self.runs_to_end, begun=begun)
        said = [self.learner.logits(network, self.material.validation.features)]
        # As long as the weights that are kept have learned, not as long as it took to see that no more was gained.
        said += [fold.answer_after(outcome.best.step, report) for fold in self.folds]
        labels = [run.material.validation.labels.numpy() for run in (self, *self.folds)]
        temperature = fit_temperature(np.concatenate(said), np.concatenate(labels), self.material.weights)
        left_out = who_is_left_out([fold.material for fold in self.folds])
        history = {
            "data": self.material.data.title,
            "run": self.identity,
            "validated_on": self.material.validated_on,
            **({"calibrated_on": f"these, and {left_out} left out in {len(self.folds)} folds"} if self.folds else {}),
            "stopped": outcome.reason,
            "cut_short": outcome.cut_short,
            "arithmetic": arithmetic_on(self.device),
            "evaluations": [asdict(evaluation) for evaluation in self.evaluations],
        }
        save_recogniser(self.path, network, self.spec, temperature, history)
        for run in (self, *self.folds):
            run.checkpoint.unlink(missing_ok=True)
        return outcome

    def _save_checkpoint(self) -> None:
        """Keep everything that the next steps depend on."""
        held = asdict(_Held(self.identity, self.step, tuple(self.evaluations), tuple(self.losses)))
        states = {**self.learner.states(), "best": self.best}
        save_checkpoint(self.checkpoint, Checkpoint(states, self.learner.optimiser.state_dict(), held))

    def _resume(self) -> None:
        """Go on from the checkpoint, if this run has one."""
        if not self.checkpoint.is_file():
            return
        try:
            saved = load_checkpoint(self.checkpoint)
            held = parse_json(json.dumps(saved.held), _Held, "its JSON", "a checkpoint")
            same = held.run == as_json(self.identity)
            if same:
                self.learner.load(saved.states, saved.optimiser)
                self.best, self.step = dict(saved.states["best"]), held.step
                self.evaluations, self.losses = list(held.evaluations), list(held.losses)
        except Exception as error:  # the damage decides its type, and it may be long
            reason = f"{type(error).__name__}: {error}".splitlines()[0][:120]
            raise ModelError(f"{self.checkpoint}: expected a training checkpoint, got {reason}") from error
        if not same:
            raise UsageError(
                f"{self.checkpoint}: a checkpoint of a run with other options or data: "
                f"run with those, remove it, or choose another --out"
            )


def _copied(network: Network) -> dict[str, Tensor]:
    """Return the weights as they are now."""
    return {name: tensor.detach().clone() for name, tensor in network.state_dict().items()}


NOT_DECISIVE = ("conditions", "out", "threads", "device", "init")  # their decisive parts are added in `_identify`


def _identify(material: Material, fold: int | None) -> dict[str, Any]:
    """Return everything that decides the result of a run, for JSON; paths and the device do not."""
    config, planned, weights = material.config, material.planned, material.weights
    told, own = vars(config.conditions), vars(config)
    identity = {name: told[name] for name in ("views", "form", "length", "fps", "seed")}
    identity |= {name: value for name, value in own.items() if name not in NOT_DECISIVE}
    if not config.folds:
        del identity["folds"]  # as in files from before there were any
    if not config.in_the_way:
        del identity["in_the_way"]
    if config.optimiser != "published":
        del identity["clips"]  # they only end the training: with more of them, a checkpoint goes on
    identity["sensor"] = config.conditions.sensor_name
    identity["data_sha256"] = material.data.sha256
    identity["init_sha256"] = None if config.init is None else hashlib.sha256(config.init.read_bytes()).hexdigest()
    if material.sensor_sha256 is not None:
        identity["sensor_sha256"] = material.sensor_sha256
    if planned is not None:
        identity["planned_sha256"] = planned.sha256
    if fold is not None:
        identity["without"] = fold
    if weights is not None:
        identity["no_activity_weight"] = float(weights[-1])
    if material.late:
        identity["late_frames"] = True
    if not material.world.agrees_with(PAPER):
        identity["world"] = as_json(material.world.to_json())
    return identity


def _refuse_finished(path: Path, identity: dict[str, Any]) -> None:
    """Raise UsageError if there is a finished recogniser already: weights are never overwritten."""
    description = description_path(path)
    if not description.is_file() or not path.is_file():  # a process was killed between the two: the run goes on
        return
    what = "this very run has finished" if recorded_run(path) == identity else "it holds the result of another run"
    raise UsageError(f"{description}: {what}: remove it to train again, or choose another --out")
