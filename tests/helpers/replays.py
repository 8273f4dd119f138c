"""An episode to draw, of which everything is known."""

from typing import Any

import numpy as np

from ehar.camera import Camera, project
from ehar.viewpoint import AZIMUTH
from ehar.world import PAPER
from eval.replays.episode import MAP_AZIMUTHS, CameraReplay, EpisodeReplay, map_polars
from tests.helpers.fakes import CLASS_NAMES, SKELETON, tiny_data

FRAMES, PERSONS = 6, 2


def positions() -> Any:
    """Return where two people are, (L, P, J, 3)."""
    return tiny_data(persons=PERSONS).positions[:FRAMES].astype(np.float64)


def camera_replay(name: str, *, azimuth: float, moves: int = 0, seed: int = 0, **held: Any) -> CameraReplay:
    """Return a camera that goes around in so many steps a frame, and sees all joints exactly."""
    rng = np.random.default_rng(seed)
    path = np.tile([8.0, azimuth, np.radians(60)], (FRAMES, 1))
    path[:, AZIMUTH] = (azimuth + moves * PAPER.workspace.angle_step * np.arange(FRAMES)) % (2 * np.pi)
    joints_2d, _ = project(positions(), path, Camera())
    return CameraReplay(
        **{
            "name": name,
            "path": path,
            "target": path[1:] if moves else path[:-1],
            "gain": rng.normal(size=(FRAMES - 1, len(map_polars()), len(MAP_AZIMUTHS))) if moves else None,
            "joints_2d": joints_2d,
            "seen": np.ones(joints_2d.shape[:-1], dtype=bool),
            "probabilities": rng.dirichlet(np.ones(len(CLASS_NAMES)), FRAMES),
            **held,
        }
    )


def known_replay(**held: Any) -> EpisodeReplay:
    """Return the episode: two cameras start in one place, and the first of them leaves it."""
    return EpisodeReplay(
        **{
            "index": 3,
            "conditions": "tiny (synthetic), perfect sensor",
            "sequence": "sequence-3 from frame 0",
            "class_names": CLASS_NAMES,
            "labels": np.ones(FRAMES, dtype=np.int64),
            "positions": positions(),
            "skeleton": SKELETON,
            "fps": 25.0,
            "camera": Camera(),
            "cameras": (
                camera_replay("spiral", azimuth=np.radians(350), moves=2),
                camera_replay("no-act", azimuth=np.radians(350), seed=1),
            ),
            "notes": (),
            **held,
        }
    )
