"""Trains a recogniser on all observation ratios at once, until more clips bring no more; resumes from checkpoints."""

import hashlib
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional
from torch.optim.swa_utils import AveragedModel

from ehar.arrays import FloatArray
from ehar.data.recordings import UNKNOWN_SUBJECT
from ehar.data.scenario import split_parts
from ehar.data.streams.data import StreamData
from ehar.errors import ModelError, UsageError
from ehar.files import as_json, check_folder, parse_json
from ehar.sensors.registry import load_sensor
from ehar.world import PAPER, load_world
from recognition.calibration import fit_temperature
from recognition.devices import check_device
from recognition.freed_memory import keep_freed_memory
from recognition.networks.causal import CausalCTRGCN
from recognition.networks.spec import Network, NetworkSpec
from recognition.setting import load_recordings_of, with_length
from recognition.storage import load_weights, recogniser_path, save_recogniser
from recognition.torch_threads import one_torch_thread
from recognition.training.checkpoints import Checkpoint, load_checkpoint, save_checkpoint
from recognition.training.clips import Clips, ClipSource
from recognition.training.config import TrainingConfig
from recognition.training.frame_weights import frame_weights
from recognition.training.optimisers import make_optimiser, published_rate
from recognition.training.stopping import (
    Evaluation,
    Outcome,
    conclude,
    enough_clips,
    has_learned,
    next_evaluation,
)
from recognition.weight_files import description_path, recorded_run

WARM_UP = 150  # steps in which the learning rate rises; then it stays
AVERAGING = 8.0  # how much late weights count in the average: about the last ninth of the steps
GRADIENT_NORM = 1.0  # gradients are clipped to this norm
WINDOW = 4.0  # [s], the usual length of a training clip of streams
VALIDATION_CLIPS = 768
VALIDATION_SEED = 1_000_003  # draws the same clips for every run on the same data
PREFIXES = 10  # observation ratios at which the published form is validated: its prefixes are not cheap


@dataclass(frozen=True)
class _Held:
    """The JSON of a checkpoint: the identity and the progress of its run."""

    run: dict[str, Any]
    step: int
    evaluations: tuple[Evaluation, ...]
    losses: tuple[float, ...]  # of the steps since the last evaluation


# (clips so far, clips after which it would stop if nothing got better, all evaluations if there is a new one)
Report = Callable[[int, int, "Sequence[Evaluation] | None"], None]


def train_recogniser(config: TrainingConfig, report: Report | None = None) -> Outcome:
    """Train, calibrate and save a recogniser.

    The learning rate is constant after a short rise, and the weights that count are a running average over the steps:
    polynomial-decay averaging (Shamir and Zhang, ICML 2013, Sec. 4). So no length has to be known beforehand. Training
    stops when twice the clips have gained too little on validation (`recognition.training.stopping`).

    The clips and dropout of a step depend only on its number and the seed. So a run that is stopped and started again
    ends like one that ran through.

    Args:
        config: the settings of the training.
        report: called after every step.

    Raises:
        UsageError: an option is unknown or below 1; `out` cannot be written to, or holds a checkpoint of another run.
        DataError: the data is malformed, or has no training sequence of `length` frames.
        ModelError: the loss is not finite, the checkpoint is damaged, or `init` does not fit.
    """
    for field in ("clips", "batch", "interval"):
        if getattr(config, field) < 1:
            raise UsageError(f"--{field}: got {getattr(config, field)}, expected at least 1")
    check_device(config.device)
    check_folder(config.out)
    if config.threads:
        torch.set_num_threads(config.threads)
    keep_freed_memory()
    run = _Run(config)
    _refuse_finished(run.path, run.identity)
    return run.train(report or (lambda clips, expected, evaluations: None))


def time_step(config: TrainingConfig, steps: int = 3) -> float:
    """Return how long a step takes on one thread of this machine [s]; nothing is kept.

    It is time of a core, which other programs do not lengthen; on a GPU it is time of the clock.

    Args:
        config: the settings of the training.
        steps: number of steps that are timed, after one that is not.

    Raises:
        EharError: as `train_recogniser`.
    """
    clock = time.process_time if config.device == "cpu" else time.perf_counter
    with one_torch_thread():
        run = _Run(config)
        run._learn()
        begin = clock()
        for _ in range(steps):
            run._learn()
        return (clock() - begin) / steps


class _Run:
    """One training run: its data, network, optimiser and evaluations."""

    def __init__(self, config: TrainingConfig) -> None:
        data = load_recordings_of(config.conditions)
        config = replace(config, conditions=with_length(config.conditions, data, WINDOW))
        self.config = config
        parts = split_parts(data)
        world = load_world(config.conditions.world)
        loaded = load_sensor(config.conditions.sensor, data, world)

        def source(sequences: Any, augment: bool) -> ClipSource:
            return ClipSource(
                data=data,
                sequences=sequences,
                length=config.conditions.frames,
                sensor=loaded.sensor,
                views=config.conditions.views,
                form=config.conditions.form,
                augment=augment,
                world=world,
            )

        self.source = source(parts.recogniser, augment=True)
        # If no sequence of the validation part is long enough, we validate on the recogniser's own part.
        has_own = bool((data.lengths[parts.validation] >= config.conditions.frames).any())
        held_out = source(parts.validation if has_own else parts.recogniser, augment=False)
        people = data.subjects[parts.validation]
        if not has_own:
            self.validated_on = "its own training sequences"
        elif (people == UNKNOWN_SUBJECT).any():
            self.validated_on = "other sequences, of people whom the data do not name"
        else:
            known = np.isin(people, data.subjects[parts.recogniser]).all()
            self.validated_on = "other sequences of people it knows" if known else "people it does not know"
        self.validation = held_out.draw(np.random.default_rng(VALIDATION_SEED), VALIDATION_CLIPS)
        self.weights = frame_weights(data, parts.recogniser) if isinstance(data, StreamData) else None
        self.spec = NetworkSpec.of(
            data, form=config.conditions.form, size=config.size, length=config.conditions.frames, world=world
        )
        self.data_title = data.title
        self.device = torch.device(config.device)
        self.network: Network = self.spec.build(config.conditions.seed).to(self.device)
        if config.init is not None:
            load_weights(config.init, self.network)
        self.average = AveragedModel(self.network, avg_fn=_towards_late, use_buffers=True)
        self.identity = _identify(config, data.sha256)
        if loaded.sha256 is not None:
            self.identity["sensor_sha256"] = loaded.sha256
        if self.weights is not None:
            self.identity["no_activity_weight"] = float(self.weights[-1])
        if not world.agrees_with(PAPER):
            self.identity["world"] = as_json(world.to_json())
        self.optimiser = make_optimiser(
            self.network, config.optimiser, learning_rate=config.learning_rate, weight_decay=config.weight_decay
        )
        self.steps = max(1, config.clips // config.batch)
        self.step = 0
        self.evaluations: list[Evaluation] = []
        self.losses: list[float] = []
        self.best: dict[str, Tensor] = {}
        self.path = recogniser_path(config.out, config.conditions)
        self.checkpoint = self.path.with_suffix(".checkpoint")

    def train(self, report: Report) -> Outcome:
        self._resume()
        interval = max(1, self.config.interval // self.config.batch)
        while self.step < self.steps and (self.runs_to_end or not has_learned(self.evaluations)):
            self.losses.append(self._learn())
            evaluated = self.step >= next_evaluation(self.evaluations, interval) or self.step == self.steps
            if evaluated:
                self._evaluate()
            if evaluated or self.step % interval == 0:
                self._save_checkpoint()
            report(self.clips, self._expected_clips(), self.evaluations if evaluated else None)
        return self._finish()

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

    def _learn(self) -> float:
        """Make one step and return its loss."""
        config = self.config
        rng = np.random.default_rng((config.conditions.seed, self.step))
        clips = self.source.draw(rng, config.batch)
        rate = config.learning_rate * min(1.0, (self.step + 1) / WARM_UP)
        if self.runs_to_end:
            rate = published_rate(self.step / self.steps)
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        self.network.train()
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(int(rng.integers(2**31)))  # dropout
            loss = self._loss(clips, rng)
        value = float(loss.detach())
        if not np.isfinite(value):
            raise ModelError(f"{self.path.name}: the loss is {value} at step {self.step}: expected a finite one")
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        if not self.runs_to_end:
            torch.nn.utils.clip_grad_norm_(self.network.parameters(), GRADIENT_NORM)
        self.optimiser.step()
        self.average.update_parameters(self.network)
        self.step += 1
        return value

    def _loss(self, clips: Clips, rng: np.random.Generator) -> Tensor:
        """Return the mean cross-entropy over clips and frames; for the published form, over clips at one prefix.

        In streams frames count by `frame_weights`.
        """
        seen, labels = clips.features.to(self.device), clips.labels.to(self.device)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=has_bfloat16(self.device)):
            if isinstance(self.network, CausalCTRGCN):
                logits = self.network(seen).flatten(0, 1)
                labels = clips.frame_labels.flatten().to(self.device)
            else:
                prefix = int(rng.integers(1, self.config.conditions.frames + 1))
                logits = self.network(seen[:, :prefix].permute(0, 4, 1, 3, 2))
        return functional.cross_entropy(logits.float(), labels, weight=self._class_weights(self.device))

    def _class_weights(self, device: torch.device) -> Tensor | None:
        return None if self.weights is None else torch.from_numpy(self.weights.astype(np.float32)).to(device)

    def _logits(self, network: Network, clips: Clips) -> FloatArray:
        """Return validation logits (N, L, K); for the published form, a frame takes those of the next prefix."""
        network.eval()
        pieces = []
        length = self.config.conditions.frames
        with torch.inference_mode():
            for seen in torch.split(clips.features, self.config.batch):
                batch = seen.to(self.device)
                if isinstance(network, CausalCTRGCN):
                    pieces.append(network(batch).cpu())
                else:
                    ends = np.unique(np.ceil(np.arange(1, PREFIXES + 1) / PREFIXES * length).astype(int))
                    known = [network(batch[:, :end].permute(0, 4, 1, 3, 2)).cpu() for end in ends]
                    pieces.append(torch.stack([known[i] for i in np.searchsorted(ends, np.arange(1, length + 1))], 1))
        return torch.cat(pieces).numpy()

    def _evaluate(self) -> None:
        """Evaluate the averaged weights on the validation clips, and remember the best."""
        network = self._averaged()
        logits = torch.from_numpy(self._logits(network, self.validation))
        labels = self.validation.frame_labels
        weight = self._class_weights(torch.device("cpu"))
        nll = float(functional.cross_entropy(logits.flatten(0, 1), labels.flatten(), weight=weight))
        right = (logits.argmax(dim=-1) == labels).float()
        accuracy = float(right.mean() if weight is None else (right * weight[labels]).sum() / weight[labels].sum())
        if not np.isfinite(nll):
            raise ModelError(
                f"{self.path.name}: the validation loss is {nll} at step {self.step}: expected a finite one"
            )
        if accuracy >= max((past.accuracy for past in self.evaluations), default=0.0):
            self.best = {name: tensor.detach().clone() for name, tensor in network.state_dict().items()}
        train_loss = float(np.mean(self.losses))
        self.losses = []
        self.evaluations.append(Evaluation(self.step, self.clips, train_loss, nll, accuracy))

    def _averaged(self) -> Network:
        """Return the network with the weights that count: with the published optimiser the last ones, as they are."""
        network = self.network if self.runs_to_end else self.average.module
        assert isinstance(network, Network)
        return network

    def _finish(self) -> Outcome:
        """Calibrate and save the best weights, and remove the checkpoint."""
        self.network.load_state_dict(self.best)
        temperature = fit_temperature(
            self._logits(self.network, self.validation), self.validation.labels.numpy(), self.weights
        )
        begun = self.config.init is not None
        outcome = conclude(self.evaluations, self.clips, runs_to_end=self.runs_to_end, begun=begun)
        history = {
            "data": self.data_title,
            "run": self.identity,
            "validated_on": self.validated_on,
            "stopped": outcome.reason,
            "cut_short": outcome.cut_short,
            "arithmetic": "bfloat16" if has_bfloat16(self.device) else "float32",
            "evaluations": [asdict(evaluation) for evaluation in self.evaluations],
        }
        save_recogniser(self.path, self.network, self.spec, temperature, history)
        self.checkpoint.unlink(missing_ok=True)
        return outcome

    def _save_checkpoint(self) -> None:
        """Keep everything that the next steps depend on."""
        held = asdict(_Held(self.identity, self.step, tuple(self.evaluations), tuple(self.losses)))
        states = {"network": self.network.state_dict(), "average": self.average.state_dict(), "best": self.best}
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
                self.average.load_state_dict(saved.states["average"])
                self.optimiser.load_state_dict(saved.optimiser or {})
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


NOT_DECISIVE = ("conditions", "out", "threads", "device", "init")  # their decisive parts are added in `_identify`


def _identify(config: TrainingConfig, data_sha256: str) -> dict[str, Any]:
    """Return everything that decides the result of a run, for JSON; paths and the device do not."""
    told, own = vars(config.conditions), vars(config)
    identity = {name: told[name] for name in ("views", "form", "length", "fps", "seed")}
    identity |= {name: value for name, value in own.items() if name not in NOT_DECISIVE}
    if config.optimiser != "published":
        del identity["clips"]  # they only end the training: with more of them, a checkpoint goes on
    identity["sensor"] = config.conditions.sensor_name
    init_sha256 = None if config.init is None else hashlib.sha256(config.init.read_bytes()).hexdigest()
    return {**identity, "data_sha256": data_sha256, "init_sha256": init_sha256}


def _refuse_finished(path: Path, identity: dict[str, Any]) -> None:
    """Raise UsageError if there is a finished recogniser already: weights are never overwritten."""
    description = description_path(path)
    if not description.is_file() or not path.is_file():  # a process was killed between the two: the run goes on
        return
    what = "this very run has finished" if recorded_run(path) == identity else "it holds the result of another run"
    raise UsageError(f"{description}: {what}: remove it to train again, or choose another --out")


def _towards_late(average: Tensor, present: Tensor, averaged: Tensor | int) -> Tensor:
    """Return the running average after one more step: late steps weigh more, the first ones are forgotten."""
    share = float((AVERAGING + 1) / (averaged + AVERAGING + 1))
    if not average.is_floating_point():  # a counter of batches
        return present
    return average + share * (present - average)


def has_bfloat16(device: torch.device) -> bool:
    """Return whether products of bfloat16 are fast on a device; on such a processor training takes two thirds."""
    if device.type == "cuda":
        return bool(torch.cuda.is_bf16_supported())
    able = torch.cpu.get_capabilities()
    return bool(able.get("avx512_bf16") or able.get("amx_bf16"))
