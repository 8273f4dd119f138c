"""Setpoints for an autopilot, heard by one that drops out below 2 Hz, as PX4 does."""

import json
import socket
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.errors import UsageError
from eval.live.loop import Loop, Said
from eval.live.mavlink import Mavlink
from eval.live.setpoints import Centre, Setpoint
from eval.live.watcher import Watcher
from tests.helpers.live_worlds import FPS, frame, person, save_live_world

mavutil = pytest.importorskip("pymavlink.mavutil", reason="pymavlink is not installed: pip install -e '.[mavlink]'")

DROPS_OUT = 0.5  # [s] without a setpoint after which PX4 leaves offboard mode


class Autopilot:
    """Hears setpoints as PX4 does: in offboard mode as long as they come faster than 2 Hz."""

    def __init__(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self._link: Any = mavutil.mavlink_connection(f"udpin:127.0.0.1:{self.port}")
        self.heard: list[Any] = []
        self.times: list[float] = []
        self.heartbeats = 0
        self._open = True
        self._thread = threading.Thread(target=self._hear, daemon=True)
        self._thread.start()

    def _hear(self) -> None:
        while self._open:
            message = self._link.recv_match(blocking=True, timeout=0.05)
            if message is not None and message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
                self.heard.append(message)
                self.times.append(time.monotonic())
            self.heartbeats += message is not None and message.get_type() == "HEARTBEAT"

    @property
    def dropped_out(self) -> bool:
        return bool(np.diff(self.times).max() > DROPS_OUT)

    def close(self) -> None:
        time.sleep(0.1)
        self._open = False
        self._thread.join()
        self._link.close()


def test_the_autopilot_stays_in_offboard_mode_when_frames_stop_and_come_again(tmp_path: Path) -> None:
    watcher = Watcher(
        models=save_live_world(tmp_path) / "models", sensor="perfect", planner="h-rotate", vehicle="tracking-drone"
    )
    autopilot = Autopilot()
    link = Mavlink(f"udpout:127.0.0.1:{autopilot.port}", origin=(100.0, 20.0, 1.5))

    def lines() -> Any:
        for begin in (0.0, 50.0):
            for number in range(8):
                time.sleep(1 / FPS)
                yield json.dumps(frame(begin + number / FPS, person()))
            time.sleep(1.2 if begin == 0.0 else 0.0)

    said: list[Said] = []
    figures = Loop(watcher, [link.send, said.append]).run(lines())
    autopilot.close()
    link.close()
    assert not autopilot.dropped_out
    assert len(autopilot.heard) == figures.setpoints and autopilot.heartbeats >= 2
    sent = [one.setpoint for one in said if one.setpoint is not None]
    for message, setpoint in zip(autopilot.heard, sent, strict=True):
        east, north, up = np.add(setpoint.position, (100.0, 20.0, 1.5))
        assert (message.x, message.y, message.z) == pytest.approx((north, east, -up), rel=1e-6)
        assert (message.vx, message.vy, message.vz) == pytest.approx(
            (setpoint.velocity[1], setpoint.velocity[0], -setpoint.velocity[2]), abs=1e-6
        )
        assert (message.type_mask, message.coordinate_frame) == (0, mavutil.mavlink.MAV_FRAME_LOCAL_NED)
    assert max(abs(message.vx) for message in autopilot.heard) > 0.05, "it flew"


def test_yaw_counts_from_north_and_clockwise_and_the_people_s_way_comes_on_top() -> None:
    class Sent:
        def __getattr__(self, name: str) -> Any:
            return lambda *values: found.setdefault(name, values)

    found: dict[str, tuple[Any, ...]] = {}
    link = Mavlink("udpout:127.0.0.1:14540", origin=(9.0, 9.0, 9.0))
    link._link.close()
    link._link = type("Link", (), {"mav": Sent()})()
    west_of_people = Setpoint(
        time=2.5,
        position=(-6.0, 0.0, 2.0),
        velocity=(0.0, 1.0, 0.0),
        acceleration=(0.0, 0.0, 3.0),
        yaw=0.0,  # looks east
        yaw_rate=0.2,
        viewpoint=(6.3, 3.14, 1.2),
        braking=False,
        centre=Centre((100.0, 20.0, 1.5), (0.5, 0.0, 0.0), (0.0, 0.25, 0.0)),  # they walk to the east
    )
    link.send(Said(None, west_of_people, (), {}))
    sent = found["set_position_target_local_ned_send"]
    assert sent[0] == 2500
    assert sent[5:] == pytest.approx((20.0, 94.0, -3.5, 1.0, 0.5, 0.0, 0.25, 0.0, -3.0, np.pi / 2, -0.2))
    found.clear()
    link.send(Said(None, replace(west_of_people, centre=None), (), {}))
    assert found["set_position_target_local_ned_send"][5:8] == pytest.approx((9.0, 3.0, -11.0))


@pytest.mark.parametrize("address", ["nowhere", "udpout:127.0.0.1"])
def test_an_address_that_is_none_is_refused_in_a_line(address: str) -> None:
    with pytest.raises(UsageError, match="expected an address such as udpout") as raised:
        Mavlink(address)
    assert "\n" not in str(raised.value)
