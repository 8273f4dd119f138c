"""What a report has of its replays, as small integers."""

import base64

import numpy as np

from eval.replays.data import viewpoints


def test_a_far_camera_is_where_it_was() -> None:
    path = np.array([[5.004, 0.0, 0.0], [65.6, np.pi, np.pi / 2], [640.0, -np.pi / 2, np.pi]])
    whole = np.frombuffer(base64.b64decode(viewpoints(path)), "<u2").reshape(-1, 3)
    assert whole.tolist() == [[500, 0, 0], [6560, 18000, 9000], [64000, 27000, 18000]]
