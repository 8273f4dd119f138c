"""Streams and a recogniser of them that learned nothing, at 30 frames a second; and frames for a live loop."""

from pathlib import Path
from typing import Any

import numpy as np

from ehar.arrays import FloatArray
from ehar.conditions import Conditions
from ehar.data.streams.file import save_streams
from ehar.viewpoint import cartesian
from recognition.calibration import Temperature
from recognition.networks.spec import NetworkSpec
from recognition.storage import recogniser_path, save_recogniser
from tests.helpers.random_networks import randomised
from tests.helpers.streams import raising_streams

FPS = 30.0
START = np.array([8.0, 1.0, 1.2])  # a viewpoint
HEIGHTS = (-0.9, 0.4, 0.4, 0.0, 0.9, 0.9)  # of the joints of a frame's person; y points down


def save_live_world(folder: Path) -> Path:
    """Write raising.npz, and models for it as seen through the perfect sensor; return the folder."""
    data = raising_streams(people=8, seconds=12, fps=FPS)
    save_streams(folder / "raising.npz", data)
    told = Conditions()
    spec = NetworkSpec.of(data, form="causal", size="small", length=30)
    network = spec.build()
    randomised(network)
    save_recogniser(
        recogniser_path(folder / "models", told), network, spec, Temperature((2.0,) * 5), {"run": {"size": "small"}}
    )
    return folder


def person(x: float = 640.0, y: float = 360.0, *, size: float = 100.0) -> dict[str, Any]:
    """Return a person of six joints, in the recogniser's order, around a place in the image [px]."""
    keypoints = [[x + 10.0 * joint, y + size * height, 0.9] for joint, height in enumerate(HEIGHTS)]
    return {"keypoints": keypoints}


def frame(time: float, *people: dict[str, Any], viewpoint: FloatArray | None = START, **more: Any) -> dict[str, Any]:
    """Return a frame in the recogniser's order of joints; without a viewpoint, the camera's pose is missing."""
    held: dict[str, Any] = {"time": time, "joints": "own", "people": people, **more}
    if viewpoint is not None:
        held["camera"] = {"position": cartesian(viewpoint).tolist()}
    return held
