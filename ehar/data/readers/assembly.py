"""Motion data out of the clips that a reader found: people chosen, gaps filled, classes and split that fit together."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.motion_data import MotionData
from ehar.data.preparing.gaps import fill_gaps
from ehar.data.readers.bodies import most_moving
from ehar.data.recordings import UNKNOWN_SUBJECT
from ehar.data.skeleton import Skeleton
from ehar.errors import DataError, UsageError


@dataclass(frozen=True, eq=False, kw_only=True)
class Clip:
    """One sequence, as a reader found it.

    Args:
        file: where it stands, for errors.
        name: its name.
        label: its class.
        motion: (T, P, J, 3) float32 [m], z up; NaN where the tracker lost a joint or nobody is.
        is_test: whether the published split tests with it; None if there is no split.
        subject: who performs; -1 is unknown.
        view: the camera in whose frame the joints are; None if they are in the room's.
    """

    file: Path
    name: str
    label: str
    motion: FloatArray
    is_test: bool | None = None
    subject: int = UNKNOWN_SUBJECT
    view: int | None = None


def assemble(
    clips: Iterable[Clip],
    *,
    name: str,
    skeleton: Skeleton,
    fps: float,
    license: str,  # noqa: A002  # as in MotionData
    persons: int = 1,
    class_order: Sequence[str] = (),
    notes: Sequence[str] = (),
) -> MotionData:
    """Return motion data of clips; each keeps the people who move most.

    Clips in which fewer people are seen are left out, and so are those with a joint that is never seen. A split that
    leaves a class without training or without test sequences is left out too. All that is told in the notes.

    Args:
        clips: the clips; they are taken one by one, so that no more than their people are in memory.
        name: name of the data.
        skeleton: skeleton of one person.
        fps: frames per second.
        license: license of the motion.
        persons: number of people in a sequence.
        class_order: all classes in their published order; other classes are sorted by name.
        notes: what the reader has to tell.

    Raises:
        UsageError: `persons` is below 1.
        DataError: no clip is left.
    """
    if persons < 1:
        raise UsageError(f"persons: got {persons}, expected at least 1")
    kept: list[Clip] = []
    gaps, left_out = [], []
    unseen: list[tuple[Clip, DataError]] = []
    for clip in clips:
        motion = most_moving(clip.motion, persons)
        if motion is None:
            left_out.append(clip)
            continue
        try:
            motion, lost = fill_gaps(motion, skeleton, str(clip.file))
        except DataError as error:  # one recording in which a foot was never seen does not spoil thousands
            unseen.append((clip, error))
            continue
        kept.append(replace(clip, motion=motion))
        gaps.append(lost)
    if not kept and unseen:
        raise unseen[0][1]
    if not kept:
        raise DataError(f"{left_out[0].file.parent if left_out else name}: got no sequence of {persons} people")
    told, total = list(notes), len(kept) + len(left_out) + len(unseen)
    for out, why in (
        (left_out, f"show fewer than {persons} people"),
        ([clip for clip, _ in unseen], "have a joint that is in no frame,"),
    ):
        if out:
            told.append(f"{len(out)} of {total} sequences {why} and are left out: {out[0].name}...")
    if persons > 1 and any(clip.subject != UNKNOWN_SUBJECT for clip in kept):
        told.append(f"who performs is left out: one number cannot name {persons} people")
    names = {clip.label for clip in kept}
    class_names = [label for label in class_order if label in names] + sorted(names - set(class_order))
    labels = np.array([class_names.index(clip.label) for clip in kept])
    missing = np.concatenate(gaps)
    return MotionData(
        name=name,
        positions=np.concatenate([clip.motion for clip in kept]).astype(np.float32),
        offsets=np.cumsum([0, *(len(clip.motion) for clip in kept)]),
        labels=labels,
        class_names=tuple(class_names),
        sequence_names=tuple(clip.name for clip in kept),
        fps=fps,
        skeleton=skeleton,
        is_test=_split(kept, labels, class_names, told),
        subjects=np.array([[clip.subject if persons == 1 else UNKNOWN_SUBJECT] * persons for clip in kept]),
        license=license,
        views=None if any(clip.view is None for clip in kept) else np.array([clip.view for clip in kept]),
        missing=missing if missing.any() else None,
        notes=tuple(told),
    )


def _split(clips: Sequence[Clip], labels: np.ndarray, class_names: Sequence[str], told: list[str]) -> np.ndarray | None:
    """Return which clips are for tests; None, and a note, where a class would be on one side only."""
    if any(clip.is_test is None for clip in clips):
        return None
    is_test = np.array([clip.is_test for clip in clips], dtype=bool)
    for side, members in (("training", ~is_test), ("test", is_test)):
        lacking = sorted(set(range(len(class_names))) - set(labels[members].tolist()))
        if lacking:
            told.append(
                f"no split: the published one has no {side} sequence of {class_names[lacking[0]]} in these files"
            )
            return None
    return is_test
