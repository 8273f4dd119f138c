"""The published protocol: its rate, its prefixes, and a training that goes on from its last epoch."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.nn.modules.batchnorm import _BatchNorm

from ehar.conditions import Form
from ehar.data.motion_data import MotionData
from ehar.errors import DataError, ModelError, UsageError
from recognition.published import training
from recognition.published.training import PublishedResult, PublishedRun, accuracies, rate_of_epoch, train_published
from tests.helpers.fakes import tiny_data


def data() -> MotionData:
    return replace(tiny_data(), is_test=np.arange(len(tiny_data().labels)) >= 3)


@pytest.mark.parametrize(("epoch", "rate"), [(0, 0.02), (3, 0.08), (4, 0.1), (49, 0.1), (50, 0.01), (64, 0.01)])
def test_the_rate_rises_over_five_epochs_and_falls_at_the_fiftieth(epoch: int, rate: float) -> None:
    assert rate_of_epoch(epoch) == pytest.approx(rate)


@pytest.mark.parametrize("form", ["ctrgcn", "causal"])
def test_a_training_that_was_stopped_ends_like_one_that_ran_through(
    form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = PublishedRun(form, "joint", "small", epochs=2)  # type: ignore[arg-type]
    monkeypatch.setattr(training, "DROP", 0)  # so that each epoch may be the best
    (whole,) = train_published([run], data(), tmp_path / "a")
    assert whole.log_probs.shape == (data().is_test.sum(), 10, 3)  # type: ignore[union-attr]
    np.testing.assert_allclose(np.exp(whole.log_probs).sum(axis=-1), 1, atol=1e-5)

    class Stopped(Exception):
        pass

    def stop(run: PublishedRun, epoch: int, loss: float) -> None:
        raise Stopped

    with pytest.raises(Stopped):
        train_published([run], data(), tmp_path / "b", report=stop)
    assert [path.suffix for path in (tmp_path / "b").iterdir()] == [".checkpoint"]
    seen: list[int] = []
    (resumed,) = train_published([run], data(), tmp_path / "b", report=lambda run, epoch, loss: seen.append(epoch))
    assert seen == [2]
    assert same(resumed, whole)
    assert [path.suffix for path in (tmp_path / "b").iterdir()] == [".npz"]
    monkeypatch.setattr(training, "_Training", None)  # what is done is read, not done again
    assert same(train_published([run], data(), tmp_path / "b")[0], whole)


def same(one: PublishedResult, other: PublishedResult) -> bool:
    return all(np.array_equal(vars(one)[name], value) for name, value in vars(other).items())


def test_the_best_epoch_at_the_lower_rate_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "DROP", 1)
    labels = data().labels[3:]
    right = iter([1, 3, 3, 2])  # of the answers after epochs 2, 3, 4 and 5; the first epoch is not tested

    def answers(self: object, ratio: int, network: object) -> torch.Tensor:
        wrong = np.arange(len(labels)) >= next(right)
        return torch.from_numpy(np.eye(3, dtype=np.float32)[(labels + wrong) % 3])

    with monkeypatch.context() as patch:
        patch.setattr(training._Training, "_test_at", answers)
        no_answers = np.zeros((len(labels), 10, 3), dtype=np.float32)
        patch.setattr(training._Training, "test", lambda self, network: no_answers)
        (result,) = train_published([PublishedRun("causal", "joint", "small", epochs=5)], data(), tmp_path)
    assert result.best_epoch == 3
    assert accuracies([result.best], labels) == pytest.approx(100 * 3 / len(labels))


def test_the_mean_of_weights_is_that_of_the_epochs_at_the_lower_rate(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(training, "DROP", 1)
    run = PublishedRun("causal", "joint", "small", epochs=3)
    learning = training._Training(run, data(), tmp_path / "it.checkpoint", torch.device("cpu"))
    held: list[torch.Tensor] = []

    def keep(run: PublishedRun, epoch: int, loss: float) -> None:
        held.append(learning.network.classify.weight.detach().clone())  # type: ignore[union-attr]

    training._train([learning], data(), keep)
    torch.testing.assert_close(learning.mean.module.classify.weight, (held[1] + held[2]) / 2)
    resumed = training._Training(run, data(), tmp_path / "it.checkpoint", torch.device("cpu"))
    np.testing.assert_array_equal(resumed.test(resumed.mean.module), learning.test(learning.mean.module))
    result = learning.finish(tmp_path / "it.npz")
    assert not np.array_equal(result.mean, result.log_probs)


@pytest.mark.parametrize("form", ["ctrgcn", "causal"])
def test_the_mean_of_weights_has_statistics_of_its_own(form: Form, tmp_path: Path) -> None:
    """Whatever its batch norms held before, they have seen `STATISTICS` batches of training clips, each alike."""
    run, found = PublishedRun(form, "joint", "small", epochs=1), []
    for spoilt in (False, True):
        learning = training._Training(run, data(), tmp_path / f"{spoilt}.checkpoint", torch.device("cpu"))
        training._train([learning], data(), lambda run, epoch, loss: None)
        norms = [part for part in learning.mean.module.modules() if isinstance(part, _BatchNorm)]
        for norm in norms if spoilt else ():
            norm.running_mean.add_(1.0)
        found.append(learning.finish(tmp_path / f"{spoilt}.npz").mean)
        assert {int(norm.num_batches_tracked) for norm in norms} == {1}  # of these few data an epoch is one batch
    np.testing.assert_array_equal(*found)


def test_a_short_training_that_stopped_before_its_test_goes_on_with_its_mean(tmp_path: Path) -> None:
    run, path = PublishedRun("causal", "joint", "small", epochs=1), tmp_path / "it.checkpoint"
    learning = training._Training(run, data(), path, torch.device("cpu"))
    training._train([learning], data(), lambda run, epoch, loss: None)
    resumed = training._Training(run, data(), path, torch.device("cpu"))
    np.testing.assert_array_equal(resumed.test(resumed.mean.module), resumed.test(resumed.network))


def test_trainings_side_by_side_end_as_one_after_the_other(tmp_path: Path) -> None:
    runs = [PublishedRun("ctrgcn", "joint", "small", epochs=2), PublishedRun("causal", "bone", "small", epochs=3)]
    alone = train_published(runs, data(), tmp_path / "a")
    together = [
        training._Training(run, data(), tmp_path / f"{run.name}.checkpoint", torch.device("cpu")) for run in runs
    ]
    told: list[tuple[str, int]] = []
    training._train(together, data(), lambda run, epoch, loss: told.append((run.form, epoch)))
    assert told == [("ctrgcn", 1), ("causal", 1), ("ctrgcn", 2), ("causal", 2), ("causal", 3)]
    for one, expected in zip(together, alone, strict=True):
        assert same(one.finish(tmp_path / f"{one.run.name}.npz"), expected)


def test_a_prefix_tells_nothing_of_what_follows(tmp_path: Path) -> None:
    run = PublishedRun("causal", "bone", "small", epochs=1)
    (here,) = train_published([run], data(), tmp_path / "a")
    positions = data().positions.copy()
    for index in np.flatnonzero(data().is_test):
        begin, end = data().offsets[index], data().offsets[index + 1]
        positions[begin + int(np.ceil(0.5 * (end - begin))) : end] += np.random.default_rng(0).normal(size=3)
    (there,) = train_published([run], replace(data(), positions=positions.astype(np.float32)), tmp_path / "b")
    np.testing.assert_array_equal(here.log_probs[:, :5], there.log_probs[:, :5])
    assert not np.array_equal(here.log_probs[:, 5:], there.log_probs[:, 5:])


def test_late_frames_count_more_in_the_loss_of_the_streaming_form(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    logits = torch.from_numpy(np.random.default_rng(0).normal(size=(2, 4, 3))).requires_grad_()
    labels = torch.tensor([0, 2])
    each = -torch.log_softmax(logits.detach(), dim=-1)[torch.arange(2), :, labels].numpy()  # (2, 4)
    for form, frames, expected in (
        ("causal", 4, np.average(each, axis=1, weights=[1, 2, 3, 4]).mean()),
        ("ctrgcn", 1, each[:, 0].mean()),
    ):
        run = PublishedRun(form, "joint", "small", epochs=1)  # type: ignore[arg-type]
        learning = training._Training(run, data(), tmp_path / f"{form}.checkpoint", torch.device("cpu"))
        monkeypatch.setattr(learning, "_logits", lambda *_, frames=frames: logits[:, :frames])
        assert float(learning._step(torch.empty(0), labels)) == pytest.approx(expected)


def test_refuses_other_data_and_data_without_a_split(tmp_path: Path) -> None:
    run = PublishedRun("causal", "joint", "small", epochs=1)
    with pytest.raises(DataError, match="expected training and test sequences"):
        train_published([run], replace(data(), is_test=None), tmp_path)
    train_published([run], data(), tmp_path)
    with pytest.raises(UsageError, match="the result of other data"):
        train_published([run], replace(data(), fps=30.0), tmp_path)
    result = tmp_path / f"{run.name}.npz"
    with np.load(result) as held:
        np.savez(result, **{name: held[name] for name in held if name != "protocol"})
    with pytest.raises(UsageError, match="the result of an older version of ehar, which turned clips, averaged"):
        train_published([run], data(), tmp_path)
    result.unlink()
    (tmp_path / f"{run.name}.checkpoint").write_text("damaged")
    with pytest.raises(ModelError, match="expected a checkpoint"):
        train_published([run], data(), tmp_path)


def test_streams_are_added_up_as_logits() -> None:
    labels = np.array([0, 1])
    one = np.log(np.array([[[0.6, 0.4]], [[0.6, 0.4]]]))
    other = np.log(np.array([[[0.5, 0.5]], [[0.1, 0.9]]]))
    assert accuracies([one], labels).tolist() == [50.0]
    assert accuracies([one, other], labels).tolist() == [100.0]
