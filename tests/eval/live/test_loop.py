"""The loop in real time: setpoints come whatever happens to frames, to the planner, and to who listens."""

import io
import json
import socket
import sys
import threading
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.errors import UsageError
from ehar.planner import Context, Observation, Planner
from eval.live.loop import Loop, Said
from eval.live.messages import Answer
from eval.live.setpoints import LimitShares
from eval.live.start import live
from eval.live.transports import Outbox, lines_of
from eval.live.watcher import Watcher
from tests.helpers.live_worlds import FPS, frame, person, save_live_world

LONGEST = 0.25  # [s], between two setpoints where other tests run beside this one; a rehearsal measures it alone


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_live_world(tmp_path_factory.mktemp("live"))


class Slow(Planner):
    """Wants to circle, and takes its time."""

    name = "slow"

    def reset(self, context: Context) -> None:
        """Remember nothing."""

    def act(self, observation: Observation) -> FloatArray:
        time.sleep(0.3)
        return observation.viewpoint + np.array([0.0, 1.0, 0.0])


class Log:
    """Keeps what goes out, and when."""

    def __init__(self) -> None:
        self.said: list[Said] = []
        self.times: list[float] = []

    def take(self, said: Said) -> None:
        self.said.append(said)
        if said.setpoint is not None:
            self.times.append(time.monotonic())

    @property
    def lines(self) -> list[dict[str, Any]]:
        return [json.loads(said.line()) for said in self.said]

    @property
    def notes(self) -> list[str]:
        return [note for said in self.said for note in said.notes]


def paced(*items: dict[str, Any] | str | float) -> Iterator[str]:
    """Yield lines at the recogniser's rate; a number is a pause [s]."""
    for item in items:
        if isinstance(item, float):
            time.sleep(item)
            continue
        time.sleep(1 / FPS)
        yield item if isinstance(item, str) else json.dumps(item)


def people(count: int, begin: float = 0.0) -> list[dict[str, Any]]:
    return [frame(begin + number / FPS, person(500 + 5 * number)) for number in range(count)]


def watcher_of(folder: Path, planner: str | Planner = "h-rotate") -> Watcher:
    return Watcher(models=folder / "models", sensor="perfect", planner=planner, vehicle="tracking-drone")


def test_frames_go_in_setpoints_come_out_and_it_ends_at_rest(folder: Path) -> None:
    log, watcher = Log(), watcher_of(folder)
    shares = LimitShares(watcher.vehicle)
    figures = Loop(watcher, [log.take, lambda said: shares.take(said.setpoint)]).run(paced("{", *people(20), "", "[1]"))
    lines = log.lines
    assert figures.lines == 22 and figures.counts["unreadable"] == 2 and figures.counts["frames"] == 20
    assert any("line 1: expected the JSON of a frame" in note for note in log.notes)
    assert figures.setpoints == len(log.times) > 20
    assert np.diff(log.times).max() < LONGEST and figures.longest_gap < LONGEST
    assert max(shares.greatest.values()) <= 1 and shares.greatest["acceleration"] > 0.2
    last = lines[-1]["setpoint"]
    assert last["braking"] and last["velocity"] == [0, 0, 0]
    flying = next(line for line in lines if line["setpoint"] and line["setpoint"]["velocity"] != [0, 0, 0])
    assert set(flying) == {
        *("time", "frame", "belief", "decision", "viewpoint", "target", "setpoint", "notes", "counts"),
    }
    assert set(flying["belief"]) == {"nod", "left", "right", "no activity"}
    assert [line["time"] for line in lines if line["time"]] == sorted({line["time"] for line in lines if line["time"]})
    assert 0 < figures.latencies.percentile(50) <= figures.latencies.percentile(95)


def test_a_drone_flies_with_people_who_walk_and_stops_when_nobody_says_where_they_are(folder: Path) -> None:
    log, watcher = Log(), watcher_of(folder, "no-act")
    shares = LimitShares(watcher.vehicle)
    walking = [held | {"origin": [5.0, 0.9 * held["time"], 1.0]} for held in people(30)]
    Loop(watcher, [log.take, lambda said: shares.take(said.setpoint)]).run(paced(*walking))
    centres = [line["setpoint"]["centre"] for line in log.lines if line["setpoint"]]
    north = np.array([centre["velocity"][1] for centre in centres])
    assert north.max() > 0.2 and abs(north[-1]) < 0.03, "it comes to rest after the last frame"
    assert centres[0]["position"] == pytest.approx([5, 0, 1], abs=0.01) and centres[-1]["position"][1] > 0.3
    assert max(shares.greatest.values()) <= 1 and shares.greatest["speed"] > 0


def test_silence_makes_it_brake_and_frames_make_it_fly_again(folder: Path) -> None:
    log = Log()
    figures = Loop(watcher_of(folder), [log.take]).run(paced(*people(8), 1.3, *people(8, 10.0)))
    braking = [bool(said.setpoint and said.setpoint.braking) for said in log.said]
    assert np.diff(log.times).max() < LONGEST
    changes = [now for before, now in pairwise(braking) if now != before]
    assert changes == [True, False, True], "silence, frames again, the end"
    assert log.notes.count("nothing heard for a second") == figures.counts["nothing heard for a second"] == 1
    assert log.notes[-1] == "the frames ended", "which is no silence"
    assert "began anew" in log.notes


def test_a_planner_that_takes_long_stalls_nothing(folder: Path) -> None:
    log = Log()
    figures = Loop(watcher_of(folder, Slow()), [log.take]).run(paced(*people(24)))
    assert np.diff(log.times).max() < LONGEST
    assert figures.counts["frames"] == 24 and figures.longest_gap < LONGEST


def test_nothing_goes_out_to_a_vehicle_before_it_is_known_where_the_camera_is(folder: Path) -> None:
    log = Log()
    nowhere = [frame(number / FPS, person(), viewpoint=None) for number in range(5)]
    figures = Loop(watcher_of(folder), [log.take]).run(paced(*nowhere))
    assert figures.setpoints == 0 and figures.counts["no camera pose"] == 5
    assert [line["setpoint"] for line in log.lines] == [None] * len(log.lines)


def test_an_error_of_a_thread_is_raised(folder: Path) -> None:
    def broken(said: Said) -> None:
        raise UsageError("no autopilot")

    with pytest.raises(UsageError, match="no autopilot"):
        Loop(watcher_of(folder), [broken]).run(paced(*people(10)))


def test_who_fails_to_watch_or_to_hear_leaves_the_vehicle_at_rest(folder: Path) -> None:
    def broken(answer: Answer) -> None:
        if answer.time > 0.4:
            raise ValueError("nobody expected this")

    def cut() -> Iterator[str]:
        yield from paced(*people(16))
        raise ValueError("the cable is out")

    for lines, hears, problem in ((paced(*people(40)), broken, "nobody expected"), (cut(), None, "the cable")):
        log = Log()
        with pytest.raises(ValueError, match=problem):
            Loop(watcher_of(folder), [log.take], hears=hears).run(lines)
        flown = [line["setpoint"] for line in log.lines if line["setpoint"]]
        assert any(setpoint["velocity"] != [0, 0, 0] for setpoint in flown)
        assert flown[-1]["braking"] and flown[-1]["velocity"] == [0, 0, 0]
        assert np.diff(log.times).max() < LONGEST


def test_bytes_that_are_no_text_are_a_line_that_cannot_be_read(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    content = b'{"time": 1.0}\n\xff\xfe\n{"time": 1.1}\n'
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(content), encoding="utf-8"))
    (tmp_path / "frames.jsonl").write_bytes(content)
    for source in ("-", str(tmp_path / "frames.jsonl")):
        found = [line.strip() for line in lines_of(source, lambda: True)]
        assert found == ['{"time": 1.0}', "\ufffd\ufffd", '{"time": 1.1}']


def test_frames_arrive_by_datagrams(folder: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    log, watcher = Log(), watcher_of(folder)
    loop = Loop(watcher, [log.take])

    def send() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for line in paced(0.2, *people(8)):
                sender.sendto(line.encode(), ("127.0.0.1", port))
            sender.sendto(b"\xff\xfe {", ("127.0.0.1", port))
        time.sleep(0.2)
        loop.end()

    threading.Thread(target=send, daemon=True).start()
    figures = loop.run(lines_of(f"udp:127.0.0.1:{port}", loop.going))
    assert figures.counts["frames"] == 8 and figures.counts["unreadable"] == 1


def test_times_that_are_none_or_out_of_order_do_not_change_the_pace_of_the_others(tmp_path: Path) -> None:
    file = tmp_path / "frames.jsonl"
    file.write_text("".join(f'{{"time": {at}}}\n' for at in (0, "NaN", 0.2, 0.1, "1e999", 0.3)))
    begin = time.monotonic()
    came = [time.monotonic() - begin for _ in lines_of(str(file), lambda: True)]
    assert [round(at, 1) for at in came] == [0.0, 0.0, 0.2, 0.2, 0.2, 0.3]


def test_where_no_frame_can_be_read_a_line_says_why(folder: Path) -> None:
    log = Log()
    figures = Loop(watcher_of(folder), [log.take]).run(paced("{", "[1]"))
    assert figures.counts["unreadable"] == 2 and figures.setpoints == 0
    assert any("line 1: expected the JSON of a frame" in note for note in log.notes)
    assert all(line["setpoint"] is None for line in log.lines)


def test_a_file_is_played_at_the_pace_of_its_times(tmp_path: Path) -> None:
    file = tmp_path / "frames.jsonl"
    file.write_text('{"time": 5.0}\nnonsense\n{"time": 5.2}\n{"time": 4.0}\n{"time": 4.1}\n')
    begin = time.monotonic()
    found = [(line, time.monotonic() - begin) for line in lines_of(str(file), lambda: True)]
    assert [line for line, _ in found] == file.read_text().splitlines()
    assert [when for _, when in found] == pytest.approx([0, 0, 0.2, 0.2, 0.3], abs=0.08)


@pytest.mark.parametrize(
    ("source", "problem"),
    [
        ("udp:5005", "expected udp:HOST:PORT"),
        ("udp:127.0.0.1:99999", "cannot be listened at"),
        ("no/such.jsonl", "expected a file of frames"),
    ],
)
def test_sources_that_are_none_are_refused_in_a_line(source: str, problem: str) -> None:
    with pytest.raises(UsageError, match=problem):
        lines_of(source, lambda: True)


class Blocked(io.StringIO):
    """A pipe that nobody reads, until it breaks."""

    def __init__(self) -> None:
        super().__init__()
        self.breaks = threading.Event()

    def write(self, text: str) -> int:
        self.breaks.wait(5.0)
        raise BrokenPipeError


def test_who_reads_slowly_loses_lines_and_holds_up_nobody() -> None:
    stream, ended = Blocked(), threading.Event()
    box = Outbox(stream)
    box.when_broken = ended.set
    begin = time.monotonic()
    for _ in range(1000):
        box.put("line")
    assert time.monotonic() - begin < 1.0 and box.dropped > 500
    stream.breaks.set()
    assert ended.wait(2.0)
    box.close()


def test_the_command_reads_a_file_and_writes_lines(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "frames.jsonl"
    file.write_text("".join(json.dumps(held) + "\n" for held in people(10)))
    written = io.StringIO()
    monkeypatch.setattr(sys, "stdout", written)
    figures = live(models=folder / "models", sensor="perfect", planner="no-act", source=str(file))
    lines = [json.loads(line) for line in written.getvalue().splitlines()]
    assert len(lines) >= 10 and lines[-1]["counts"]["frames"] == 10
    assert any("the frames ended" in line["notes"] for line in lines), "it says so before it ends"
    assert "nothing heard for a second" not in lines[-1]["counts"]
    assert "10 lines in" in str(figures) and "ms in the median" in str(figures)
