"""Scenarios: labelled windows of L frames, cut from sequences that are split into four parts."""

import math
from dataclasses import dataclass, replace
from typing import overload

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray, in_brief
from ehar.data.motion_data import MotionData
from ehar.data.recordings import UNKNOWN_SUBJECT
from ehar.data.streams.data import StreamData
from ehar.data.streams.scenario import StreamScenarios
from ehar.data.window import Windows
from ehar.errors import DataError, UsageError
from ehar.world import World

VALIDATION_SHARE = 0.15  # Sec. 5.1: train : validation = 0.85 : 0.15
LEAST_PEOPLE = 3  # with fewer people in training, validation shares them: one person alone is too little to learn from
LEAST_KNOWN = 5  # people whom the recogniser must keep for itself, or else the policy part shares them
RECOGNISER_SHARE = 0.4  # Sec. 5.1: recogniser training : policy training = 0.4 : 0.6
TEST_SHARE = 1 / 3  # for data without a split, as in AIST++ (7 of 21)
USUAL_LENGTH = 60  # Sec. 5.1: L
LEAST_LENGTH = 8  # frames
KEPT_SHARE = 0.9  # of a class's sequences, which an advised length keeps
TEST = "test"
PARTS = ("recogniser", "policy", "validation", TEST)
SPLIT_SEED = 0  # the parts are properties of the data, not of a run
DRAWS = 200  # of the parts of streams, until every part has every class


@dataclass(frozen=True, eq=False, repr=False)
class Scenarios(Windows):
    """N windows of L frames of trimmed sequences: each shows one activity.

    Args:
        data: the data that windows are cut from.
        length: L, frames.
        sequence: (N,) the sequence of each window.
        first: (N,) the first frame of each window, counted within its sequence.
    """

    data: MotionData

    __repr__ = in_brief

    @property
    def labels(self) -> IntArray:
        """The true class of each scenario, (N,)."""
        return self.data.labels[self.sequence]

    def positions(self, indices: IntArray) -> FloatArray:
        """Return joints (n, L, P, J, 3) float32 [m] relative to each scenario's centre.

        The centre of the space of interest is the mean of all joints in the first frame, for the whole episode. The
        paper takes it as known a priori (Sec. 3) and does not say where it lies. A mean over later frames would tell
        in the first frame where people are going to go.
        """
        motion = self.data.positions[self._frames(indices)]
        centred: FloatArray = motion - self.centres(indices)[:, None, None, None]
        return centred.astype(np.float32, copy=False)

    def centres(self, indices: IntArray) -> FloatArray:
        """Return each scenario's centre in the data's frame, (n, 3) [m]."""
        centre: FloatArray = self.data.positions[self._begin(indices)].mean(axis=(1, 2))
        return centre


@dataclass(frozen=True)
class Parts:
    """Sequences of each part; every sequence is in exactly one."""

    recogniser: IntArray
    policy: IntArray
    validation: IntArray
    test: IntArray


@overload
def windows(data: MotionData, sequences: IntArray, length: int, stride: int) -> Scenarios: ...


@overload
def windows(data: StreamData, sequences: IntArray, length: int, stride: int) -> StreamScenarios: ...


def windows(
    data: MotionData | StreamData, sequences: IntArray, length: int, stride: int
) -> Scenarios | StreamScenarios:
    """Return the windows of `length` frames, `stride` frames apart, of some sequences or streams.

    Sequences shorter than `length` have none. Sec. 5.1: stride 1 to train and validate, L to test.
    """
    if length < 1:
        raise DataError(f"{data.name}: expected an episode length of at least 1 frame, got {length}")
    counts = np.maximum((data.lengths[sequences] - length) // stride + 1, 0)
    counts[data.lengths[sequences] < length] = 0
    sequence = np.repeat(sequences, counts)
    ends = np.cumsum(counts)
    first = (np.arange(len(sequence)) - np.repeat(ends - counts, counts)) * stride
    if isinstance(data, StreamData):
        return StreamScenarios(data, length, sequence, first)
    return Scenarios(data, length, sequence, first)


def draw_scenarios(
    data: MotionData | StreamData, sequences: IntArray, length: int, rng: np.random.Generator, count: int
) -> Scenarios | StreamScenarios:
    """Draw windows of `length` frames from sequences or streams that are at least so long; they may overlap.

    The probability of a sequence is proportional to the number of test windows that its length yields, and its first
    frame is uniform. Of streams every window is as likely as any other.
    """
    longer = data.lengths[sequences] - length
    weights = longer + 1 if isinstance(data, StreamData) else longer // length + 1
    sequence = rng.choice(sequences, size=count, p=weights / weights.sum())
    return scenarios_at(data, length, sequence, rng.integers(data.lengths[sequence] - length + 1))


def scenarios_at(
    data: MotionData | StreamData, length: int, sequence: IntArray, first: IntArray
) -> Scenarios | StreamScenarios:
    """Return the windows of `length` frames that begin at some frames of some sequences or streams."""
    if isinstance(data, StreamData):
        return StreamScenarios(data, length, sequence, first)
    return Scenarios(data, length, sequence, first)


@overload
def localised(scenarios: Scenarios, world: World) -> Scenarios: ...


@overload
def localised(scenarios: StreamScenarios, world: World) -> StreamScenarios: ...


def localised(scenarios: Scenarios | StreamScenarios, world: World) -> Scenarios | StreamScenarios:
    """Return scenarios in which it is known where people are as well, and as soon, as in a world; clips as they are."""
    if isinstance(scenarios, StreamScenarios):
        return replace(scenarios, localisation=world.localisation)
    return scenarios


def advised_length(data: MotionData | StreamData, usual: int = USUAL_LENGTH) -> int:
    """Return a number of frames of an episode that nearly all sequences have, `usual` at most.

    It is the longest at which every class keeps at least `KEPT_SHARE` of its sequences, or of streams, which show many
    classes each, that share of all. One that is shorter than `LEAST_LENGTH` is not advised: there would be nothing to
    watch.
    """
    lengths = [data.lengths]
    if not isinstance(data, StreamData):
        lengths = [data.lengths[data.labels == label] for label in range(len(data.class_names))]
    kept = [np.sort(some)[len(some) - math.ceil(KEPT_SHARE * len(some) - 1e-9)] for some in lengths if len(some)]
    return int(np.clip(min(kept), LEAST_LENGTH, usual))


def split_parts(data: MotionData | StreamData) -> Parts:
    """Split the sequences into recogniser, policy, validation and test parts, class by class.

    Streams show many classes each: they are split by `stream_parts`.

    The data's own split decides the test part. Without a split it is a third of the subjects, or a third of each
    class's sequences if subjects are unknown. The rest is divided as in Sec. 5.1, by whole sequences, so windows of one
    sequence are always in the same part. Validation holds out people, if the rest names at least `LEAST_PEOPLE` of
    them; a recogniser is right far more often on people that it knows. So the policy part holds out people as well, if
    the recogniser part keeps at least `LEAST_KNOWN`: planners learn what is left to win on people whom the recogniser
    does not know. Where partners change, one of two people may be known all the same. Every class with at least two
    sequences of other people than validation's has one in the recogniser part and one in the policy part.
    """
    if isinstance(data, StreamData):
        return stream_parts(data)
    rng = np.random.default_rng(SPLIT_SEED)
    is_test = data.is_test if data.is_test is not None else _hold_out(data, rng)
    unseen = _people_held_out(data, ~is_test, VALIDATION_SHARE)
    rest = ~is_test & ~unseen
    others = _people_held_out(data, rest, 1 - RECOGNISER_SHARE)
    apart = (
        unseen.any()
        and len(np.unique(data.subjects[rest & ~others])) >= LEAST_KNOWN
        and set(data.labels[rest & others]) == set(data.labels[rest])
    )
    parts: dict[str, list[IntArray]] = {"recogniser": [], "policy": [], "validation": [np.flatnonzero(unseen)]}
    for label in range(len(data.class_names)):
        members = rng.permutation(np.flatnonzero((data.labels == label) & rest))
        if apart:
            parts["recogniser"].append(members[~others[members]])
            parts["policy"].append(members[others[members]])
            continue
        held = 0 if unseen.any() else round(VALIDATION_SHARE * len(members))
        learn = max(1, round(RECOGNISER_SHARE * (len(members) - held)))
        parts["validation"].append(members[:held])
        parts["recogniser"].append(members[held : held + learn])
        parts["policy"].append(members[held + learn :])
    return Parts(
        test=np.flatnonzero(is_test),
        **{name: np.sort(np.concatenate(members)) for name, members in parts.items()},
    )


def strangers(data: MotionData | StreamData, sequences: IntArray) -> IntArray:
    """Return those of some sequences that show nobody whom the recogniser knows, each once, in order.

    All of them, if none are left, or if the data do not say who performs.
    """
    sequences = np.unique(sequences)
    known = np.isin(data.subjects[sequences], data.subjects[split_parts(data).recogniser]).any(axis=1)
    return sequences if known.all() else sequences[~known]


def show_known(data: MotionData | StreamData, sequences: IntArray) -> BoolArray:
    """Return which of some sequences (n,) show somebody whom the recogniser's part shows elsewhere, (n,).

    Raises:
        DataError: as `stream_parts`.
    """
    elsewhere = data.subjects[np.setdiff1d(split_parts(data).recogniser, sequences)]
    known = np.isin(data.subjects[sequences], elsewhere[elsewhere != UNKNOWN_SUBJECT])
    return np.asarray(known.any(axis=1))


def people_together(subjects: IntArray) -> IntArray:
    """Return the group of each stream's people, (S,), from who performs, (S, P).

    A group is everybody who performs together, or with the same others. If there are fewer than `LEAST_KNOWN` groups,
    it is those who perform in a stream, whoever of them is named first.
    """
    _, couple = np.unique(np.sort(subjects, axis=1), axis=0, return_inverse=True)
    group = couple.copy()
    for person in np.unique(subjects):
        joined = np.unique(group[(subjects == person).any(axis=1)])
        group[np.isin(group, joined)] = joined[0]
    return group if len(np.unique(group)) >= LEAST_KNOWN else couple


def stream_parts(data: StreamData) -> Parts:
    """Split streams into the four parts, by frames.

    The data's own split decides the test part; without one it is a third of the people. Of the rest, validation has
    people of its own, if there are at least `LEAST_KNOWN`; or else streams of its own. So has the policy part, if that
    leaves `LEAST_KNOWN` people to the recogniser. If it does not, the two share people and not streams: each has
    streams of as many people as it can, but where validation took streams, streams are drawn whoever shows. The shares
    are those of clips, as near as whole people or streams come.

    People who perform together, or with the same others, go together. If that leaves fewer than `LEAST_KNOWN` groups,
    couples are divided, and one person may be in two parts.

    Every part has a segment of every class. Only validation may do without: it is small, and what is chosen on it is no
    figure. Parts are drawn until that is so.

    Raises:
        DataError: fewer than three streams are left for training, or there are fewer than two without a split; or in
            none of `DRAWS` draws all parts have all classes.
    """
    rng = np.random.default_rng(SPLIT_SEED)
    for _ in range(DRAWS):
        parts = _stream_parts_drawn(data, rng)
        lacking = _lacking(data, parts)
        if lacking is None:
            return parts
    assert lacking is not None
    part, name = lacking
    raise DataError(f"{data.name}: expected a segment of every class in the {part} part, class {name!r} has none")


def _lacking(data: StreamData, parts: Parts) -> tuple[str, str] | None:
    """Return the first part that has no segment of a class, and the class; None if there is none."""
    for part in ("recogniser", "policy", TEST):
        shown = data.segments[np.isin(data.stream_of, getattr(parts, part)), 2]
        for label, name in enumerate(data.class_names):
            if label not in shown:
                return part, name
    return None


def _stream_parts_drawn(data: StreamData, rng: np.random.Generator) -> Parts:
    """Draw the four parts of streams once."""
    streams = np.arange(len(data.lengths))
    people = people_together(data.subjects)
    named = bool((data.subjects != UNKNOWN_SUBJECT).all())
    unit = people if named else streams
    is_test = data.is_test
    if is_test is None:
        if len(np.unique(unit)) < 2:
            unit = streams  # all are of the same people
        if len(streams) < 2:
            raise DataError(f"{data.name}: expected at least 2 streams, of which one is the test, got {len(streams)}")
        is_test = np.isin(unit, _drawn(rng, data, unit, streams, TEST_SHARE))
    rest = np.flatnonzero(~is_test)
    if len(np.unique(unit[rest])) < LEAST_KNOWN:
        unit = streams
    if len(np.unique(unit[rest])) < LEAST_PEOPLE:
        raise DataError(f"{data.name}: expected at least {LEAST_PEOPLE} streams to train on, got {len(rest)}")
    unseen = np.isin(unit, _drawn(rng, data, unit, rest, VALIDATION_SHARE, left=2)) & ~is_test
    rest = np.flatnonzero(~is_test & ~unseen)
    policy = np.isin(unit, _drawn(rng, data, unit, rest, 1 - RECOGNISER_SHARE)) & ~is_test & ~unseen
    if len(np.unique(unit[rest[~policy[rest]]])) < LEAST_KNOWN:
        policy = _shared_out(rng, data, people if named else streams, rest, 1 - RECOGNISER_SHARE)
    known = np.flatnonzero(~is_test & ~unseen & ~policy)
    return Parts(known, np.flatnonzero(policy), np.flatnonzero(unseen), np.flatnonzero(is_test))


def _drawn(
    rng: np.random.Generator, data: StreamData, unit: IntArray, streams: IntArray, share: float, *, left: int = 1
) -> IntArray:
    """Draw units, of people or of streams, until they have a share of the frames of some streams.

    At least one is drawn, and so many are left.
    """
    units = rng.permutation(np.unique(unit[streams]))
    frames = np.array([data.lengths[streams[unit[streams] == one]].sum() for one in units])
    return units[: _nearest(np.cumsum(frames), share, left)]


def _shared_out(
    rng: np.random.Generator, data: StreamData, owner: IntArray, streams: IntArray, share: float
) -> BoolArray:
    """Draw streams, one of each owner in turn, until they have a share of the frames of `streams`; never all of them.

    Args:
        rng: what is drawn with.
        data: the streams.
        owner: (streams,) who is in each.
        streams: (n,) those to draw from.
        share: share of their frames.

    Returns:
        (streams,) whether each is drawn.
    """
    drawn = rng.permutation(streams)
    turn = [int((owner[drawn[:at]] == owner[stream]).sum()) for at, stream in enumerate(drawn)]
    drawn = drawn[np.argsort(turn, kind="stable")]
    return np.isin(np.arange(len(data.lengths)), drawn[: _nearest(np.cumsum(data.lengths[drawn]), share)])


def _nearest(upto: IntArray, share: float, left: int = 1) -> int:
    """Return how many of n come nearest to a share, by what the first 1 to n hold (n,); at least one, and some stay."""
    return 1 + int(np.abs(upto[:-left] - share * upto[-1]).argmin())


def part_of(data: MotionData | StreamData, part: str) -> IntArray:
    """Return the sequences of one of the `PARTS`.

    Raises:
        UsageError: the part is unknown.
        DataError: as `stream_parts`.
    """
    if part not in PARTS:
        raise UsageError(f"unknown part {part!r}; expected one of: {', '.join(PARTS)}")
    sequences: IntArray = getattr(split_parts(data), part)
    return sequences


def _people_held_out(data: MotionData, train: BoolArray, share: float) -> BoolArray:
    """Return which sequences show the people that a part holds out, (sequences,); none if that is not possible.

    The first is the person whose share of the sequences is nearest to the part's. Others join as long as the share
    comes nearer to it. Nobody is taken whose absence would leave a class with fewer than two sequences.

    Args:
        data: the data.
        train: (sequences,) of which people are taken.
        share: share of these sequences that the part wants.
    """
    held = np.zeros(len(data.labels), dtype=bool)
    people = np.unique(data.subjects[train])
    if UNKNOWN_SUBJECT in people or len(people) < LEAST_PEOPLE:
        return held
    least = np.minimum(np.bincount(data.labels[train], minlength=len(data.class_names)), 2)
    while True:
        candidates = [held | (train & (data.subjects == person).any(axis=1)) for person in people]
        left = (np.bincount(data.labels[train & ~some], minlength=len(least)) for some in candidates)
        allowed = [some for some, count in zip(candidates, left, strict=True) if (count >= least).all()]
        off = [abs(some.sum() / train.sum() - share) for some in allowed]
        if not off or (held.any() and min(off) >= abs(held.sum() / train.sum() - share)):
            break
        held = allowed[int(np.argmin(off))]
    return held


def _hold_out(data: MotionData, rng: np.random.Generator) -> BoolArray:
    """Choose test sequences for data without a split: by subject if every class is then on both sides."""
    is_test = np.zeros(len(data.labels), dtype=bool)
    subjects = np.unique(data.subjects)
    if UNKNOWN_SUBJECT not in subjects and len(subjects) >= 3:
        held = rng.permutation(subjects)[: max(1, round(TEST_SHARE * len(subjects)))]
        by_subject = np.asarray(np.isin(data.subjects, held).any(axis=1))
        labels = np.arange(len(data.class_names))
        if np.isin(labels, data.labels[by_subject]).all() and np.isin(labels, data.labels[~by_subject]).all():
            return by_subject
    for label in range(len(data.class_names)):
        members = rng.permutation(np.flatnonzero(data.labels == label))
        is_test[members[: max(1, round(TEST_SHARE * len(members)))]] = True
    return is_test
