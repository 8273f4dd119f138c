"""One trial: a network learns from some people, with one thing changed, and is asked about those who were left out."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch
from torch import Tensor, nn

from ehar.arrays import FloatArray, IntArray
from ehar.data.motion_data import MotionData
from ehar.data.variations import with_turned_trunks, with_variations
from ehar.errors import ModelError
from ehar.sensors.registry import load_sensor
from ehar.world import PAPER
from recognition.left_out import Fold
from recognition.networks.causal import CausalCTRGCN
from recognition.networks.spec import DROPOUT, build_network
from recognition.training.clips import Clips, ClipSource
from recognition.training.config import TrainingConfig
from recognition.training.learner import Learner
from recognition.trials.changes import Change
from recognition.trials.inputs import changed_input, channels_of
from recognition.trials.next_pose import NextPoseLearner

VARIATIONS = 8  # of each sequence, where motion is varied
HELD_CLIPS = 1024  # of the people who were left out
HELD_SEED = 1_000_033  # draws the same clips for every change


@dataclass(frozen=True)
class Lesson:
    """How trials see and learn, all alike.

    Args:
        sensor: name of the sensor.
        clips: training clips of each trial.
        length: number L of frames of a clip.
        device: torch device.
    """

    sensor: str
    clips: int
    length: int
    device: str = "cpu"


def clip_source(data: MotionData, sequences: IntArray, lesson: Lesson, *, augment: bool) -> ClipSource:
    """Return what draws a trial's clips: moving cameras, in the paper's world."""
    return ClipSource(
        data=data,
        sequences=sequences,
        length=lesson.length,
        sensor=load_sensor(lesson.sensor, data, PAPER).sensor,
        views="moving",
        form="causal",
        augment=augment,
        world=PAPER,
    )


def held_clips(data: MotionData, fold: Fold, lesson: Lesson) -> Clips:
    """Return the clips of people who were left out, the same for every change."""
    source = clip_source(data, fold.held, lesson, augment=False)
    return source.draw(np.random.default_rng(HELD_SEED), HELD_CLIPS)


def run_trial(
    data: MotionData,
    fold: Fold,
    lesson: Lesson,
    change: Change,
    held: Clips,
    *,
    begin: dict[str, Tensor] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Train with one change.

    Args:
        data: the motion.
        fold: who learns, and who is left out.
        lesson: what all trials have in common.
        change: what this one has not.
        held: `held_clips`.
        begin: weights to begin with, of layers that fit.

    Returns:
        logits (N, L, K) of the held clips by the averaged weights, and by the last ones.

    Raises:
        ModelError: the loss is not finite.
    """
    shown, learned = data, fold.learned
    if change.varied or change.trunks:
        vary = partial(with_variations, bodies=True) if change.varied else with_turned_trunks
        shown = vary(data, fold.learned, VARIATIONS, seed=change.seed)
        learned = np.arange(len(shown.labels))
    source = clip_source(shown, learned, lesson, augment=True)
    network = build_network(
        "causal",
        "small",
        classes=len(data.recognised_names),
        channels=channels_of(data.persons, change),
        skeleton=data.skeleton,
        persons=data.persons,
        dropout=DROPOUT,
        seed=change.seed,
    )
    assert isinstance(network, CausalCTRGCN)
    if begin is not None:
        own = network.state_dict()
        network.load_state_dict({**own, **{name: kept for name, kept in begin.items() if fits(own, name, kept)}})
    if not change.weighs:
        _weigh_alike(network)
    learner = make_learner(network.to(lesson.device), change)
    learn(learner, lesson, change.seed, lambda rng, step: source.draw(rng, TrainingConfig.batch), change)
    features = changed_input(held, change)
    return learner.logits(learner.averaged, features), learner.logits(learner.network, features)


def fits(own: dict[str, Tensor], name: str, kept: Tensor) -> bool:
    """Return whether a tensor of another network has a place in a network; what decides on classes has none."""
    return name in own and own[name].shape == kept.shape and not name.startswith("classify.")


def make_learner(network: CausalCTRGCN, change: Change) -> Learner:
    """Return the learner of a trial."""
    kind: Callable[..., Learner] = Learner
    if change.next_pose:
        kind = partial(NextPoseLearner, weight=change.next_pose)
    return kind(
        network,
        optimiser="adamw",
        learning_rate=TrainingConfig.learning_rate,
        weight_decay=TrainingConfig.weight_decay,
        batch=TrainingConfig.batch,
        smoothing=change.smoothing,
        late=change.late,
    )


def learn(
    learner: Learner,
    lesson: Lesson,
    seed: int,
    draw: Callable[[np.random.Generator, int], Clips],
    change: Change,
) -> None:
    """Train through the clips of a lesson.

    Args:
        learner: what learns.
        lesson: how long.
        seed: decides the clips and dropout.
        draw: returns the clips of a step.
        change: what the network is not told.

    Raises:
        ModelError: the loss is not finite.
    """
    steps = max(1, lesson.clips // TrainingConfig.batch)
    for step in range(steps):
        rng = np.random.default_rng((seed, step))
        clips = draw(rng, step)
        clips = clips._replace(features=changed_input(clips, change))
        loss = learner.learn(clips, rng, step=step, steps=steps)
        if not np.isfinite(loss):
            raise ModelError(f"the loss is {loss} at step {step}: expected a finite one")


def _weigh_alike(network: CausalCTRGCN) -> None:
    """Give all frames the same weight, for good."""
    last = network.weigh[-1]
    assert isinstance(last, nn.Linear)
    with torch.no_grad():
        last.weight.zero_()
        last.bias.zero_()
    for parameter in network.weigh.parameters():
        parameter.requires_grad_(False)
