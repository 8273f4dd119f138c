"""Where frames come from, and where lines go: standard input, a file or UDP; standard output."""

import json
import math
import re
import socket
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from io import TextIOWrapper
from pathlib import Path
from threading import Condition, Thread
from typing import TextIO

from ehar.errors import UsageError
from eval.live.clock import PAUSE

LARGEST = 65_535  # bytes of a datagram
LOOK_UP = 0.1  # [s], how often a wait for datagrams ends to see whether it should go on
WAITING = 256  # lines that may wait for a slow reader; older ones are dropped
LONGEST_WAIT = 60.0  # [s] between two frames of a file


def lines_of(source: str, going: Callable[[], bool]) -> Iterator[str]:
    """Yield the lines of a source as they come.

    Args:
        source: `-`, which is standard input; a file, which is played at the pace of its times; or udp:HOST:PORT, where
            each datagram is a line or several.
        going: whether to go on.

    Raises:
        UsageError: the file cannot be read, or the address is none, or is taken.
    """
    if source == "-":
        if isinstance(sys.stdin, TextIOWrapper):
            sys.stdin.reconfigure(errors="replace")  # a broken line is one that cannot be read, not the end
        return iter(sys.stdin)
    if source.startswith("udp:"):
        return _datagrams(bound(source), going)
    try:
        return _paced(Path(source).read_text(encoding="utf-8", errors="replace").splitlines(), going)
    except OSError as error:
        raise UsageError(f"{source}: expected a file of frames, a JSON object a line, got: {error}") from error


def bound(address: str) -> socket.socket:
    """Return a socket that receives at udp:HOST:PORT; an error says what is wrong with it."""
    match = re.fullmatch(r"udp:(.+):(\d{1,5})", address)
    if match is None:
        raise UsageError(f"source: expected udp:HOST:PORT, such as udp:127.0.0.1:5005, got {address!r}")
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        receiver.bind((match[1], int(match[2])))
    except (OSError, OverflowError) as error:
        receiver.close()
        raise UsageError(f"{address}: cannot be listened at: {error}") from error
    receiver.settimeout(LOOK_UP)
    return receiver


def _datagrams(receiver: socket.socket, going: Callable[[], bool]) -> Iterator[str]:
    with receiver:
        while going():
            try:
                datagram = receiver.recv(LARGEST)
            except TimeoutError:
                continue
            yield from datagram.decode("utf-8", errors="replace").splitlines()


def _paced(lines: list[str], going: Callable[[], bool]) -> Iterator[str]:
    """Yield lines when as much time has passed as between their times; a line without one comes at once."""
    before: float | None = None
    due = time.monotonic()
    for line in lines:
        at = _time_of(line)
        if at is not None:
            due += 0.0 if before is None else min(max(at - before, 0.0), LONGEST_WAIT)
            # A frame that is out of order is waited for no more; a clock that goes far back begins anew.
            before = at if before is None or at > before or before - at > PAUSE else before
        while going() and (left := due - time.monotonic()) > 0:
            time.sleep(min(left, LOOK_UP))
        if not going():
            return
        yield line


def _time_of(line: str) -> float | None:
    """Return the time of a frame, or None if the line has none; what is wrong with it is said by who reads it."""
    try:
        at = float(json.loads(line)["time"])
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
        return None
    return at if math.isfinite(at) else None


class Outbox:
    """Writes lines in a thread of its own, so that nobody waits for a slow reader.

    Args:
        stream: where lines go.
    """

    def __init__(self, stream: TextIO) -> None:
        """Start the thread."""
        self._stream, self._lines = stream, deque[str](maxlen=WAITING)
        self._changed, self._open = Condition(), True
        self.when_broken: Callable[[], None] = lambda: None  # is called when nobody reads any more
        self.dropped = 0
        self._thread = Thread(target=self._write, name="ehar live: output", daemon=True)
        self._thread.start()

    def put(self, line: str) -> None:
        """Write a line soon; if too many wait, the oldest is dropped."""
        with self._changed:
            self.dropped += len(self._lines) == WAITING
            self._lines.append(line)
            self._changed.notify()

    def close(self) -> None:
        """Write what waits, for a second at most."""
        with self._changed:
            self._open = False
            self._changed.notify()
        self._thread.join(1.0)

    def _write(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._lines or not self._open)
                if not self._lines:
                    return
                line = self._lines.popleft()
            try:
                self._stream.write(line + "\n")
                self._stream.flush()
            except (OSError, ValueError):
                self.when_broken()
                return
