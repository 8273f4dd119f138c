"""Lines of JSON that are frames, and lines that are not: an error says what was got, in one line."""

import json

import pytest

from ehar.camera import Camera
from ehar.errors import DataError
from eval.live.messages import CameraPose, Frame, SeenPerson, read_frame, written

WHOLE = Frame(
    time=1.5,
    people=(SeenPerson(keypoints=((1.0, 2.0, 0.5), None), id="a"), SeenPerson(keypoints=((3.0, 4.0, 1.0),))),
    camera=CameraPose(position=(6.0, 0.0, 2.0), yaw=3.1, pitch=-0.3),
    joints="body25",
    image=Camera(width=640, height=480, focal_length=500.0),
)


def test_what_is_written_is_read() -> None:
    assert read_frame(written(WHOLE)) == WHOLE
    assert read_frame(json.loads(written(WHOLE))) == WHOLE


def test_little_is_needed() -> None:
    assert read_frame('{"time": 3}') == Frame(time=3.0, people=(), camera=None, joints="coco17", image=None)


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("{", "expected the JSON of a frame"),
        ("[]", "expected the JSON object of a frame"),
        ("{}", "missing time"),
        ('{"time": NaN}', "time: expected a finite number"),
        ('{"time": "now"}', "time: expected a number, got 'now'"),
        ('{"time": 0, "poeple": []}', "unknown poeple"),
        ('{"time": 0, "joints": "coco18"}', "joints: expected 'coco17', 'body25', 'mediapipe33' or 'own'"),
        ('{"time": 0, "people": [{"keypoints": []}]}', r"people\[0\].keypoints: expected at least 1 items"),
        ('{"time": 0, "people": [{"keypoints": [[1, 2]]}]}', r"people\[0\].keypoints\[0\]"),
        ('{"time": 0, "people": [{"keypoints": [[1, 2, 1.5]]}]}', r"people\[0\].keypoints\[0\]"),
        ('{"time": 0, "camera": {"position": [0, 0, 0]}}', "camera.position: expected 0.1 to 10000 m from the people"),
        ('{"time": 0, "camera": {"position": [6, 0, 0], "yaw": 1}}', "camera: expected yaw and pitch or none"),
        ('{"time": 0, "image": {"width": 0, "height": 1, "focal_length": 1}}', "camera: expected width"),
    ],
)
def test_a_line_that_is_no_frame_is_named_in_one_line(line: str, problem: str) -> None:
    with pytest.raises(DataError, match=f"line 7: .*{problem}") as raised:
        read_frame(line, "line 7")
    assert "\n" not in str(raised.value)


def test_what_json_cannot_say_is_refused() -> None:
    with pytest.raises(DataError, match="expected what JSON can say"):
        read_frame({"time": object()})
