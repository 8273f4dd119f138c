"""What the pose estimators' scripts send is what `ehar live` reads; neither needs to be installed for that.

The stand-ins have the calls of mediapipe 1.2.2 and rtmlib 0.0.16, as their packages define them.
"""

import importlib.util
import socket
import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from eval.live.joints import ORDERS
from eval.live.messages import Frame, read_frame
from tests.helpers.pages import DOCS

CAMERA = {"position": [6.0, 0.0, 1.5]}


def script(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, DOCS / "examples" / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_landmarks_of_mediapipe_become_pixels() -> None:
    landmarks = [[(0.25, 0.5, 0.9)] * 33, [(0.5, 1.5, 1.0000001)] * 33]
    frame = read_frame(script("live_mediapipe").message(1.5, landmarks, 1280, 720, CAMERA, 900.0))
    assert (frame.joints, len(frame.people), frame.time) == ("mediapipe33", 2, 1.5)
    assert frame.people[0].keypoints == ((320.0, 360.0, 0.9),) * len(ORDERS["mediapipe33"])
    assert frame.people[1].keypoints[0] == (640.0, 1080.0, 1.0)


def test_keypoints_of_rtmpose_are_coco17() -> None:
    keypoints, scores = np.full((2, 17, 2), 7, dtype=np.float32), np.full((2, 17), 1.2, dtype=np.float32)
    frame = read_frame(script("live_rtmpose").message(0.0, keypoints, scores, 640, 480, CAMERA, 500.0))
    assert frame.joints == "coco17" and len(frame.people) == 2
    assert frame.people[0].keypoints == ((7.0, 7.0, 1.0),) * len(ORDERS["coco17"])
    assert frame.image is not None and frame.image.focal_length == 500
    empty = read_frame(script("live_rtmpose").message(0.0, keypoints[:0], scores[:0], 640, 480, CAMERA, 500.0))
    assert empty.people == ()


class Video:
    """Two images, and no more."""

    def __init__(self, source: int | str) -> None:
        assert source == 0
        self._left = 2

    def read(self) -> tuple[bool, Any]:
        self._left -= 1
        return self._left >= 0, np.zeros((480, 640, 3), dtype=np.uint8)


class Body:
    """rtmlib's: nobody in the first image, somebody in the second."""

    def __init__(self, mode: str, backend: str, device: str) -> None:
        self._seen = 0

    def det_model(self, image: np.ndarray) -> np.ndarray:
        self._seen += 1
        return np.zeros((self._seen - 1, 4))

    def pose_model(self, image: np.ndarray, bboxes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        people = max(len(bboxes), 1)  # without boxes, the whole image counts as one
        return np.full((people, 17, 2), 9.0), np.full((people, 17), 0.5)


class Landmarker:
    """MediaPipe's PoseLandmarker: nobody in the first image, somebody in the second."""

    def __init__(self, options: Any) -> None:
        assert options.base_options.model_asset_path == "pose.task" and options.num_poses == 1
        self._times: list[int] = []

    create_from_options = classmethod(lambda cls, options: cls(options))

    def __enter__(self) -> "Landmarker":
        return self

    def __exit__(self, *_: object) -> None:
        """Release nothing."""

    def detect_for_video(self, image: Any, timestamp_ms: int) -> SimpleNamespace:
        self._times.append(timestamp_ms)
        mark = SimpleNamespace(x=0.5, y=0.5, visibility=None)  # a model may tell none
        return SimpleNamespace(pose_landmarks=[[mark] * 33] * (len(self._times) - 1))


def told(*_: Any, **options: Any) -> SimpleNamespace:
    return SimpleNamespace(**options)


def stand_ins() -> dict[str, Any]:
    cv2 = SimpleNamespace(VideoCapture=Video, cvtColor=lambda image, _: image, COLOR_BGR2RGB=4)
    vision = SimpleNamespace(
        PoseLandmarkerOptions=told, PoseLandmarker=Landmarker, RunningMode=SimpleNamespace(VIDEO="video")
    )
    tasks = SimpleNamespace(BaseOptions=told, vision=vision)
    mediapipe = SimpleNamespace(
        Image=told, ImageFormat=SimpleNamespace(SRGB=1), tasks=SimpleNamespace(python=tasks), __path__=[]
    )
    return {
        "cv2": cv2,
        "rtmlib": SimpleNamespace(Body=Body),
        "mediapipe": mediapipe,
        "mediapipe.tasks": mediapipe.tasks,
        "mediapipe.tasks.python": tasks,
    }


@pytest.mark.parametrize(("name", "options"), [("live_mediapipe", ["--model", "pose.task"]), ("live_rtmpose", [])])
def test_a_script_sends_a_frame_for_each_image(name: str, options: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    for module, held in stand_ins().items():
        monkeypatch.setitem(sys.modules, module, held)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5.0)
        monkeypatch.setattr(sys, "argv", [name, "--to", f"127.0.0.1:{receiver.getsockname()[1]}", *options])
        script(name).main()
        frames: list[Frame] = [read_frame(receiver.recv(65_535).decode()) for _ in range(2)]
    assert [len(frame.people) for frame in frames] == [0, 1] and frames[0].time <= frames[1].time
    assert frames[0].camera is not None and frames[0].camera.position == (6.0, 0.0, 1.5)
    assert frames[0].image is not None and (frames[0].image.width, frames[0].image.height) == (640, 480)
