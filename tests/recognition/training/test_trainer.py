"""Training: it learns, it resumes as if it had never stopped, and what goes wrong ends in one line."""

import errno
import json
import math
import os
import pickle
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import load_file
from torch import nn

from ehar.conditions import Conditions, Form
from ehar.data.motion_data import MotionData
from ehar.data.motion_file import load_motion, save_motion
from ehar.data.scenario import split_parts
from ehar.data.streams.file import save_streams
from ehar.errors import DataError, EharError, ModelError, UsageError
from recognition.storage import load_recogniser, recogniser_path
from recognition.training import material, stopping
from recognition.training import trainer as training
from recognition.training.checkpoints import load_checkpoint, save_checkpoint
from recognition.training.config import TrainingConfig
from recognition.training.stopping import Evaluation
from recognition.training.trainer import train_recogniser
from tests.helpers.fakes import tiny_data
from tests.helpers.settings import changed
from tests.helpers.streams import raising_streams

LENGTH = 8


@pytest.fixture(scope="module")
def data_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("data") / "tiny.npz"
    save_motion(path, tiny_data(sequences=24))
    return path


@pytest.fixture(autouse=True)
def few_validation_clips(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(material, "VALIDATION_CLIPS", 24)


@pytest.fixture
def config(data_path: Path, tmp_path: Path) -> TrainingConfig:
    """Return 6 steps with an evaluation and a checkpoint after each."""
    conditions = Conditions(data=str(data_path), length=LENGTH)
    return TrainingConfig(conditions=conditions, out=tmp_path / "models", clips=48, batch=8, interval=8, threads=1)


def weights_path(config: TrainingConfig) -> Path:
    return recogniser_path(config.out, config.conditions)


def checkpoint_path(config: TrainingConfig) -> Path:
    return weights_path(config).with_suffix(".checkpoint")


class Stopped(Exception):
    """Ctrl-C, at a chosen step."""


def stop_at(chosen: int) -> Callable[[int, int, Sequence[Evaluation] | None], None]:
    def report(clips: int, expected: int, evaluations: Sequence[Evaluation] | None) -> None:
        if clips == 8 * chosen:
            raise Stopped

    return report


def stopped(config: TrainingConfig, step: int = 2) -> Path:
    """Train for some steps; return the checkpoint that is left."""
    with pytest.raises(Stopped):
        train_recogniser(config, stop_at(step))
    return checkpoint_path(config)


def refusal(error: type[EharError], config: TrainingConfig, **changes: Any) -> str:
    """Return the one line that training with other options ends in."""
    with pytest.raises(error) as caught:
        train_recogniser(changed(config, **changes))
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("form", ["causal", "ctrgcn"])
def test_the_loss_falls_and_the_best_is_saved(config: TrainingConfig, data_path: Path, form: Form) -> None:
    seen: list[Evaluation] = []
    learning = changed(config, form=form, clips=640, batch=16, interval=160, views="paper")
    outcome = train_recogniser(learning, lambda clips, expected, found: seen.append(found[-1]) if found else None)
    assert [evaluation.clips for evaluation in seen] == [160, 320, 480, 640]
    assert seen[-1].train_loss < 0.9 * seen[0].train_loss
    assert seen[-1].nll < seen[0].nll
    assert outcome.best.accuracy == max(evaluation.accuracy for evaluation in seen)
    assert outcome.cut_short  # by its limit, long before it had learned
    recogniser = load_recogniser(replace(learning.conditions, models=learning.out), load_motion(data_path))
    assert recogniser.spec.length == LENGTH
    assert sorted(file.name for file in learning.out.iterdir()) == sorted(
        [weights_path(learning).name, weights_path(learning).with_suffix(".json").name]
    )  # no checkpoint, nothing half-written


def test_reports_every_step_and_evaluates_where_it_says(config: TrainingConfig) -> None:
    reports: list[tuple[int, int, bool]] = []
    train_recogniser(
        replace(config, interval=16), lambda clips, expected, found: reports.append((clips, expected, bool(found)))
    )
    assert reports == [(8 * step, 48, step % 2 == 0) for step in range(1, 7)]


def test_evaluations_come_farther_and_farther_apart(config: TrainingConfig) -> None:
    seen: list[int] = []
    train_recogniser(
        replace(config, clips=200), lambda clips, expected, found: seen.append(clips // 8) if found else None
    )
    assert seen == [1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 15, 18, 22, 25]


@pytest.mark.parametrize("form", ["causal", "ctrgcn"])
@pytest.mark.parametrize("step", [2, 3])  # right at a checkpoint, and one step after it
def test_a_stopped_run_resumes_bit_for_bit(config: TrainingConfig, tmp_path: Path, form: Form, step: int) -> None:
    through = changed(config, form=form, sensor="estimator", interval=16)
    stop_and_go = replace(through, out=tmp_path / "stopped")
    best = train_recogniser(through)
    stopped(stop_and_go, step)
    assert not weights_path(stop_and_go).exists()
    steps: list[int] = []
    assert train_recogniser(stop_and_go, lambda clips, expected, found: steps.append(clips // 8)) == best
    assert steps == [3, 4, 5, 6]
    first, second = load_file(weights_path(through)), load_file(weights_path(stop_and_go))
    assert first.keys() == second.keys()
    assert all(torch.equal(first[name], second[name]) for name in first)
    descriptions = [weights_path(run).with_suffix(".json").read_bytes() for run in (through, stop_and_go)]
    assert descriptions[0] == descriptions[1]
    assert not checkpoint_path(stop_and_go).exists()


def test_a_stopped_run_goes_on_with_more_clips(config: TrainingConfig, tmp_path: Path) -> None:
    longer = replace(config, clips=96)
    through = replace(longer, out=tmp_path / "through")
    train_recogniser(through)
    stopped(config)
    train_recogniser(longer)
    first, second = load_file(weights_path(through)), load_file(weights_path(longer))
    assert all(torch.equal(first[name], second[name]) for name in first)


def test_a_seed_decides_the_weights(config: TrainingConfig, tmp_path: Path) -> None:
    runs = [changed(config, out=tmp_path / str(i), seed=seed, clips=16) for i, seed in enumerate((0, 0, 1))]
    for run in runs:
        train_recogniser(run)
    first, again, other = (weights_path(run).read_bytes() for run in runs)
    assert first == again
    assert first != other


def test_training_leaves_the_global_generator_as_it_was(config: TrainingConfig) -> None:
    before = torch.random.get_rng_state()
    train_recogniser(replace(config, clips=8))
    assert torch.equal(torch.random.get_rng_state(), before)


@pytest.mark.parametrize(
    "changes",
    [{"seed": 1}, {"learning_rate": 1e-3}, {"length": 7}, {"interval": 16}, {"size": "published"}],
)
def test_a_checkpoint_of_other_options_is_refused(config: TrainingConfig, changes: dict[str, Any]) -> None:
    checkpoint = stopped(config)
    content = checkpoint.read_bytes()
    message = refusal(UsageError, config, **changes)
    assert message.startswith(f"{checkpoint}: a checkpoint of a run with other options or data")
    assert checkpoint.read_bytes() == content


def test_a_checkpoint_of_other_data_is_refused(config: TrainingConfig, tmp_path: Path) -> None:
    def moved(data: MotionData) -> MotionData:
        return replace(data, positions=data.positions * 1.01)

    own = changed(config, data=str(tmp_path / "own.npz"))
    save_motion(tmp_path / "own.npz", tiny_data(sequences=24))
    stopped(own)
    save_motion(tmp_path / "own.npz", moved(tiny_data(sequences=24)))
    assert "a checkpoint of a run with other options or data" in refusal(UsageError, own)


def test_a_checkpoint_goes_on_elsewhere(config: TrainingConfig) -> None:
    # Neither where the checkpoint lies nor how many threads work on it decides the result.
    stopped(config)
    moved = replace(config, out=config.out.rename(config.out.with_name("moved")), threads=0)
    train_recogniser(moved)
    assert weights_path(moved).is_file()


class Malicious:
    """Unpickling makes the folder `path`."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> Any:
        return os.mkdir, (str(self.path),)


@pytest.mark.filterwarnings("ignore:Detected pickle protocol:UserWarning")
@pytest.mark.parametrize("zipped", [True, False])
def test_a_malicious_checkpoint_is_not_executed(config: TrainingConfig, tmp_path: Path, zipped: bool) -> None:
    checkpoint, trap = checkpoint_path(config), tmp_path / "executed"
    checkpoint.parent.mkdir()
    if zipped:
        torch.save({"run": Malicious(trap)}, checkpoint)
    else:
        checkpoint.write_bytes(pickle.dumps(Malicious(trap)))
    message = refusal(ModelError, config)
    assert message.startswith(f"{checkpoint}: expected a training checkpoint, got ")
    assert len(message) < 400
    assert not trap.exists()


@pytest.mark.parametrize("kept", [0, 10, 5000])
def test_a_truncated_checkpoint(config: TrainingConfig, kept: int) -> None:
    checkpoint = stopped(config)
    checkpoint.write_bytes(checkpoint.read_bytes()[:kept])
    assert refusal(ModelError, config).startswith(f"{checkpoint}: expected a training checkpoint, got ")


@pytest.mark.parametrize("lost", ["run", "network", "average", "best", "step", "evaluations", "losses"])
def test_a_checkpoint_that_lacks_something(config: TrainingConfig, lost: str) -> None:
    checkpoint = stopped(config)
    content = load_checkpoint(checkpoint)
    states, held = (
        {name: value for name, value in part.items() if name != lost} for part in (content.states, content.held)
    )
    save_checkpoint(checkpoint, content._replace(states=states, held=held))
    message = refusal(ModelError, config)
    assert message.startswith(f"{checkpoint}: expected a training checkpoint, got ")
    assert lost in message


def test_a_checkpoint_of_another_network(config: TrainingConfig) -> None:
    # The same options, but a version of the code whose network had other layers.
    checkpoint = stopped(config)
    content = load_checkpoint(checkpoint)
    network = {name: tensor for name, tensor in content.states["network"].items() if name != "classify.bias"}
    save_checkpoint(checkpoint, content._replace(states={**content.states, "network": network}))
    assert refusal(ModelError, config).startswith(f"{checkpoint}: expected a training checkpoint, got ")


@pytest.mark.parametrize(("clips", "loss"), [(48, "the loss"), (8, "the validation loss")])
def test_a_loss_that_is_not_finite_names_the_step(config: TrainingConfig, clips: int, loss: str) -> None:
    message = refusal(ModelError, config, learning_rate=1e36, clips=clips, interval=64)
    assert message == f"causal-perfect-moving.safetensors: {loss} is nan at step 1: expected a finite one"
    assert not weights_path(config).exists()


def scripted(monkeypatch: pytest.MonkeyPatch, accuracies: list[float]) -> None:
    """Let evaluations find these accuracies, one after another."""
    evaluate = training._Run._evaluate

    def found(run: training._Run) -> None:
        before = dict(run.best)
        evaluate(run)
        own = replace(run.evaluations[-1], accuracy=accuracies[len(run.evaluations) - 1])
        is_best = own.accuracy >= max((past.accuracy for past in run.evaluations[:-1]), default=0.0)
        run.best = (
            {name: tensor.clone() for name, tensor in run.learner.averaged.state_dict().items()} if is_best else before
        )
        run.evaluations[-1] = own

    monkeypatch.setattr(training._Run, "_evaluate", found)


def test_stops_when_twice_the_clips_gain_too_little(config: TrainingConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stopping, "LEAST_CLIPS", 24)
    scripted(monkeypatch, [0.3, 0.3, 0.6, 0.8, 0.803, 0.804, 0.804, 0.804])
    outcome = train_recogniser(replace(config, clips=400))
    assert outcome.best.step == 8  # of equal ones the last; at 8 the best at half as many is 0.8
    assert not outcome.cut_short
    assert outcome.gain == pytest.approx(0.004)
    assert outcome.reason == "it had learned: twice the clips, 32 to 64, gained 0.4 points on validation"
    assert json.loads(weights_path(config).with_suffix(".json").read_text())["training"]["stopped"] == outcome.reason


def test_a_plateau_before_the_first_clips_is_no_end(config: TrainingConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    scripted(monkeypatch, [0.1] * 6)
    outcome = train_recogniser(config)
    assert outcome.cut_short
    assert outcome.reason == "cut short at 48 clips: twice the clips, 24 to 48, gained 0.0 points"


def test_the_best_weights_are_kept_not_the_last(config: TrainingConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    snapshots: list[dict[str, torch.Tensor]] = []
    scripted(monkeypatch, [0.1, 0.2, 0.5, 0.4, 0.3, 0.2])
    evaluate = training._Run._evaluate

    def watched(run: training._Run) -> None:
        evaluate(run)
        snapshots.append({name: tensor.clone() for name, tensor in run.learner.averaged.state_dict().items()})

    monkeypatch.setattr(training._Run, "_evaluate", watched)
    assert train_recogniser(config).best.step == 3
    written = load_file(weights_path(config))
    assert all(torch.equal(written[name], snapshots[2][name]) for name in written)
    assert not all(torch.equal(written[name], snapshots[5][name]) for name in written)


def test_batches_that_are_drawn_ahead_for_a_gpu_are_the_same(config: TrainingConfig) -> None:
    run = training._Run(config)
    here = list(run.batches(3))
    run.config = replace(run.config, device="cuda")
    for one, other in zip(run.batches(3), here, strict=True):
        torch.testing.assert_close(one.clips.features, other.clips.features, rtol=0, atol=0)
        assert torch.equal(one.clips.labels, other.clips.labels)
        assert one.rng.integers(2**31) == other.rng.integers(2**31)  # dropout is the same too


def test_the_weights_that_count_are_an_average_over_late_steps(config: TrainingConfig) -> None:
    # Polynomial-decay averaging: the k-th of n weights counts as much as (k + 1) (k + 2) ... (k + 8).
    run = training._Run(config)
    weights = []
    for batch in run.batches(5):
        run._learn(batch)
        weights.append(run.learner.network.classify.weight.detach().clone())
    shares = torch.tensor([float(np.prod(np.arange(k + 1, k + 9))) for k in range(5)])
    expected = sum(share * weight for share, weight in zip(shares / shares.sum(), weights, strict=True))
    torch.testing.assert_close(run.learner.averaged.classify.weight, expected)


class CountsFrames(nn.Module):
    """A network of the published form that says how many frames it sees."""

    def forward(self, clips: torch.Tensor) -> torch.Tensor:
        """Return them for clips (N, C, T, J, P), as logits (N, 1)."""
        return torch.full((len(clips), 1), float(clips.shape[2]))


@pytest.mark.parametrize("length", [1, 4, 60])
def test_the_published_form_is_validated_on_what_it_has_seen_and_no_more(config: TrainingConfig, length: int) -> None:
    learner = training._Run(changed(config, form="ctrgcn")).learner
    seen = learner.logits(CountsFrames(), torch.zeros(3, length, 2, 5, 4))[..., 0]  # type: ignore[arg-type]
    now = np.arange(1, length + 1)
    assert seen.shape == (3, length)
    assert (seen <= now).all() and (seen > now - 1 - length / 9).all()
    assert (seen[:, 0] == 1).all() and (seen[:, -1] == length).all()


def test_late_frames_count_more_in_clips_and_where_the_form_streams(config: TrainingConfig, tmp_path: Path) -> None:
    save_streams(tmp_path / "raising.npz", raising_streams())
    streams = Conditions(data=tmp_path / "raising.npz", length=LENGTH)
    for number, (conditions, late) in enumerate(
        (
            (config.conditions, True),
            (replace(config.conditions, form="ctrgcn"), False),
            (streams, False),
        )
    ):
        run = training._Run(replace(config, conditions=conditions, out=tmp_path / str(number)))
        assert (run.learner._late, run.identity.get("late_frames", False)) == (late, late)


def test_only_the_recogniser_s_own_part_is_learnt_from(config: TrainingConfig, data_path: Path) -> None:
    run = training._Run(config)
    parts = split_parts(load_motion(data_path))
    assert set(run.material.source._sequences) == set(parts.recogniser)
    assert not set(run.material.source._sequences) & set(parts.test)


def test_unknown_options(config: TrainingConfig) -> None:
    assert "unknown views 'spiral'" in refusal(UsageError, config, views="spiral")
    assert "unknown sensor 'radar'" in refusal(UsageError, config, sensor="radar")
    assert not config.out.exists()


@pytest.mark.parametrize(
    ("field", "value"),
    [
        *(
            ("clips", 0),
            ("batch", 0),
            ("batch", 1),
            ("interval", 0),
            ("length", 0),
            ("threads", -1),
            ("threads", 10**12),
            ("folds", -1),
        ),
        *(("learning_rate", value) for value in (-1.0, math.inf, math.nan)),
        *(("weight_decay", value) for value in (-1.0, math.inf, math.nan)),
    ],
)
def test_numbers_that_make_no_sense(config: TrainingConfig, field: str, value: float) -> None:
    said = refusal(UsageError, config, **{field: value})
    assert f"{field.replace('_', '-')}: " in said and f"got {value}" in said


def test_data_without_a_sequence_as_long_as_a_clip(config: TrainingConfig) -> None:
    assert "expected a training sequence of at least 21 frames" in refusal(DataError, config, length=21)


def test_data_with_nothing_to_tell_apart(config: TrainingConfig, data_path: Path, tmp_path: Path) -> None:
    data = load_motion(data_path)
    path = tmp_path / "one.npz"
    save_motion(path, replace(data, labels=np.zeros_like(data.labels), class_names=("nod",)))
    assert (
        refusal(DataError, config, data=str(path)) == "one: expected at least 2 classes to tell apart, got 'nod' alone"
    )


def test_a_finished_recogniser_is_not_overwritten(config: TrainingConfig) -> None:
    train_recogniser(config)
    before = weights_path(config).read_bytes()
    description = weights_path(config).with_suffix(".json")
    assert refusal(UsageError, config).startswith(f"{description}: this very run has finished")
    assert refusal(UsageError, config, seed=1).startswith(f"{description}: it holds the result of another run")
    assert weights_path(config).read_bytes() == before


def test_a_full_disk_ends_in_one_line_and_the_run_goes_on(
    config: TrainingConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    through = changed(config, out=tmp_path / "through")
    train_recogniser(through)
    for written in (0, 2, 4, 1):  # it stops at checkpoints, at the JSON beside the weights, and at the weights
        files, place = count(), Path.replace

        def full(
            path: Path, target: Path, files: "count[int]" = files, place: Any = place, written: int = written
        ) -> Path:
            if next(files) >= written:
                raise OSError(errno.ENOSPC, "No space left on device")
            return Path(place(path, target))

        with monkeypatch.context() as patch:
            patch.setattr(Path, "replace", full)
            assert refusal(UsageError, config).endswith(": cannot be written: No space left on device")
    assert weights_path(config).with_suffix(".json").is_file()
    assert not weights_path(config).exists(), "make takes them for the end of a training"
    train_recogniser(config)
    assert weights_path(config).read_bytes() == weights_path(through).read_bytes()


def test_training_starts_from_other_weights(config: TrainingConfig, tmp_path: Path) -> None:
    train_recogniser(config)
    # With a learning rate of 0 nothing but the running statistics moves away from what training starts from.
    other = changed(config, out=tmp_path / "other", init=weights_path(config), learning_rate=0.0, seed=1)
    train_recogniser(other)
    first, second = load_file(weights_path(config)), load_file(weights_path(other))
    learned = [name for name in first if "running" not in name and "num_batches" not in name]
    assert all(torch.equal(first[name], second[name]) for name in learned)


def test_weights_of_another_shape_to_start_from(config: TrainingConfig, tmp_path: Path) -> None:
    train_recogniser(config)
    other = changed(config, out=tmp_path / "other", init=weights_path(config), form="ctrgcn")
    assert refusal(ModelError, other).startswith(f"{weights_path(config)}: ")
    absent = tmp_path / "absent.safetensors"
    assert refusal(ModelError, config, out=tmp_path / "other", init=absent).startswith(f"{absent}: ")


@pytest.mark.parametrize("device", ["tpu", "cuda"])
def test_a_device_that_is_not_there(config: TrainingConfig, device: str) -> None:
    if device == "cuda" and torch.cuda.is_available():
        pytest.skip("there is a CUDA device here")
    assert refusal(UsageError, config, device=device).startswith(f"--device {device}: expected")
