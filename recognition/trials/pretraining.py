"""Pre-training: one network learns from other data sets together, over the joints that all of them name."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from torch import Tensor

from ehar.data.motion_data import MotionData
from ehar.data.preparing.mapping import Target, mapped
from ehar.data.skeleton import Skeleton
from ehar.errors import DataError
from recognition.networks.causal import CausalCTRGCN
from recognition.networks.features import channel_count
from recognition.networks.spec import DROPOUT, build_network
from recognition.training.clips import Clips, ClipSource
from recognition.training.config import TrainingConfig
from recognition.trials.changes import Change
from recognition.trials.folds import training_sequences
from recognition.trials.trial import Lesson, clip_source, learn, make_learner

SHARED: Target = "body12"  # shoulders, elbows, wrists, hips, knees and ankles: what every skeleton has


def pretrain(others: Sequence[MotionData], lesson: Lesson, *, fps: float) -> dict[str, Tensor]:
    """Train one network on the training sequences of several data sets, and return its averaged weights.

    Each set's classes are its own. Everybody learns alone: in scenes of several people, each person is a sequence. A
    step draws from one set, in turn. Layers whose shape does not depend on joints or classes serve another network.

    Args:
        others: the data sets.
        lesson: how long, by which sensor, and of how many frames.
        fps: frame rate that they are resampled to [Hz].

    Raises:
        DataError: no set has a sequence as long as a clip, or one lacks a joint of the shared skeleton.
    """
    sources: list[ClipSource] = []
    begins: list[int] = []
    classes = 0
    skeleton: Skeleton | None = None
    for data in others:
        shared = _alone(mapped(data, SHARED).resampled(fps))
        sequences = training_sequences(data) + len(data.labels) * np.arange(data.persons)[:, None]
        skeleton = shared.skeleton
        try:
            sources.append(clip_source(shared, sequences.ravel(), lesson, augment=True))
        except DataError:  # all its sequences are too short
            continue
        begins.append(classes)
        classes += len(data.class_names)
    if skeleton is None or not sources:
        raise DataError(f"expected other data with a training sequence of {lesson.length} frames, to learn from first")
    network = build_network(
        "causal",
        "small",
        classes=classes,
        channels=channel_count(1, view=True),
        skeleton=skeleton,
        persons=1,
        dropout=DROPOUT,
        seed=0,
    )
    assert isinstance(network, CausalCTRGCN)
    learner = make_learner(network.to(lesson.device), Change())

    def draw(rng: np.random.Generator, step: int) -> Clips:
        turn = step % len(sources)
        clips = sources[turn].draw(rng, TrainingConfig.batch)
        return clips._replace(labels=clips.labels + begins[turn])

    learn(learner, lesson, 0, draw, Change())
    return {name: tensor.detach().cpu() for name, tensor in learner.averaged.state_dict().items()}


def _alone(data: MotionData) -> MotionData:
    """Return data in which every person of a scene is a sequence by itself, one set of them after another."""
    people = range(data.persons)
    lengths = np.tile(data.lengths, data.persons)
    return replace(
        data,
        positions=np.concatenate([data.positions[:, [one]] for one in people]),
        offsets=np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
        labels=np.tile(data.labels, data.persons),
        sequence_names=tuple(f"{name} ({one})" for one in people for name in data.sequence_names),
        subjects=np.concatenate([data.subjects[:, [one]] for one in people]),
        is_test=None,
        missing=None,
        views=None,
        recorded_ms=None,
    )
