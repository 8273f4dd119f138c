"""The published protocol: its rate, its prefixes, and a training that goes on from its last epoch."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ehar.data.motion_data import MotionData
from ehar.errors import DataError, ModelError, UsageError
from recognition.published import training
from recognition.published.training import PublishedRun, accuracies, rate_of_epoch, train_published
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
    (whole,) = train_published([run], data(), tmp_path / "a")
    assert whole.shape == (data().is_test.sum(), 10, 3)  # type: ignore[union-attr]
    np.testing.assert_allclose(np.exp(whole).sum(axis=-1), 1, atol=1e-5)

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
    np.testing.assert_array_equal(resumed, whole)
    assert [path.suffix for path in (tmp_path / "b").iterdir()] == [".npz"]
    monkeypatch.setattr(training, "_Training", None)  # what is done is read, not done again
    np.testing.assert_array_equal(train_published([run], data(), tmp_path / "b"), [whole])


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
        np.testing.assert_array_equal(one.test(), expected)


def test_a_prefix_tells_nothing_of_what_follows(tmp_path: Path) -> None:
    run = PublishedRun("causal", "bone", "small", epochs=1)
    (here,) = train_published([run], data(), tmp_path / "a")
    positions = data().positions.copy()
    for index in np.flatnonzero(data().is_test):
        begin, end = data().offsets[index], data().offsets[index + 1]
        positions[begin + int(np.ceil(0.5 * (end - begin))) : end] += np.random.default_rng(0).normal(size=3)
    (there,) = train_published([run], replace(data(), positions=positions.astype(np.float32)), tmp_path / "b")
    np.testing.assert_array_equal(here[:, :5], there[:, :5])
    assert not np.array_equal(here[:, 5:], there[:, 5:])


def test_refuses_other_data_and_data_without_a_split(tmp_path: Path) -> None:
    run = PublishedRun("causal", "joint", "small", epochs=1)
    with pytest.raises(DataError, match="expected training and test sequences"):
        train_published([run], replace(data(), is_test=None), tmp_path)
    train_published([run], data(), tmp_path)
    with pytest.raises(UsageError, match="the result of other data"):
        train_published([run], replace(data(), fps=30.0), tmp_path)
    (tmp_path / f"{run.name}.npz").unlink()
    (tmp_path / f"{run.name}.checkpoint").write_text("damaged")
    with pytest.raises(ModelError, match="expected a checkpoint"):
        train_published([run], data(), tmp_path)


def test_streams_are_added_up_as_logits() -> None:
    labels = np.array([0, 1])
    one = np.log(np.array([[[0.6, 0.4]], [[0.6, 0.4]]]))
    other = np.log(np.array([[[0.5, 0.5]], [[0.1, 0.9]]]))
    assert accuracies([one], labels).tolist() == [50.0]
    assert accuracies([one, other], labels).tolist() == [100.0]
