"""A trial of a training, its second task, and what it begins with."""

from collections.abc import Iterator

import numpy as np
import pytest
import torch

from recognition.networks.causal import CausalCTRGCN
from recognition.networks.spec import NetworkSpec
from recognition.torch_threads import one_torch_thread
from recognition.trials import trial as trials
from recognition.trials.changes import CHANGES, LAST, ROWS, Change
from recognition.trials.folds import people_folds
from recognition.trials.next_pose import NextPoseLearner
from recognition.trials.pretraining import pretrain
from recognition.trials.trial import Lesson, fits, held_clips, make_learner, run_trial
from tests.recognition.trials.test_folds import of_people

LESSON = Lesson("perfect", clips=96, length=8)


@pytest.fixture(autouse=True)
def few_held_clips(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(trials, "HELD_CLIPS", 24)
    with one_torch_thread():  # several round differently from run to run on some processors
        yield


def network(seed: int = 0) -> CausalCTRGCN:
    made = NetworkSpec.of(of_people(), form="causal", size="small", length=8).build(seed)
    assert isinstance(made, CausalCTRGCN)
    return made


def test_every_row_is_of_trainings_that_are_made() -> None:
    assert {name for row in ROWS for name in row.trainings} == {*CHANGES, LAST}


def test_held_clips_are_the_same_for_every_change_and_of_people_who_were_left_out() -> None:
    data = of_people()
    fold = people_folds(data, 2)[0]
    held, again = held_clips(data, fold, LESSON), held_clips(data, fold, LESSON)
    assert torch.equal(held.features, again.features)
    assert set(held.sequences) <= set(fold.held)
    np.testing.assert_array_equal(held.labels, data.labels[held.sequences])


@pytest.mark.parametrize("name", [name for name in CHANGES if name != "pre-trained"])
def test_every_change_trains_and_answers_for_each_frame(name: str) -> None:
    data = of_people()
    fold = people_folds(data, 2)[0]
    held = held_clips(data, fold, LESSON)
    averaged, last = run_trial(data, fold, LESSON, CHANGES[name], held)
    assert averaged.shape == last.shape == (24, 8, 3)
    assert np.isfinite(averaged).all() and not np.array_equal(averaged, last)
    again, _ = run_trial(data, fold, LESSON, CHANGES[name], held)
    np.testing.assert_array_equal(again, averaged)
    if name != "as it is":
        usual, _ = run_trial(data, fold, LESSON, Change(), held)
        assert not np.allclose(usual, averaged)


def test_what_the_next_frame_shows_is_learned() -> None:
    data = of_people()
    source = trials.clip_source(data, people_folds(data, 2)[0].learned, LESSON, augment=False)
    clips = source.draw(np.random.default_rng(0), 16)
    learner = make_learner(network(), Change(next_pose=100.0))
    assert isinstance(learner, NextPoseLearner)
    losses = [learner.learn(clips, np.random.default_rng(0), step=150, steps=1) for _ in range(40)]
    assert losses[-1] < 0.3 * losses[0]
    # The head has no part in what is recognised, and the average has it too.
    assert learner.logits(learner.averaged, clips.features).shape == (16, 8, 3)


def test_a_missing_joint_is_not_foretold() -> None:
    data = of_people()
    source = trials.clip_source(data, people_folds(data, 2)[0].learned, LESSON, augment=False)
    clips = source.draw(np.random.default_rng(0), 4)
    features = clips.features.clone()
    features[:, -1, :, 2, 4] = 0.0  # joint 2 is missing in the last frame
    losses = []
    for place in (0.0, 1e6):
        features[:, -1, :, 2, :2] = place
        learner = make_learner(network(), Change(next_pose=1.0))
        losses.append(learner.learn(clips._replace(features=features), np.random.default_rng(0), step=0, steps=1))
    assert losses[1] < 100  # a squared error of 1e12 would show


def test_late_frames_count_by_how_many_have_been_seen_unless_they_are_alike() -> None:
    rng = np.random.default_rng(0)
    logits = torch.from_numpy(rng.normal(size=(2, 4, 3)))
    labels = torch.from_numpy(rng.integers(3, size=(2, 4)))
    each = -torch.log_softmax(logits, dim=-1).gather(2, labels[..., None])[..., 0].numpy()  # (2, 4)
    spread = 0.7 * each - 0.3 * torch.log_softmax(logits, dim=-1).mean(dim=-1).numpy()
    for change, expected in (
        (Change(), np.average(each, axis=1, weights=[1, 2, 3, 4]).mean()),
        (Change(late=False), each.mean()),
        (Change(smoothing=0.3), np.average(spread, axis=1, weights=[1, 2, 3, 4]).mean()),
    ):
        learner = make_learner(network(), change)
        assert float(learner._cross_entropy(logits.flatten(0, 1), labels)) == pytest.approx(expected)


def test_frames_alike_have_one_weight_before_and_after_learning() -> None:
    alike = network()
    trials._weigh_alike(alike)
    assert (alike.weigh(torch.rand(5, alike.weigh[0].in_features)) == 0).all()  # type: ignore[union-attr]
    assert not any(parameter.requires_grad for parameter in alike.weigh.parameters())


def test_pre_training_serves_layers_that_do_not_depend_on_joints_or_classes() -> None:
    own = network().state_dict()
    kept = pretrain_of_two()
    served = {name for name, tensor in kept.items() if fits(own, name, tensor)}
    assert "blocks.1.graph.value.weight" in served and "weigh.0.weight" in served
    for other in ("input_norm.weight", "blocks.0.graph.topology", "classify.weight"):
        assert other not in served
    data = of_people()
    fold = people_folds(data, 2)[0]
    held = held_clips(data, fold, LESSON)
    begun, _ = run_trial(data, fold, LESSON, CHANGES["pre-trained"], held, begin=kept)
    assert not np.allclose(begun, run_trial(data, fold, LESSON, Change(), held)[0])


def pretrain_of_two() -> dict[str, torch.Tensor]:
    from ehar.data.source import load_data

    return pretrain([load_data("solo"), load_data("duo")], LESSON, fps=25.0)


def test_pre_training_learns_from_every_set_and_person_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    from recognition.trials import pretraining

    drawn = []
    learn = pretraining.learn

    def watched(learner: object, lesson: Lesson, seed: int, draw: object, change: Change) -> None:
        for step in range(4):
            drawn.append(draw(np.random.default_rng(step), step))  # type: ignore[operator]
        learn(learner, lesson, seed, draw, change)  # type: ignore[arg-type]

    monkeypatch.setattr(pretraining, "learn", watched)
    kept = pretrain_of_two()
    assert all(clips.features.shape[2:] == (1, 12, 10) for clips in drawn)
    assert [clips.labels.min() >= 10 for clips in drawn] == [False, True, False, True]  # duo's classes follow solo's
    assert kept["classify.weight"].shape[0] == 17
