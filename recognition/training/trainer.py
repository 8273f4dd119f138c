"""Trains a recogniser on all observation ratios at once, with early stopping and checkpoints to resume from."""

import ctypes
import hashlib
import json
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from ehar.arrays import FloatArray
from ehar.data.scenario import split_parts
from ehar.errors import ModelError, UsageError
from ehar.files import as_json, parse_json
from ehar.sensors.registry import load_sensor
from recognition.calibration import fit_temperature
from recognition.networks.causal import CausalCTRGCN
from recognition.networks.spec import Network, NetworkSpec
from recognition.setting import load_motion_of
from recognition.storage import load_weights, recogniser_path, save_recogniser
from recognition.training.checkpoints import Checkpoint, load_checkpoint, save_checkpoint
from recognition.training.clips import Clips, ClipSource
from recognition.training.config import TrainingConfig
from recognition.training.optimisers import make_optimiser, may_stop, published_rate
from recognition.weight_files import description_path, recorded_run

WARM_UP = 0.05  # share of the steps in which the learning rate rises
GRADIENT_NORM = 1.0  # gradients are clipped to this norm
VALIDATION_CLIPS = 384
VALIDATION_SEED = 1_000_003  # draws the same clips for every run on the same data
PREFIXES = 10  # observation ratios at which the published form is validated: its prefixes are not cheap


@dataclass(frozen=True)
class Evaluation:
    """The result of one evaluation on the validation clips."""

    step: int
    train_loss: float
    nll: float
    accuracy: float  # mean over frames, in [0, 1]


@dataclass(frozen=True)
class _Held:
    """The JSON of a checkpoint: the identity and the progress of its run."""

    run: dict[str, Any]
    step: int
    evaluations: tuple[Evaluation, ...]


Report = Callable[[int, int, "Evaluation | None"], None]  # (step, steps, an evaluation if there was one)


def train_recogniser(config: TrainingConfig, report: Report | None = None) -> Evaluation:
    """Train, calibrate and save a recogniser; return its best evaluation.

    The clips, dropout and learning rate of a step depend only on its number and the seed. So a run that is stopped and
    started again ends like one that ran through.

    Args:
        config: the settings of the training.
        report: called after every step.

    Raises:
        UsageError: an option is unknown or below 1, or `out` holds a checkpoint of another run.
        DataError: the data is malformed, or has no training sequence of `length` frames.
        ModelError: the loss is not finite, the checkpoint is damaged, or `init` does not fit.
    """
    for field in ("clips", "batch", "evaluations", "patience"):
        if getattr(config, field) < 1:
            raise UsageError(f"--{field}: got {getattr(config, field)}, expected at least 1")
    device_type = config.device.partition(":")[0]
    if device_type not in ("cpu", "cuda") or (device_type == "cuda" and not torch.cuda.is_available()):
        raise UsageError(f"--device {config.device}: expected cpu, or cuda where there is such a device")
    if config.threads:
        torch.set_num_threads(config.threads)
    _keep_freed_memory()
    run = _Run(config)
    _refuse_finished(run.path, run.identity)
    return run.train(report or (lambda step, steps, evaluation: None))


class _Run:
    """One training run: its data, network, optimiser and evaluations."""

    def __init__(self, config: TrainingConfig) -> None:
        self.config = config
        data = load_motion_of(config.conditions)
        parts = split_parts(data)
        loaded = load_sensor(config.conditions.sensor, data)

        def source(sequences: Any, augment: bool) -> ClipSource:
            return ClipSource(
                data=data,
                sequences=sequences,
                length=config.conditions.length,
                sensor=loaded.sensor,
                views=config.conditions.views,
                augment=augment,
            )

        self.source = source(parts.recogniser, augment=True)
        # If no sequence of the validation part is long enough, we validate on the recogniser's own part.
        self.held_out = bool((data.lengths[parts.validation] >= config.conditions.length).any())
        held_out = source(parts.validation if self.held_out else parts.recogniser, augment=False)
        self.validation = held_out.draw(np.random.default_rng(VALIDATION_SEED), VALIDATION_CLIPS)
        self.spec = NetworkSpec.of(data, form=config.conditions.form, size=config.size, length=config.conditions.length)
        self.data_title = data.title
        self.device = torch.device(config.device)
        self.network: Network = self.spec.build(config.conditions.seed).to(self.device)
        if config.init is not None:
            load_weights(config.init, self.network)
        self.identity = _identify(config, data.sha256)
        if loaded.sha256 is not None:
            self.identity["sensor_sha256"] = loaded.sha256
        self.optimiser = make_optimiser(
            self.network, config.optimiser, learning_rate=config.learning_rate, weight_decay=config.weight_decay
        )
        self.steps = max(1, config.clips // config.batch)
        self.step = 0
        self.evaluations: list[Evaluation] = []
        self.best: dict[str, Tensor] = {}
        self.path = recogniser_path(config.out, config.conditions)
        self.checkpoint = self.path.with_suffix(".checkpoint")

    def train(self, report: Report) -> Evaluation:
        self._resume()
        interval = max(1, self.steps // self.config.evaluations)
        losses: list[float] = []
        while self.step < self.steps and not self._stalled():
            losses.append(self._learn())
            evaluation = None
            if self.step % interval == 0 or self.step == self.steps:
                evaluation = self._evaluate(float(np.mean(losses)))
                losses = []
                self._save_checkpoint()
            report(self.step, self.steps, evaluation)
        return self._finish()

    def _learn(self) -> float:
        """Make one step and return its loss."""
        config = self.config
        rng = np.random.default_rng((config.conditions.seed, self.step))
        clips = self.source.draw(rng, config.batch)
        published, progress = config.optimiser == "published", self.step / self.steps
        for group in self.optimiser.param_groups:
            group["lr"] = published_rate(progress) if published else config.learning_rate * _schedule(progress)
        self.network.train()
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(int(rng.integers(2**31)))  # dropout
            loss = self._loss(clips, rng)
        value = float(loss.detach())
        if not np.isfinite(value):
            raise ModelError(f"{self.path.name}: the loss is {value} at step {self.step}: expected a finite one")
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        if not published:
            torch.nn.utils.clip_grad_norm_(self.network.parameters(), GRADIENT_NORM)
        self.optimiser.step()
        self.step += 1
        return value

    def _loss(self, clips: Clips, rng: np.random.Generator) -> Tensor:
        """Return the mean cross-entropy over clips and frames; for the published form, over clips at one prefix."""
        seen, labels = clips.features.to(self.device), clips.labels.to(self.device)
        if isinstance(self.network, CausalCTRGCN):
            logits = self.network(seen)
            frames = logits.shape[1]
            return functional.cross_entropy(logits.flatten(0, 1), labels.repeat_interleave(frames))
        prefix = int(rng.integers(1, self.config.conditions.length + 1))
        return functional.cross_entropy(self.network(seen[:, :prefix].permute(0, 4, 1, 3, 2)), labels)

    def _logits(self, clips: Clips) -> FloatArray:
        """Return validation logits (N, L, K); for the published form, a frame takes those of the next prefix."""
        self.network.eval()
        pieces = []
        length = self.config.conditions.length
        with torch.inference_mode():
            for seen in torch.split(clips.features, self.config.batch):
                batch = seen.to(self.device)
                if isinstance(self.network, CausalCTRGCN):
                    pieces.append(self.network(batch).cpu())
                else:
                    ends = np.unique(np.ceil(np.arange(1, PREFIXES + 1) / PREFIXES * length).astype(int))
                    known = [self.network(batch[:, :end].permute(0, 4, 1, 3, 2)).cpu() for end in ends]
                    pieces.append(torch.stack([known[i] for i in np.searchsorted(ends, np.arange(1, length + 1))], 1))
        return torch.cat(pieces).numpy()

    def _evaluate(self, train_loss: float) -> Evaluation:
        """Evaluate on the validation clips, and remember the best weights."""
        logits = torch.from_numpy(self._logits(self.validation))
        labels = self.validation.labels[:, None].expand(logits.shape[:2])
        nll = float(functional.cross_entropy(logits.flatten(0, 1), labels.flatten()))
        accuracy = float((logits.argmax(dim=-1) == labels).float().mean())
        if not np.isfinite(nll):
            raise ModelError(
                f"{self.path.name}: the validation loss is {nll} at step {self.step}: expected a finite one"
            )
        if nll < min((past.nll for past in self.evaluations), default=float("inf")):
            self.best = {name: tensor.detach().clone() for name, tensor in self.network.state_dict().items()}
        evaluation = Evaluation(self.step, train_loss, nll, accuracy)
        self.evaluations.append(evaluation)
        return evaluation

    def _stalled(self) -> bool:
        """Return whether validation has not improved for `patience` evaluations."""
        if not self.evaluations or not may_stop(self.config.optimiser, self.step / self.steps):
            return False
        best = min(range(len(self.evaluations)), key=lambda i: self.evaluations[i].nll)
        return len(self.evaluations) - 1 - best >= self.config.patience

    def _finish(self) -> Evaluation:
        """Calibrate and save the best weights, and remove the checkpoint."""
        self.network.load_state_dict(self.best)
        temperature = fit_temperature(self._logits(self.validation), self.validation.labels.numpy())
        history = {
            "data": self.data_title,
            "run": self.identity,
            "validated_on_held_out_sequences": self.held_out,
            "evaluations": [asdict(evaluation) for evaluation in self.evaluations],
        }
        save_recogniser(self.path, self.network, self.spec, temperature, history)
        self.checkpoint.unlink(missing_ok=True)
        return min(self.evaluations, key=lambda evaluation: evaluation.nll)

    def _save_checkpoint(self) -> None:
        """Keep everything that the next steps depend on."""
        held = asdict(_Held(self.identity, self.step, tuple(self.evaluations)))
        states = {"network": self.network.state_dict(), "best": self.best}
        save_checkpoint(self.checkpoint, Checkpoint(states, self.optimiser.state_dict(), held))

    def _resume(self) -> None:
        """Go on from the checkpoint, if this run has one."""
        if not self.checkpoint.is_file():
            return
        try:
            saved = load_checkpoint(self.checkpoint, str(self.device))
            held = parse_json(json.dumps(saved.held), _Held, "its JSON", "a checkpoint")
            same = held.run == as_json(self.identity)
            if same:
                self.network.load_state_dict(saved.states["network"])
                self.optimiser.load_state_dict(saved.optimiser or {})
                self.best, self.step = dict(saved.states["best"]), held.step
                self.evaluations = list(held.evaluations)
        except Exception as error:  # the damage decides its type, and it may be long
            reason = f"{type(error).__name__}: {error}".splitlines()[0][:120]
            raise ModelError(f"{self.checkpoint}: expected a training checkpoint, got {reason}") from error
        if not same:
            raise UsageError(
                f"{self.checkpoint}: a checkpoint of a run with other options or data: "
                f"run with those, remove it, or choose another --out"
            )


NOT_DECISIVE = ("conditions", "out", "threads", "device", "init")  # their decisive parts are added in `_identify`


def _identify(config: TrainingConfig, data_sha256: str) -> dict[str, Any]:
    """Return everything that decides the result of a run, for JSON; paths and the device do not."""
    told, own = vars(config.conditions), vars(config)
    identity = {name: told[name] for name in ("views", "form", "length", "fps", "seed")}
    identity |= {name: value for name, value in own.items() if name not in NOT_DECISIVE}
    identity["sensor"] = config.conditions.sensor_name
    init_sha256 = None if config.init is None else hashlib.sha256(config.init.read_bytes()).hexdigest()
    return {**identity, "data_sha256": data_sha256, "init_sha256": init_sha256}


def _refuse_finished(path: Path, identity: dict[str, Any]) -> None:
    """Raise UsageError if there is a finished recogniser already: weights are never overwritten."""
    description = description_path(path)
    if not description.is_file():
        return
    what = "this very run has finished" if recorded_run(path) == identity else "it holds the result of another run"
    raise UsageError(f"{description}: {what}: remove it to train again, or choose another --out")


def _schedule(progress: float) -> float:
    """Return the learning rate as a share of its peak: a linear rise, then a cosine to zero."""
    if progress < WARM_UP:
        return (progress + 1e-3) / (WARM_UP + 1e-3)
    return 0.5 * (1 + float(np.cos(np.pi * (progress - WARM_UP) / (1 - WARM_UP))))


def _keep_freed_memory() -> None:
    """Make glibc keep large freed blocks: new mappings for every layer took half of the time."""
    if sys.platform == "linux":
        trim_threshold, mmap_threshold, gigabyte = -1, -3, 1 << 30
        libc = ctypes.CDLL(None)
        if hasattr(libc, "mallopt"):
            libc.mallopt(mmap_threshold, gigabyte)
            libc.mallopt(trim_threshold, 2 * gigabyte - 1)
