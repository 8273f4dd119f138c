"""Setpoints for an autopilot: SET_POSITION_TARGET_LOCAL_NED of MAVLink, by pymavlink."""

import math
import time
from typing import Any

from ehar.errors import UsageError
from eval.live.loop import Said
from eval.live.messages import Vector
from eval.live.setpoints import Setpoint

ALL_OF_IT = 0  # type_mask: no bit set means that position, velocity, acceleration, yaw and yaw rate all count
HEARTBEAT = 1.0  # [s] between two heartbeats of a companion computer
AUTOPILOT, ITS_COMPONENT = 1, 1  # system and component of the vehicle
OURS = 1  # our system; a companion computer is a component of the vehicle


class Mavlink:
    """Sends each setpoint to an autopilot, and a heartbeat a second. It arms nothing and changes no mode.

    Args:
        address: as pymavlink writes it: udpout:127.0.0.1:14540, or a serial device.
        origin: where people are in the vehicle's local frame: east, north, up [m]; for setpoints that do not say it.

    Raises:
        UsageError: pymavlink is not installed, or there is no such address.
    """

    def __init__(self, address: str, *, origin: Vector = (0.0, 0.0, 0.0)) -> None:
        """Open the connection."""
        try:
            from pymavlink import mavutil  # imported here: an extra that few need
        except ImportError as error:
            raise UsageError("--mavlink needs pymavlink: pip install -e '.[mavlink]'") from error
        self._kinds: Any = mavutil.mavlink
        try:
            self._link: Any = mavutil.mavlink_connection(
                address, source_system=OURS, source_component=self._kinds.MAV_COMP_ID_ONBOARD_COMPUTER
            )
        except (OSError, ValueError, IndexError, ImportError) as error:  # a serial device needs pyserial
            raise UsageError(
                f"--mavlink {address}: expected an address such as udpout:127.0.0.1:14540: {error}"
            ) from error
        self._origin = origin
        self._heartbeat = -math.inf

    def send(self, said: Said) -> None:
        """Send a setpoint; without one, nothing is sent."""
        now = time.monotonic()
        if now - self._heartbeat >= HEARTBEAT:
            self._heartbeat = now
            kinds = self._kinds
            self._link.mav.heartbeat_send(
                kinds.MAV_TYPE_ONBOARD_CONTROLLER, kinds.MAV_AUTOPILOT_INVALID, 0, 0, kinds.MAV_STATE_ACTIVE
            )
        if said.setpoint is not None:
            motion, origin = said.setpoint.whole, self._origin if said.setpoint.centre is None else (0.0, 0.0, 0.0)
            east, north, up = (sum(pair) for pair in zip(motion.position, origin, strict=True))
            self._link.mav.set_position_target_local_ned_send(
                int(1000 * said.setpoint.time) % 2**32,
                AUTOPILOT,
                ITS_COMPONENT,
                self._kinds.MAV_FRAME_LOCAL_NED,
                ALL_OF_IT,
                *ned((east, north, up)),
                *ned(motion.velocity),
                *ned(motion.acceleration),
                *heading(said.setpoint),
            )

    def close(self) -> None:
        """Close the connection."""
        self._link.close()


def ned(vector: Vector) -> Vector:
    """Return a vector of east, north and up as one of north, east and down."""
    east, north, up = vector
    return north, east, -up


def heading(setpoint: Setpoint) -> tuple[float, float]:
    """Return yaw and yaw rate from north towards east [rad], [rad/s]; the yaw lies from -pi to pi."""
    return math.remainder(math.pi / 2 - setpoint.yaw, 2 * math.pi), -setpoint.yaw_rate
