"""The conformance kit of recognisers finds what is wrong, and nothing where nothing is."""

import re
import sys
import threading
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.conditions import Conditions
from ehar.recogniser import Recogniser, Recognition
from ehar.sensors.sensor import Sensed
from eval import check_recogniser
from eval.conformance.checks import Conformance
from recognition.calibration import Temperature
from recognition.networks.causal import CausalCTRGCN
from recognition.networks.ctrgcn import CTRGCN
from recognition.networks.spec import NetworkSpec
from recognition.streaming import PrefixRecogniser, StreamingRecogniser
from tests.helpers.fakes import CLASS_NAMES, FakeRecogniser, FakeState, tiny_data

DATA = tiny_data()
WHOLE = "frame by frame is the same as the whole clip at once"


def checked(recogniser: Recogniser) -> Conformance:
    return check_recogniser(recogniser, Conditions(data=DATA))


def softened(recognition: Recognition, change: FloatArray) -> Recognition:
    logits = recognition.log_probs + change
    return Recognition(logits - np.log(np.exp(logits).sum(axis=-1, keepdims=True)), recognition.embedding)


class Fake(FakeRecogniser):
    """Does as the fake does; those below break one thing each."""

    def step(self, state: Any, sensed: Sensed, viewpoint: FloatArray) -> tuple[Recognition, Any]:
        recognition, after = super().step(state, sensed, viewpoint)
        return self.changed(recognition), type(state)(after.evidence)

    def changed(self, recognition: Recognition) -> Recognition:
        return recognition


class Narrow(Fake):
    def changed(self, recognition: Recognition) -> Recognition:
        return Recognition(recognition.log_probs, recognition.embedding[..., :2])


class Integers(Fake):
    def changed(self, recognition: Recognition) -> Recognition:
        return Recognition(recognition.log_probs, recognition.embedding.astype(np.int64))


class Infinite(Fake):
    def changed(self, recognition: Recognition) -> Recognition:
        return Recognition(np.where(recognition.log_probs < -5, -np.inf, recognition.log_probs), recognition.embedding)


class Logits(Fake):
    def changed(self, recognition: Recognition) -> Recognition:
        return Recognition(recognition.log_probs + 1, recognition.embedding)


class Dropout(Fake):
    def __init__(self) -> None:
        super().__init__()
        self.rng = np.random.default_rng(0)

    def changed(self, recognition: Recognition) -> Recognition:
        return softened(recognition, self.rng.normal(size=recognition.log_probs.shape))


class BatchNorm(Fake):
    def changed(self, recognition: Recognition) -> Recognition:
        return softened(recognition, -recognition.log_probs.mean(axis=0))


class Stateful(Fake):
    def start(self, episodes: int) -> FakeState:
        self.memory = np.zeros((episodes, len(CLASS_NAMES)))
        return super().start(episodes)

    def step(self, state: Any, sensed: Sensed, viewpoint: FloatArray) -> tuple[Recognition, Any]:
        recognition, after = super().step(FakeState(self.memory), sensed, viewpoint)
        self.memory = after.evidence
        return recognition, state


class InPlace(Fake):
    def step(self, state: Any, sensed: Sensed, viewpoint: FloatArray) -> tuple[Recognition, Any]:
        recognition, after = super().step(state, sensed, viewpoint)
        state.evidence[...] = after.evidence
        return recognition, state


class WithState(Fake):
    state: type[FakeState] = FakeState

    def start(self, episodes: int) -> FakeState:
        return self.state(np.zeros((episodes, len(CLASS_NAMES))))


class NoFork(FakeState):
    def fork(self, forks: int) -> FakeState:
        raise NotImplementedError("forks")


class SameFork(FakeState):
    def fork(self, forks: int) -> FakeState:
        return type(self)(np.zeros((len(self.evidence), forks, self.evidence.shape[1])))


class FirstSelected(FakeState):
    def fork(self, forks: int) -> FakeState:
        return type(self)(np.repeat(self.evidence[:, None], forks, axis=1))

    def select(self, choice: IntArray) -> FakeState:
        return type(self)(self.evidence[:, 0])


class NeverReset(FakeState):
    def fork(self, forks: int) -> FakeState:
        return type(self)(np.repeat(self.evidence[:, None], forks, axis=1))

    def select(self, choice: IntArray) -> FakeState:
        return type(self)(self.evidence[np.arange(len(choice)), choice])

    def reset(self, mask: BoolArray) -> FakeState:
        return self


class AllReset(NeverReset):
    def reset(self, mask: BoolArray) -> FakeState:
        return type(self)(np.zeros_like(self.evidence))


def with_state(kind: type[FakeState]) -> Recogniser:
    recogniser = WithState()
    recogniser.state = kind
    return recogniser


class Clips(Fake):
    delay = 0

    def recognise_clip(self, sensed: Sensed, viewpoint: FloatArray) -> Recognition:
        frames: Sequence[int] = range(viewpoint.shape[1])
        state, seen = self.start(len(viewpoint)), []
        for frame in frames:
            at = min(frame + self.delay, frames[-1])
            recognition, state = self.step(state, Sensed(*(array[:, at] for array in sensed)), viewpoint[:, at])
            seen.append(recognition)
        return Recognition(*(np.stack(arrays, axis=1) for arrays in zip(*seen, strict=True)))


class LooksAhead(Clips):
    delay = 1


class Remembers(Fake):
    """Knows a stream again by its first frame, and says what it said at its end."""

    def __init__(self) -> None:
        super().__init__()
        self.ends: dict[bytes, FloatArray] = {}

    def step(self, state: Any, sensed: Sensed, viewpoint: FloatArray) -> tuple[Recognition, Any]:
        recognition, after = super().step(state, sensed, viewpoint)
        if not state.evidence.any():
            self.key, self.remembered = sensed.joints_2d.tobytes(), self.ends.get(sensed.joints_2d.tobytes())
        self.ends[self.key] = recognition.log_probs
        if self.remembered is None or self.remembered.shape != recognition.log_probs.shape:
            return recognition, after
        return softened(recognition, self.remembered), after


class Tape(Fake):
    """Reads ahead: the last frame's joints, from the frames that are being streamed."""

    def changed(self, recognition: Recognition) -> Recognition:
        frame = sys._getframe()
        while frame is not None and "frames" not in frame.f_locals:
            frame = frame.f_back
        last = None if frame is None else frame.f_locals["frames"][-1].sensed.joints_2d
        if last is None or len(last) != len(recognition.log_probs) or recognition.log_probs.ndim != 2:
            return recognition
        return softened(recognition, last[:, 0, : len(CLASS_NAMES), 0] / 100)


class Spoils(Fake):
    def step(self, state: Any, sensed: Sensed, viewpoint: FloatArray) -> tuple[Recognition, Any]:
        seen = super().step(state, sensed, viewpoint)
        sensed.joints_2d[...] -= 640
        return seen


class Locked(Fake):
    def __init__(self) -> None:
        super().__init__()
        self.lock = threading.Lock()


class Broken(Fake):
    def changed(self, recognition: Recognition) -> Recognition:
        raise KeyError("layer 3")


BATCH_OF_7 = "recognises a batch of 7: log_probs (7, 3), embedding (7, 3)"
FUTURE = "the past does not see the future"
FORKS = "fork(3) sees 3 alternatives of an episode"
DEFECTS = [
    (Narrow(), BATCH_OF_7, r"^embedding: values of float32 in shape \(7, 2\), for shape \(7, 3\)$"),
    (Integers(), BATCH_OF_7, r"^embedding: values of int64 in shape \(7, 3\), for shape \(7, 3\)$"),
    (Infinite(), BATCH_OF_7, r"^log_probs: NaN or infinity of float32 in shape \(7, 3\)"),
    (Broken(), BATCH_OF_7, r"^step: KeyError: 'layer 3' \(.*test_recogniser.py, line \d+\)$"),
    (Logits(), "log-probabilities are normalised", r"^probabilities that sum to 2.718 in row \d after frame \d+$"),
    (Dropout(), "does the same twice", r"^log_probs of row 0 after frame 0: \[.*\] at first, \[.*\] the second time$"),
    (BatchNorm(), "rows alone, and in another order, are recognised the same", r"in a batch of 7, .* alone$"),
    (Stateful(), "two streams side by side do not disturb each other", r"with another stream in between$"),
    (InPlace(), "a state stays valid after a step", r"at first, \[.*\] from that state again$"),
    (with_state(NoFork), FORKS, r"^fork: NotImplementedError: forks \(.*line \d+\)$"),
    (with_state(SameFork), FORKS, r"for alternative 0 by itself, \[.*\] from the fork$"),
    (with_state(FirstSelected), "select(choice) goes on with one alternative", r"after it was selected$"),
    (with_state(NeverReset), "reset(mask) lets some episodes begin anew", r"after reset, in rows of the mask$"),
    (with_state(AllReset), "reset(mask) lets some episodes begin anew", r"after reset, in rows not of the mask$"),
    (LooksAhead(), WHOLE, r"at once, \[.*\] frame by frame$"),
    (Remembers(), FUTURE, r"^log_probs of row 0 after frame 0: \[.*\] at first, \[.*\] with another future$"),
    (Tape(), FUTURE, r"^log_probs of row 0 after frame 0: \[.*\] at first, \[.*\] with another future$"),
    (Spoils(), "leaves what it is shown as it is", r"^joints_2d changed$"),
    (Locked(), "can be sent to a worker process", r"^TypeError: cannot pickle '_thread.lock' object$"),
]  # fmt: skip


@pytest.mark.parametrize(("recogniser", "name", "got"), DEFECTS, ids=[type(defect[0]).__name__ for defect in DEFECTS])
def test_what_is_wrong_is_found_and_said(recogniser: Recogniser, name: str, got: str) -> None:
    found = checked(recogniser)
    failed = {check.name: check for check in found.failed}
    assert name in failed, str(found)
    assert re.search(got, failed[name].got), failed[name].got
    assert failed[name].expected
    assert failed[name].mend


@pytest.mark.parametrize("form", ["causal", "ctrgcn"])
def test_our_recognisers_pass(form: Any) -> None:
    spec = NetworkSpec.of(DATA, form=form, size="small", length=20)
    network = spec.build()
    made: dict[str, Any] = {"spec": spec, "temperature": Temperature(), "sha256": "none"}
    if isinstance(network, CausalCTRGCN):
        found = checked(StreamingRecogniser(network=network, **made))
    else:
        assert isinstance(network, CTRGCN)
        found = checked(PrefixRecogniser(network=network, **made))
    assert found.passed, str(found)
    assert [check.name for check in found.checks if check.passed is None] == [WHOLE]


def test_one_that_also_recognises_clips_is_held_to_it() -> None:
    found = checked(Clips())
    assert found.passed, str(found)
    assert all(check.passed for check in found.checks)
    assert str(found).startswith("recogniser Clips: 16 passed\n  passed       recognises a batch of 7: ")
