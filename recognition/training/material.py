"""What a training learns from, and what it is asked about: clips of the people of each part, all or of a fold."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.data.motion_data import MotionData
from ehar.data.recordings import UNKNOWN_SUBJECT
from ehar.data.scenario import split_parts
from ehar.data.streams.data import StreamData
from ehar.errors import DataError, UsageError
from ehar.sensors.registry import load_sensor
from ehar.world import World, load_world
from recognition.left_out import leave_performers_out, of_known_classes
from recognition.setting import load_recordings_of, with_length
from recognition.training.clips import Clips, ClipSource
from recognition.training.config import WINDOW, TrainingConfig
from recognition.training.frame_weights import frame_weights
from recognition.training.in_the_way import check_room
from recognition.training.planned_views import PlannedViews

KNOWN, STRANGERS = "other sequences of people it knows", "people it does not know"
VALIDATION_CLIPS = 768
VALIDATION_SEED = 1_000_003  # draws the same clips for every run on the same data


@dataclass(frozen=True, eq=False)
class Material:
    """The clips of a training.

    Args:
        config: the settings of the training, with the length of a clip.
        data: the recordings that clips are cut from.
        world: the world that cameras are in.
        sensor_sha256: the hash of a sensor's file, if it has one.
        source: draws clips to learn from.
        planned: the planned views that it draws, if it has any.
        validation: the clips that the training is asked about.
        validated_on: who is in these.
        weights: (classes + 1,) weights of the classes of a stream's frames, no activity last; None of clips, and
            of streams in which few frames show none.
    """

    config: TrainingConfig
    data: MotionData | StreamData
    world: World
    sensor_sha256: str | None
    source: ClipSource
    planned: PlannedViews | None
    validation: Clips
    validated_on: str
    weights: FloatArray | None

    @property
    def late(self) -> bool:
        """Whether frames count in the loss by how many have been seen: so in clips, whose first frames say little."""
        return isinstance(self.data, MotionData) and self.config.conditions.form == "causal"


def gather(config: TrainingConfig, planned: PlannedViews | None = None, fold: int | None = None) -> Material:
    """Gather the clips of a training.

    Args:
        config: the settings of the training.
        planned: views that planners chose in episodes of the recogniser's part: half of the clips are seen from there.
        fold: which group of people is left out, and asked about; nobody without.

    Raises:
        EharError: as `train_recogniser`.
    """
    data = load_recordings_of(config.conditions)
    if isinstance(data, MotionData) and len(data.class_names) < 2:
        raise DataError(f"{data.name}: expected at least 2 classes to tell apart, got {data.class_names[0]!r} alone")
    config = replace(config, conditions=with_length(config.conditions, data, WINDOW))
    conditions = config.conditions
    parts = split_parts(data)
    world = load_world(conditions.world)
    if config.in_the_way:
        check_room(world)
    loaded = load_sensor(conditions.sensor, data, world)

    def source(sequences: IntArray, augment: bool, planned: PlannedViews | None = None) -> ClipSource:
        return ClipSource(
            data=data,
            sequences=sequences,
            length=conditions.frames,
            sensor=loaded.sensor,
            views=conditions.views,
            form=conditions.form,
            augment=augment,
            world=world,
            planned=planned,
            in_the_way=config.in_the_way,
        )

    # If no sequence of the validation part is long enough, we validate on the recogniser's own part.
    has_own = bool((data.lengths[parts.validation] >= conditions.frames).any())
    learned, asked = parts.recogniser, parts.validation if has_own else parts.recogniser
    who = _who(data.subjects[parts.recogniser], data.subjects[parts.validation] if has_own else None)
    if fold is not None:
        left = leave_performers_out(data, learned, config.folds)[fold]
        learned, asked = left.learned, of_known_classes(data, left)
        who = _who(data.subjects[learned], data.subjects[asked])
        planned = None if planned is None else planned.of(learned)
        if planned is not None and not len(planned.sequence):
            raise UsageError(
                f"--folds {config.folds}: got no planned episode of those whom fold {fold} learns from; expected "
                "planned runs of more people, or fewer folds"
            )
    return Material(
        config=config,
        data=data,
        world=world,
        sensor_sha256=loaded.sha256,
        source=source(learned, augment=True, planned=planned),
        planned=planned,
        validation=source(asked, augment=False).draw(np.random.default_rng(VALIDATION_SEED), VALIDATION_CLIPS),
        validated_on=who,
        weights=frame_weights(data, learned) if isinstance(data, StreamData) else None,
    )


def who_is_left_out(folds: Sequence[Material]) -> str:
    """Say who is left out in some folds: a couple is, of whom each may be known with other partners."""
    asked = {fold.validated_on for fold in folds}
    if asked == {STRANGERS}:
        return "people"
    return "people and couples" if asked - {KNOWN} else "couples"


def _who(learned: IntArray, asked: IntArray | None) -> str:
    """Say whom a training is validated on.

    Args:
        learned: (sequences, P) people whom the recogniser learns from.
        asked: (sequences, P) people of the validation part; None if that is not asked about.
    """
    if asked is None:
        return "its own training sequences"
    if (asked == UNKNOWN_SUBJECT).any():
        return "other sequences, of people whom the data do not name"
    known = np.isin(asked, learned)
    if known.all():
        return KNOWN
    return f"{KNOWN} and people it does not" if known.any() else STRANGERS
