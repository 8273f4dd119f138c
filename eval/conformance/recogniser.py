"""The conformance kit of recognisers: it streams the joints of a few episodes."""

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import cloudpickle
import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.conditions import Conditions
from ehar.plugins.blame import blamed
from ehar.recogniser import NORMALISED, Recogniser, total_probability
from eval.conformance.checks import Conformance, ContractCheck, attempt
from eval.conformance.streams import (
    TOLERANCE,
    GivenFrame,
    Stream,
    Streamer,
    cut,
    difference_of,
    episodes_of,
    side_by_side,
    small_frames,
)
from eval.conformance.world import BATCH
from recognition.setting import load_setting

FORKS = 3
ALL, OTHERS = np.arange(BATCH), np.arange(BATCH, 2 * BATCH)
_PURE = "keep all memory in the state, none in `self`; return a new state, and leave the given one as it is"


def check_recogniser(recogniser: str | Recogniser, conditions: Conditions | None = None) -> Conformance:
    """Check that a recogniser keeps the contract of `ehar.recogniser`.

    A recogniser may have a method `recognise_clip(sensed, viewpoint)`, from arrays (B, T, ...) of whole clips to a
    Recognition (B, T, ...). Then streaming has to give the same as that method.

    Args:
        recogniser: an object, or a value of `ehar benchmark --recogniser`.
        conditions: conditions of the test episodes; None takes the defaults.

    Raises:
        EharError: the recogniser cannot be made, or data cannot be loaded.
    """
    from recognition.torch_threads import one_torch_thread  # brings torch

    setting = load_setting(replace(conditions or Conditions(), recogniser=recogniser))
    frames = small_frames(setting.data, setting.world)
    with one_torch_thread():
        return Conformance(f"recogniser {setting.form}", tuple(_checks(setting.runner.recogniser, frames)))


def _checks(recogniser: Recogniser, frames: Sequence[GivenFrame]) -> list[ContractCheck]:
    """Return all checks; all others need the first one."""
    streamer, seven = Streamer(recogniser), episodes_of(frames, ALL)
    streams: list[Stream] = []

    def recognise(rows: IntArray) -> None:
        streams.append(streamer.stream(episodes_of(frames, rows))[0])

    shapes = "float arrays without NaN: log_probs (B, K) and embedding (B, D), as embedding_size says"
    first = attempt(
        f"recognises a batch of {BATCH}: log_probs ({BATCH}, {streamer.classes}), "
        f"embedding ({BATCH}, {recogniser.embedding_size})",
        lambda: recognise(ALL),
        expected=shapes,
        mend="return a Recognition(log_probs, embedding) of numpy arrays, one row an episode",
    )
    if not streams:
        return [first, ContractCheck("all else", None, "as it does not run")]
    stream = streams[0]
    return [
        first,
        attempt(
            "recognises a batch of 1",
            lambda: recognise(ALL[:1]),
            expected=shapes,
            mend="do not squeeze arrays: a batch of one episode has a leading 1",
        ),
        attempt(
            "log-probabilities are normalised",
            lambda: _not_normalised(stream.log_probs),
            expected=f"natural logarithms of probabilities that sum to 1 within {NORMALISED}",
            mend="return log_softmax(logits), not logits or probabilities",
        ),
        attempt(
            "does the same twice",
            lambda: difference_of(stream, streamer.stream(seven)[0], ("at first", "the second time"), 0),
            expected="equal numbers for equal frames",
            mend="switch dropout and batch statistics off (`network.eval()`), and draw nothing at random",
        ),
        attempt(
            "rows alone, and in another order, are recognised the same",
            lambda: _rows_alone(streamer, frames, stream),
            expected=f"the same within {TOLERANCE}",
            mend="compute every row from its own row: no statistics over axis 0",
        ),
        attempt(
            "two streams side by side do not disturb each other",
            lambda: _interleaved(streamer, frames, stream),
            expected=f"the same within {TOLERANCE}",
            mend=_PURE,
        ),
        attempt(
            "a state stays valid after a step",
            lambda: _twice_from_one_state(streamer, seven, stream),
            expected=f"the same within {TOLERANCE} when a frame is seen twice from one state",
            mend=_PURE,
        ),
        *_forks(streamer, frames, stream),
        attempt(
            "reset(mask) lets some episodes begin anew",
            lambda: _reset(streamer, frames, stream),
            expected=f"episodes of the mask as from a new state, the others as before, within {TOLERANCE}",
            mend="return a state in which the rows of mask (B,) have seen nothing",
        ),
        _whole_clip(recogniser, seven, stream),
        attempt(
            "the past does not see the future",
            lambda: _other_future(streamer, frames, stream),
            expected=f"the same within {TOLERANCE} as long as the frames so far are the same",
            mend="use the state and the present frame alone: nothing that an earlier stream left behind",
        ),
        attempt(
            "leaves what it is shown as it is",
            lambda: f"{', '.join(sorted(streamer.changed))} changed" if streamer.changed else None,
            expected="joints and viewpoints that nobody changes",
            mend="work on a copy",
        ),
        attempt(
            "can be sent to a worker process",
            lambda: _pickled(recogniser, seven, stream),
            expected=f"an object that cloudpickle can pickle, and the same within {TOLERANCE} from its copy",
            mend="hold no open files, locks or generators",
        ),
        _time(streamer, seven),
    ]


def _not_normalised(log_probs: FloatArray) -> str | None:
    total = total_probability(log_probs)
    worst = np.unravel_index(np.argmax(np.abs(total - 1)), total.shape)
    if abs(total[worst] - 1) <= NORMALISED:
        return None
    return f"probabilities that sum to {total[worst]:.4g} in row {worst[1]} after frame {worst[0]}"


def _rows_alone(streamer: Streamer, frames: Sequence[GivenFrame], stream: Stream) -> str | None:
    backwards = streamer.stream(episodes_of(frames, ALL[::-1]))[0]
    difference = difference_of(stream, cut(backwards, ALL[::-1]), (f"in a batch of {BATCH}", "in another order"))
    alone = streamer.stream(episodes_of(frames, ALL[:1]))[0]
    return difference or difference_of(cut(stream, ALL[:1]), alone, (f"in a batch of {BATCH}", "alone"))


def _interleaved(streamer: Streamer, frames: Sequence[GivenFrame], stream: Stream) -> str | None:
    half = len(frames) // 2
    early, state = streamer.stream(episodes_of(frames[:half], ALL))
    streamer.stream(episodes_of(frames, OTHERS))
    late, _ = streamer.stream(episodes_of(frames[half:], ALL), state)
    whole = Stream(*(np.concatenate(arrays) for arrays in zip(early, late, strict=True)))
    return difference_of(stream, whole, ("by itself", "with another stream in between"))


def _twice_from_one_state(streamer: Streamer, frames: Sequence[GivenFrame], stream: Stream) -> str | None:
    half = len(frames) // 2
    _, state = streamer.stream(frames[:half])
    streamer.stream(frames[half:][::-1], state)
    late, _ = streamer.stream(frames[half:], state)
    return difference_of(cut(stream, ALL, slice(half, None)), late, ("at first", "from that state again"))


def _forks(streamer: Streamer, frames: Sequence[GivenFrame], stream: Stream) -> list[ContractCheck]:
    """Check fork and select: each alternative of two frames is compared with the same frames without a fork."""
    half, rows = len(frames) // 2, episodes_of(frames, ALL)
    _, state = streamer.stream(rows[:half])
    # Alternative f sees the next two frames of the episodes f places on.
    ways = [[frame.rows(np.roll(ALL, -way)) for frame in frames[half : half + 2]] for way in range(FORKS)]
    forked: list[Any] = []

    def fork() -> str | None:
        with blamed(streamer.recogniser, "fork"):
            alternatives = state.fork(FORKS)
        together, after = streamer.stream([side_by_side(frames) for frames in zip(*ways, strict=True)], alternatives)
        forked.append(after)
        for way, alternative in enumerate(ways):
            apart, _ = streamer.stream(alternative, state)
            names = (f"for alternative {way} by itself", "from the fork")
            difference = difference_of(apart, Stream(*(array[:, :, way] for array in together)), names)
            if difference is not None:
                return difference
        return None

    def undisturbed() -> str | None:
        late, _ = streamer.stream(rows[half:], state)
        return difference_of(cut(stream, ALL, slice(half, None)), late, ("without a fork", "after one"))

    def select() -> str | None:
        choice = ALL % FORKS
        with blamed(streamer.recogniser, "select"):
            selected = forked[0].select(choice)
        chosen, _ = streamer.stream(rows[:1], selected)
        for way, alternative in enumerate(ways):
            apart, _ = streamer.stream([rows[0]], streamer.stream(alternative, state)[1])
            mine = choice == way
            names = (f"after alternative {way} by itself", "after it was selected")
            difference = difference_of(cut(apart, mine), cut(chosen, mine), names)
            if difference is not None:
                return difference
        return None

    expected = f"the same within {TOLERANCE}"
    mend = "fork(F) returns a state that takes and gives arrays (B, F, ...); oracles imagine with it"
    checks = [
        attempt(f"fork({FORKS}) sees {FORKS} alternatives of an episode", fork, expected=expected, mend=mend),
        attempt("a fork does not disturb the state it is from", undisturbed, expected=expected, mend=_PURE),
    ]
    name = "select(choice) goes on with one alternative"
    if not forked:
        return [*checks, ContractCheck(name, None, "as it does not fork")]
    mend = "select(choice) returns the unforked state of alternative choice[b] of every episode b"
    return [*checks, attempt(name, select, expected=expected, mend=mend)]


def _reset(streamer: Streamer, frames: Sequence[GivenFrame], stream: Stream) -> str | None:
    half, rows = len(frames) // 2, episodes_of(frames, ALL)
    _, state = streamer.stream(rows[:half])
    mask = ALL % 2 == 0
    with blamed(streamer.recogniser, "reset"):
        state = state.reset(mask)
    late, _ = streamer.stream(rows[half:], state)
    new, _ = streamer.stream(rows[half:])
    difference = difference_of(
        cut(new, mask), cut(late, mask), ("from a new state", "after reset, in rows of the mask")
    )
    kept = cut(stream, ~mask, slice(half, None))
    return difference or difference_of(
        kept, cut(late, ~mask), ("without reset", "after reset, in rows not of the mask")
    )


def _whole_clip(recogniser: Any, frames: Sequence[GivenFrame], stream: Stream) -> ContractCheck:
    name = "frame by frame is the same as the whole clip at once"
    if not hasattr(recogniser, "recognise_clip"):
        return ContractCheck(name, None, "it has no method recognise_clip(sensed, viewpoint), (B, T, ...) in and out")

    def whole() -> str | None:
        return difference_of(_at_once(recogniser, frames), stream, ("at once", "frame by frame"))

    mend = "let no operation look ahead, and keep in the state all that the next frame needs"
    return attempt(name, whole, expected=f"the same within {TOLERANCE}", mend=mend)


def _other_future(streamer: Streamer, frames: Sequence[GivenFrame], stream: Stream) -> str | None:
    """Stream the same frames as before up to the middle, and then those of other episodes."""
    half = len(frames) // 2
    mixed = [*episodes_of(frames[:half], ALL), *episodes_of(frames[half:], OTHERS)]
    names, early = ("at first", "with another future"), slice(half)
    difference = difference_of(cut(stream, ALL, early), cut(streamer.stream(mixed)[0], ALL, early), names)
    if difference is not None or not hasattr(streamer.recogniser, "recognise_clip"):
        return difference
    clips = [_at_once(streamer.recogniser, shown) for shown in (episodes_of(frames, ALL), mixed)]
    names = ("at first, the clip at once", "with another future")
    return difference_of(cut(clips[0], ALL, early), cut(clips[1], ALL, early), names)


def _at_once(recogniser: Any, frames: Sequence[GivenFrame]) -> Stream:
    """Return what `recognise_clip` says of all frames, (T, B, ...)."""
    clip = side_by_side(frames)  # (B, T, ...)
    with blamed(recogniser, "recognise_clip"):
        recognition = recogniser.recognise_clip(clip.sensed, clip.viewpoint)
    return Stream(*(np.asarray(array, dtype=np.float64).swapaxes(0, 1) for array in recognition[:2]))


def _pickled(recogniser: Recogniser, frames: Sequence[GivenFrame], stream: Stream) -> str | None:
    try:
        copy = cloudpickle.loads(cloudpickle.dumps(recogniser))
    except (Exception, SystemExit) as error:
        return f"{type(error).__name__}: {error}"
    return difference_of(stream, Streamer(copy).stream(frames)[0], ("here", "from the copy"))


def _time(streamer: Streamer, frames: Sequence[GivenFrame]) -> ContractCheck:
    state, milliseconds = streamer.start(BATCH), []
    for frame in frames:
        begin = time.perf_counter()
        _, state = streamer.step(state, frame)
        milliseconds.append(1000 * (time.perf_counter() - begin) / BATCH)
    third = max(len(frames) // 3, 1)
    early, late = np.median(milliseconds[:third]), np.median(milliseconds[-third:])
    last = f"{late:.3g} in the last third of {len(frames)}"
    return ContractCheck(
        f"takes {early:.3g} ms for one frame of one episode in the first third of its frames, {last}", True
    )
