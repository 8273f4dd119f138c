"""The messages of the live loop: a frame of a pose estimator, and what is said of it."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Annotated, Any

from annotated_types import Ge, Le, Len

from ehar.arrays import FloatArray
from ehar.camera import Camera
from ehar.errors import DataError
from ehar.files import parse_json
from eval.live.joints import Order

Vector = tuple[float, float, float]
NEAREST, FARTHEST = 0.1, 1e4  # [m], from the camera to the people
AWAY = 1e7  # [m], from the vehicle's local origin to the people; the way around the earth is four times as far
WIDEST = 1e6  # [px], from a corner of the image to a keypoint
Keypoint = tuple[float, float, Annotated[float, Ge(0), Le(1)]]  # x and y [px], and a confidence


@dataclass(frozen=True, kw_only=True)
class SeenPerson:
    """A person in a frame.

    Args:
        keypoints: x [px], y [px] and confidence of each joint; None for a joint that is not seen.
        id: number or name of the person, if a tracker knows it; None lets places in the image tell who is who.
    """

    keypoints: Annotated[tuple[Keypoint | None, ...], Len(1)]
    id: int | str | None = None


@dataclass(frozen=True, kw_only=True)
class CameraPose:
    """Where the camera is, in the people's frame: its origin is where people are, x east, y north, z up.

    Args:
        position: place of the camera [m].
        yaw: where it looks, from east towards north [rad]; None, as for `pitch`, means that it looks at the origin.
        pitch: how far it looks above the horizon [rad]; below is negative. It does not roll.

    Raises:
        DataError: the camera is at the origin, or nowhere near, or has a yaw without a pitch, or one that is no number.
    """

    position: Vector
    yaw: float | None = None
    pitch: float | None = None

    def __post_init__(self) -> None:
        """Check the distance, and that there are both angles or none."""
        if not NEAREST <= math.hypot(*self.position) <= FARTHEST:
            expected = f"expected {NEAREST:g} to {FARTHEST:g} m from the people"
            raise DataError(f"camera.position: {expected}, got {list(self.position)}")
        if (self.yaw is None) != (self.pitch is None) or not math.isfinite((self.yaw or 0.0) + (self.pitch or 0.0)):
            raise DataError(f"camera: expected yaw and pitch or none, got {self.yaw} and {self.pitch}")

    def moved(self, way: Vector) -> "CameraPose":
        """Return the pose with its place moved [m], if it is still one then."""
        x, y, z = (sum(pair) for pair in zip(self.position, way, strict=True))
        return replace(self, position=(x, y, z)) if NEAREST <= math.hypot(x, y, z) <= FARTHEST else self


@dataclass(frozen=True, kw_only=True)
class Frame:
    """What a pose estimator says of one image.

    Args:
        time: when the image was taken [s], by any clock that does not stop.
        people: the people in it, in any order.
        camera: the camera's pose; None where it is not known.
        joints: order of keypoints: coco17, body25, mediapipe33, or own, which is the recogniser's.
        image: size of the image and focal length [px]; None means the camera of the recogniser's world.
        origin: where the people's frame is in the vehicle's local frame [m], which has the same axes; None if it rests.

    Raises:
        DataError: the time or the origin is no number, or the origin is nowhere near.
    """

    time: float
    people: tuple[SeenPerson, ...] = ()
    camera: CameraPose | None = None
    joints: Order = "coco17"
    image: Camera | None = None
    origin: Vector | None = None

    def __post_init__(self) -> None:
        """Check numbers that would stay in the clock or in the filter of people."""
        if not math.isfinite(self.time):
            raise DataError(f"time: expected a finite number, got {self.time}")
        if self.origin is not None and not math.hypot(*self.origin) <= AWAY:
            raise DataError(f"origin: expected a place within {AWAY:g} m, got {list(self.origin)}")


def read_frame(message: str | Mapping[str, Any], where: str = "frame") -> Frame:
    """Return the frame of one line of JSON, or of what such a line says.

    Args:
        message: the line, or the object.
        where: name of the message in errors.

    Raises:
        DataError: it is not JSON, or not a frame.
    """
    try:
        text = message if isinstance(message, str) else json.dumps(message)
    except (TypeError, ValueError) as error:
        raise DataError(f"{where}: expected what JSON can say, got {error}") from error
    return parse_json(text, Frame, where, "a frame", defaults=True)


def written(frame: Frame) -> str:
    """Return a frame as a line of JSON, which `read_frame` reads."""
    return json.dumps(asdict(frame), separators=(",", ":"))


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """What is thought after a frame.

    Args:
        time: the frame's time [s].
        belief: probability of each activity, and of none.
        decision: the activity that is sure enough to be named; None if none is.
        viewpoint: distance [m], azimuth and polar angle [rad] of the camera as it was seen from; None before any pose.
        target: the viewpoint that the planner wants; None if there is none.
        joints: (P, J, 3), x [px], y [px] and confidence of each joint, in the recogniser's camera; None if not watched.
        notes: what was wrong with the frame.
    """

    time: float
    belief: Mapping[str, float]
    decision: str | None
    viewpoint: Vector | None
    target: Vector | None
    joints: FloatArray | None = field(default=None, repr=False)
    notes: tuple[str, ...] = ()
