"""What the pose estimators' scripts send is what `ehar live` reads; neither needs to be installed for that."""

import importlib.util
from types import ModuleType

import numpy as np

from eval.live.joints import ORDERS
from eval.live.messages import read_frame
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
