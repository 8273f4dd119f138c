"""The loop: one thread hears, one watches, and one flies, which waits for neither."""

import json
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence
from threading import Condition, Thread
from typing import Any, NamedTuple

from ehar.errors import DataError
from eval.live.figures import Latencies, LoopFigures
from eval.live.messages import Answer, read_frame
from eval.live.pacing import Pacer
from eval.live.setpoints import Setpoint
from eval.live.watcher import Watcher

SILENCE = 1.0  # [s] without a new frame after which the vehicle brakes to hover
BACKLOG = 64  # frames that may wait to be watched; older ones are dropped
DIGITS = 6  # of numbers in lines
UNREADABLE, DROPPED, SILENT = "unreadable", "dropped, as watching takes too long", "nothing heard for a second"
ENDED = "the frames ended"  # nothing is wrong, so it is not counted
COMING_TO_REST = 20.0  # [s] at most, at the end


class Said(NamedTuple):
    """What goes out: the newest answer, and a setpoint."""

    answer: Answer | None
    setpoint: Setpoint | None
    notes: tuple[str, ...]  # what was wrong since what went out before
    counts: dict[str, int]

    def line(self) -> str:
        """Return it as a line of JSON."""
        answer, setpoint = self.answer, self.setpoint
        held = {
            "time": None if setpoint is None else setpoint.time,
            "frame": None if answer is None else answer.time,
            "belief": None if answer is None else answer.belief,
            "decision": None if answer is None else answer.decision,
            "viewpoint": None if answer is None else answer.viewpoint,
            "target": None if answer is None else answer.target,
            "setpoint": None if setpoint is None else _listed(setpoint),
            "notes": self.notes,
            "counts": self.counts,
        }
        return json.dumps(_rounded(held), ensure_ascii=False, separators=(",", ":"))


def _listed(setpoint: Setpoint) -> dict[str, Any]:
    """Return a setpoint as JSON has it."""
    return vars(setpoint) | {"centre": None if setpoint.centre is None else setpoint.centre._asdict()}


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return round(value, DIGITS)
    if isinstance(value, dict):
        return {key: _rounded(held) for key, held in value.items()}
    return [_rounded(held) for held in value] if isinstance(value, tuple) else value


class Loop:
    """Hears frames, watches them, and sends setpoints without a pause.

    Args:
        watcher: watches; nobody else may use it meanwhile.
        outputs: are handed all that goes out; they must not wait, and run in the thread that flies.
        hears: is handed each answer, in the thread that watches; for rehearsals.
    """

    def __init__(
        self,
        watcher: Watcher,
        outputs: Sequence[Callable[[Said], None]],
        *,
        hears: Callable[[Answer], None] | None = None,
    ) -> None:
        """Create the loop; `run` starts it."""
        self._watcher, self._outputs, self._hears = watcher, outputs, hears
        self._changed = Condition()  # guards all below
        self._inbox = deque[tuple[float, str]]()
        self._ended = self._stopped = False
        self._answer: Answer | None = None
        self._notes: list[str] = []
        self._undecided = deque[float](maxlen=BACKLOG)  # when frames came in that no setpoint went out for yet
        self._decided = False
        self._heard = time.monotonic()
        self._failure: BaseException | None = None
        self._counts: Counter[str] = Counter()
        self._watcher_counts: Counter[str] = Counter()
        self._lines = self._setpoints = 0
        self._gap, self._latencies = 0.0, Latencies()

    def going(self) -> bool:
        """Return whether the loop goes on."""
        return not (self._ended or self._stopped)

    def end(self) -> None:
        """Hear nothing more: watch what waits, come to rest, and end."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def run(self, lines: Iterable[str]) -> LoopFigures:
        """Run until the lines end, or somebody presses Ctrl-C, and the vehicle rests.

        Whatever fails but the flight itself, the vehicle comes to rest first.

        Raises:
            EharError: lines cannot be read, or the flight failed.
            KeyboardInterrupt: somebody pressed Ctrl-C again.
        """
        threads = [
            Thread(target=self._guarded, args=(work,), name=f"ehar live: {name}", daemon=True)
            for name, work in (("hears", lambda: self._hear(lines)), ("flies", self._fly))
        ]
        try:
            for thread in threads:
                thread.start()
            try:
                self._watch()
            except KeyboardInterrupt:  # a second one ends at once
                self._end_now()
            except Exception as failure:
                self._failure = failure
                self._end_now()
            self._rest()
        finally:
            with self._changed:
                self._stopped = True
                self._changed.notify_all()
            threads[1].join()
        if self._failure is not None:
            raise self._failure
        return self.figures()

    def figures(self) -> LoopFigures:
        """Return what the loop did until now."""
        with self._changed:
            return LoopFigures(
                lines=self._lines,
                setpoints=self._setpoints,
                longest_gap=self._gap,
                latencies=self._latencies,
                counts=self._all_counts(),
            )

    def _end_now(self) -> None:
        """Hear nothing more, and leave what waits."""
        self.end()
        with self._changed:
            self._inbox.clear()

    def _guarded(self, work: Callable[[], None]) -> None:
        """Run the work of a thread; its failure ends the loop and is raised by `run`."""
        try:
            work()
        except BaseException as failure:
            self._failure = self._failure or failure
            with self._changed:
                self._ended = True
                self._stopped = self._stopped or work == self._fly  # without it nothing can come to rest
                self._changed.notify_all()

    def _hear(self, lines: Iterable[str]) -> None:
        for line in lines:
            if not self.going():
                break
            arrived = time.monotonic()
            if not line.strip():
                continue
            with self._changed:
                self._lines += 1
                self._inbox.append((arrived, line))
                if len(self._inbox) > BACKLOG:
                    self._inbox.popleft()
                    self._counts[DROPPED] += 1
                self._changed.notify_all()
        self.end()

    def _watch(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._inbox or self._ended)
                if not self._inbox or self._stopped:
                    return
                arrived, line = self._inbox.popleft()
                number, newest = self._lines - len(self._inbox), not self._inbox
            try:
                frame = read_frame(line, f"line {number}")
                answer = self._watcher.see(frame, arrived=arrived, newest=newest)
            except DataError as error:
                with self._changed:
                    self._counts[UNREADABLE] += 1
                    self._notes = [*self._notes, f"{UNREADABLE}: {error}"][-BACKLOG:]
                    self._decided = self._decided or not self._watcher.setpoints.begun  # so that somebody hears of it
                    self._changed.notify_all()
                continue
            if self._hears is not None:
                self._hears(answer)
            with self._changed:
                self._answer = answer
                self._watcher_counts = Counter(self._watcher.counts)  # a copy, as the watcher goes on counting
                self._notes = [*self._notes, *answer.notes][-BACKLOG:]
                watched = answer.joints is not None  # what is refused is not heard, and no setpoint answers it
                self._decided = self._decided or watched or not self._watcher.setpoints.begun
                if watched:
                    self._heard = time.monotonic()
                    self._undecided.append(arrived)
                self._changed.notify_all()

    def _fly(self) -> None:
        pacer, last = Pacer(1 / self._watcher.setpoint_rate), 0.0
        while True:
            begun = self._watcher.setpoints.begun
            with self._changed:
                timeout = pacer.wait(time.monotonic()) if begun else None
                self._changed.wait_for(lambda: self._decided or self._stopped, timeout)
                if self._stopped:
                    return
                decided, self._decided = self._decided, False
                over = self._ended and not self._inbox
                silent = time.monotonic() - self._heard > SILENCE
            if not self._watcher.setpoints.begun:
                self._send(None)
                continue
            if (over or silent) and not self._watcher.setpoints.braking:
                self._watcher.setpoints.brake()
                with self._changed:
                    self._notes.append(ENDED if over else SILENT)
                    if not over:
                        self._counts[SILENT] += 1
            if pacer.due(time.monotonic(), decided=decided):
                self._send(self._watcher.setpoint())
                now = time.monotonic()
                with self._changed:
                    self._gap = max(self._gap, now - last if last else 0.0)
                    self._setpoints += 1
                    while self._undecided:
                        self._latencies.add(now - self._undecided.popleft())
                last = now

    def _send(self, setpoint: Setpoint | None) -> None:
        with self._changed:
            said = Said(self._answer, setpoint, tuple(self._notes), self._all_counts())
            self._notes = []
        for output in self._outputs:
            output(said)

    def _all_counts(self) -> dict[str, int]:
        return dict(self._watcher_counts + self._counts)

    def _rest(self) -> None:
        """Wait until the vehicle hovers, and all has been said."""
        until = time.monotonic() + COMING_TO_REST
        setpoints = self._watcher.setpoints
        with self._changed:
            while setpoints.begun and not self._stopped and time.monotonic() < until:
                if setpoints.braking and setpoints.hovering and not self._notes:
                    return
                self._changed.wait(1 / self._watcher.setpoint_rate)
