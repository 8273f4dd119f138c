"""Progress: a training says what its last doubling gained, and what the next one may bring."""

from types import SimpleNamespace

import pytest

from eval.running import progress
from eval.running.progress import TrainingProgress
from recognition.training.stopping import Evaluation


def evaluation(clips: int, accuracy: float) -> Evaluation:
    return Evaluation(step=clips // 10, clips=clips, train_loss=1.5, nll=1.0, accuracy=accuracy)


def test_an_evaluation_says_what_a_minute_may_bring(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = iter([0.0, 120.0])
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: next(now)))  # rich has its own clock
    first, second = evaluation(1000, 0.5), evaluation(2000, 0.6)
    with TrainingProgress() as bar:
        bar.report(1000, 20_000, [first])  # nothing is known of its pace
        bar.report(2000, 20_000, [first, second])
    assert capsys.readouterr().err.splitlines() == [
        "1,000 clips: training loss 1.500, validation accuracy 50.0 %",
        "2,000 clips: training loss 1.500, validation accuracy 60.0 %; the last doubling gained 10.0 points, "
        "the next takes 4 min: at most 2.50 points a minute",
    ]
