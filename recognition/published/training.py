"""Trains and tests a network by the published protocol of Northwestern-UCLA; it goes on from its last epoch."""

import json
import math
import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.optim.swa_utils import update_bn

from ehar.arrays import FloatArray, IntArray
from ehar.conditions import Form
from ehar.data.motion_data import MotionData
from ehar.data.skeleton_tree import parents
from ehar.errors import DataError, ModelError, UsageError
from ehar.files import as_json, replacing
from ehar.processes import computed_ahead, cores
from recognition.freed_memory import keep_freed_memory
from recognition.networks.causal import CausalCTRGCN
from recognition.networks.sizes import Size
from recognition.networks.spec import Network, build_network
from recognition.published.clips import Stream, published_clip
from recognition.published.epochs import Draw, Epoch, draw_epoch
from recognition.training.arithmetic import arithmetic_on, quick_products
from recognition.training.averages import equal_average
from recognition.training.checkpoints import Checkpoint, load_checkpoint, save_checkpoint
from recognition.training.frame_weights import late_cross_entropy
from recognition.training.optimisers import PUBLISHED_EPOCHS, PUBLISHED_MOMENTUM, PUBLISHED_RATE, PUBLISHED_WARM_UP
from recognition.training.recorded_step import RecordedStep

# Where this protocol differs from that of NTU RGB+D, as `recognition.training.optimisers` has it:
DECAY = 1e-4  # of weights
DROP = 50  # the epoch from which the rate is a tenth

# Of results and checkpoints that can be used. 1 had training clips in which people leaned to the side, 2 means of
# weights whose batch norms had the mean of the epochs' statistics, 3 of the streaming form a loss in which all frames
# counted alike.
PROTOCOLS: Mapping[Form, int] = {"ctrgcn": 3, "causal": 4}
RATIOS = tuple(range(10, 101, 10))  # observation ratios of the test [%]
TEST_BATCH = 64
STATISTICS = 64  # training batches from which the mean of the weights gets statistics of its own

SAVED = 60.0  # seconds at least between checkpoints: on a GPU an epoch takes less


@dataclass(frozen=True)
class PublishedRun:
    """One training by the published protocol.

    Args:
        form: "ctrgcn" is the published network; "causal" the one that streams.
        stream: joints or bones.
        size: widths of the network.
        seed: for initial weights, order and random turns.
        epochs: 65, as published; fewer show that it runs.
    """

    form: Form
    stream: Stream
    size: Size
    seed: int = 0
    epochs: int = PUBLISHED_EPOCHS

    @property
    def name(self) -> str:
        """The stem of its files."""
        short = "" if self.epochs == PUBLISHED_EPOCHS else f"-{self.epochs}-epochs"
        return f"{self.form}-{self.stream}-{self.size}-seed{self.seed}{short}"


@dataclass(frozen=True, eq=False)
class PublishedResult:
    """The test of one training.

    Args:
        log_probs: (N, R, K) log-probabilities of the N test sequences after each of `RATIOS` of their frames, by the
            weights of the last epoch.
        mean: (N, R, K) those by the mean of the weights after each epoch at the lower rate, which is chosen on nothing.
            Its batch norms have statistics of `STATISTICS` training batches, where those of an epoch are of about ten.
        best: (N, K) those of whole sequences by the weights of the epoch that is best on the test, among those at the
            lower rate. The public code reports that epoch, so published figures chose on the test.
        best_epoch: that epoch, counted from 1.
        arithmetic: of the products of its last steps, `bfloat16` or `float32`.
    """

    log_probs: FloatArray
    mean: FloatArray
    best: FloatArray
    best_epoch: int
    arithmetic: str


def train_published(
    runs: Sequence[PublishedRun],
    data: MotionData,
    out: Path,
    *,
    device: str = "cpu",
    report: Callable[[PublishedRun, int, float], None] = lambda run, epoch, loss: None,
) -> list[PublishedResult]:
    """Train on the training split, test on the test split: on a CPU one run after another, on a GPU side by side.

    Args:
        runs: what to train.
        data: the data, with a split.
        out: folder of the results, and of checkpoints until then; what is done there is not done again.
        device: torch device.
        report: is told of each epoch: the run, how many are done, and the mean loss.

    Returns:
        the result of each run.

    Raises:
        DataError: the data has no split, or no training or no test sequence.
        UsageError: the files in `out` are of other data, or of an older version of this protocol.
        ModelError: the loss is not finite, or a checkpoint is damaged.
    """
    if data.is_test is None or data.is_test.all() or not data.is_test.any():
        raise DataError(f"{data.name}: expected training and test sequences, as `split` names them")
    keep_freed_memory()
    done = {run: _read(run, out, data) for run in runs if _results(run, out).is_file()}
    left = [run for run in runs if run not in done]
    for together in [left] if device != "cpu" else [[run] for run in left]:
        trainings = [_Training(run, data, out / f"{run.name}.checkpoint", torch.device(device)) for run in together]
        _train(trainings, data, report)
        for training in trainings:
            done[training.run] = training.finish(_results(training.run, out))
    return [done[run] for run in runs]


def _train(
    trainings: Sequence["_Training"], data: MotionData, report: Callable[[PublishedRun, int, float], None]
) -> None:
    """Train all epochs that are left, a step of each training in turn; on a GPU epochs are drawn ahead."""
    last = max((training.run.epochs for training in trainings), default=0)
    rounds = [
        [training for training in trainings if training.epoch <= epoch < training.run.epochs] for epoch in range(last)
    ]
    draws = [
        Draw(training.run.stream, training.run.seed, epoch) for epoch, some in enumerate(rounds) for training in some
    ]
    if any(training.device.type != "cpu" for training in trainings):
        torch.backends.cudnn.benchmark = True  # all batches are alike, so the fastest kernels are found once
        workers = min(len(trainings), cores())
        drawn: Generator[Epoch] = computed_ahead(draw_epoch, data, draws, workers=workers, ahead=len(trainings))
    else:
        drawn = (draw_epoch(data, draw) for draw in draws)
    with closing(drawn):
        for number, learning in enumerate(rounds):
            for training in learning:
                training.begin_epoch(next(drawn))
            for _ in range(max((training.steps for training in learning), default=0)):
                for training in learning:
                    training.learn()
            for training in learning:
                report(training.run, number + 1, training.end_epoch())


def _results(run: PublishedRun, out: Path) -> Path:
    """Return the file of a finished run."""
    return out / f"{run.name}.npz"


def rate_of_epoch(epoch: int) -> float:
    """Return the learning rate of an epoch, counted from 0."""
    if epoch < PUBLISHED_WARM_UP:
        return PUBLISHED_RATE * (epoch + 1) / PUBLISHED_WARM_UP
    return PUBLISHED_RATE * (0.1 if epoch >= DROP else 1.0)


class _Training:
    """A network, its optimiser and how far it is."""

    def __init__(self, run: PublishedRun, data: MotionData, checkpoint: Path, device: torch.device) -> None:
        self.run, self.data, self.checkpoint, self.device = run, data, checkpoint, device
        self.network: Network = build_network(
            run.form,
            run.size,
            classes=len(data.class_names),
            channels=3,
            skeleton=data.skeleton,
            persons=data.persons,
            dropout=0.0,
            seed=run.seed,
        ).to(device)
        assert data.is_test is not None
        self.test_sequences = np.flatnonzero(data.is_test)
        self.parents = parents(data.skeleton)
        self.optimiser = torch.optim.SGD(
            self.network.parameters(), lr=PUBLISHED_RATE, momentum=PUBLISHED_MOMENTUM, weight_decay=DECAY, nesterov=True
        )
        self.identity = as_json({**asdict(run), "data_sha256": data.sha256, "protocol": PROTOCOLS[run.form]})
        self.best, self.best_epoch = torch.empty(0), 0  # see `PublishedResult`
        self.mean = equal_average(self.network)
        self.recorded: RecordedStep | None = None  # on a GPU
        self.epoch = 0
        self.steps = 0  # of an epoch
        self._left: Iterator[tuple[Tensor, Tensor]] = iter(())
        self._losses: list[float] = []
        self._saved = -math.inf
        self._resume()

    def begin_epoch(self, epoch: Epoch) -> None:
        """Take the clips of the next epoch."""
        rate = rate_of_epoch(self.epoch)
        if self.recorded is not None and rate != self.optimiser.param_groups[0]["lr"]:
            self.recorded.record_anew()
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        self.network.train()
        self.steps = len(epoch.labels)
        clips, labels = (torch.from_numpy(part).to(self.device) for part in (epoch.clips, epoch.labels))
        self._left = zip(clips, labels, strict=True)
        self._losses = []

    def learn(self) -> None:
        """Make a step on the next batch of the epoch; on a GPU it may run later."""
        clips, labels = next(self._left)
        if self.device.type == "cpu":
            self._losses.append(float(self._step(clips, labels)))
            return
        if self.recorded is None:
            self.recorded = RecordedStep(self._step, (clips, labels), self.device)
        self.recorded.make(clips, labels)

    def end_epoch(self) -> float:
        """Return the mean loss of the epoch; at the lower rate test and average, and save how far the training is."""
        loss = float(np.mean(self._losses)) if self.recorded is None else self.recorded.mean_loss()
        self.epoch += 1
        if not np.isfinite(loss):
            raise ModelError(f"{self.run.name}: the loss is {loss} in epoch {self.epoch}: expected a finite one")
        if self._counts(self.epoch):
            self._keep_best()
            self.mean.update_parameters(self.network)
        if time.monotonic() - self._saved >= SAVED or self.epoch == self.run.epochs:
            held = {"run": self.identity, "epoch": self.epoch, "best_epoch": self.best_epoch}
            states = {"network": self.network.state_dict(), "best": {"log_probs": self.best}}
            if self._counts(self.epoch):
                states["mean"] = self.mean.state_dict()
            save_checkpoint(self.checkpoint, Checkpoint(states, self.optimiser.state_dict(), held))
            self._saved = time.monotonic()
        return loss

    def _counts(self, epoch: int) -> bool:
        """Return whether an epoch counts in the mean of the weights, and may be the best."""
        return epoch > DROP or epoch == self.run.epochs

    def _keep_best(self) -> None:
        """Test on whole sequences, and keep the answers if more of them are right than ever before."""
        labels, answers = self.data.labels[self.test_sequences], self._test_at(100, self.network)
        before = accuracies([self.best.numpy()], labels) if self.best_epoch else -1.0
        if accuracies([answers.numpy()], labels) > before:
            self.best, self.best_epoch = answers, self.epoch

    def finish(self, path: Path) -> PublishedResult:
        """Test, write the result and remove the checkpoint."""
        clips = torch.from_numpy(draw_epoch(self.data, Draw(self.run.stream, self.run.seed, self.epoch)).clips)
        mean = self.mean.module
        # Izmailov et al. (UAI 2018, Sec. 3.2): averaged weights need statistics of their own.
        update_bn((self._input(batch, mean) for batch in clips[:STATISTICS]), mean)
        tests = self.test(self.network), self.test(mean)
        result = PublishedResult(*tests, self.best.numpy(), self.best_epoch, arithmetic_on(self.device))
        with replacing(path) as temporary, temporary.open("wb") as file:
            np.savez(
                file,
                allow_pickle=False,
                **vars(result),
                data_sha256=self.data.sha256,
                protocol=PROTOCOLS[self.run.form],
            )
        self.checkpoint.unlink(missing_ok=True)
        return result

    def test(self, network: nn.Module) -> FloatArray:
        """Return a network's log-probabilities of the test sequences after each observation ratio, (N, R, K)."""
        log_probs: FloatArray = torch.stack([self._test_at(ratio, network) for ratio in RATIOS], dim=1).numpy()
        return log_probs

    def _test_at(self, ratio: int, network: nn.Module) -> Tensor:
        """Return a network's log-probabilities (N, K) of the test sequences after an observation ratio [%]."""
        network.eval()
        clips = torch.from_numpy(np.stack([self._prefix(index, ratio) for index in self.test_sequences.tolist()]))
        with torch.inference_mode():
            parts = torch.split(clips, TEST_BATCH)
            logits = torch.cat([self._logits(part, network)[..., -1, :].cpu() for part in parts])
            return torch.log_softmax(logits, dim=-1)

    def _prefix(self, index: int, ratio: int) -> FloatArray:
        """Return the clip of the first frames of a sequence: what is scaled and cut is the prefix alone."""
        motion = self.data.sequence(index)
        seen = max(1, int(np.ceil(ratio / 100 * len(motion))))
        return published_clip(motion[:seen], self.run.stream, self.parents)

    def _step(self, clips: Tensor, labels: Tensor) -> Tensor:
        """Make one step and return its loss; where the form answers at each frame, later ones count more."""
        self.optimiser.zero_grad(set_to_none=True)
        with quick_products(self.device):
            logits = self._logits(clips, self.network).float()
        loss = late_cross_entropy(logits.flatten(0, 1), labels[:, None].expand(-1, logits.shape[1]))
        loss.backward()  # type: ignore[no-untyped-call]
        self.optimiser.step()
        return loss.detach()

    def _logits(self, clips: Tensor, network: nn.Module) -> Tensor:
        """Return logits (N, L, K) of clips (N, L, P, J, 3); the published form has one answer: (N, 1, K)."""
        answers: Tensor = network(self._input(clips, network))
        return answers if isinstance(network, CausalCTRGCN) else answers[:, None]

    def _input(self, clips: Tensor, network: nn.Module) -> Tensor:
        """Return clips (N, L, P, J, 3) as a network takes them: the published form has channels first, people last."""
        clips = clips.to(self.device)
        return clips if isinstance(network, CausalCTRGCN) else clips.permute(0, 4, 1, 3, 2)

    def _resume(self) -> None:
        """Go on from the checkpoint, if there is one."""
        if not self.checkpoint.is_file():
            return
        try:
            saved = load_checkpoint(self.checkpoint)
            same, epoch = saved.held["run"] == self.identity, int(saved.held["epoch"])
            if same:
                self.network.load_state_dict(saved.states["network"])
                self.optimiser.load_state_dict(saved.optimiser or {})
                self.best, self.best_epoch = saved.states["best"]["log_probs"], int(saved.held["best_epoch"])
                if self._counts(epoch):
                    self.mean.load_state_dict(saved.states["mean"])
        except Exception as error:  # the damage decides its type
            raise ModelError(f"{self.checkpoint}: expected a checkpoint, got {type(error).__name__}") from error
        if not same:
            got = json.dumps(saved.held["run"])
            raise UsageError(
                f"{self.checkpoint}: a checkpoint of another run: {got}; remove it, or choose another --out"
            )
        self.epoch = epoch


def _read(run: PublishedRun, out: Path, data: MotionData) -> PublishedResult:
    """Read the result of a finished run."""
    path = _results(run, out)
    with np.load(path, allow_pickle=False) as held:
        wrong = ""
        if str(held["data_sha256"]) != data.sha256:
            wrong = f"the result of other data than {data.name}"
        elif "protocol" not in held or int(held["protocol"]) != PROTOCOLS[run.form]:
            wrong = "the result of an older version of ehar, which turned clips, averaged or weighed frames otherwise"
        if wrong:
            raise UsageError(f"{path}: {wrong}: remove it, or choose another --out")
        return PublishedResult(
            held["log_probs"], held["mean"], held["best"], int(held["best_epoch"]), str(held["arithmetic"])
        )


def accuracies(log_probs: Sequence[FloatArray], labels: IntArray) -> FloatArray:
    """Return the accuracy [%] of one stream, or of several together, (...).

    Log-probabilities are added up. They are logits but for a constant, and the public code adds up logits.

    Args:
        log_probs: of each stream, (N, ..., K).
        labels: (N,) true classes.
    """
    answers = np.sum(log_probs, axis=0).argmax(axis=-1)
    return np.asarray(100 * (answers.T == labels).T.mean(axis=0))
