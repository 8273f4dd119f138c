"""The observations of the Gymnasium environments: what an agent sees of a frame, scaled for networks."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.camera import Camera
from ehar.flight.vehicle import Vehicle
from ehar.obstacles.free_ways import REACH, free_ways
from ehar.obstacles.shapes import Obstacles
from ehar.planner import Context, Observation
from ehar.viewpoint import AZIMUTH, DISTANCE, POLAR, Workspace

Observations = dict[str, FloatArray]


def shown(
    *,
    joints_2d: FloatArray,
    confidence: FloatArray,
    viewpoint: FloatArray,
    log_probs: FloatArray,
    embedding: FloatArray,
    ratio: float | None,
    workspace: Workspace,
    camera: Camera,
    time: float = 0.0,
    obstacles: Obstacles | None = None,
    centre: FloatArray | None = None,
) -> Observations:
    """Return the agent's observation of one frame of B episodes; every array is float32 and starts with B.

    Args:
        joints_2d: (B, P, J, 2) [px].
        confidence: (B, P, J) in [0, 1].
        viewpoint: (B, 3).
        log_probs: (B, K), from the recogniser.
        embedding: (B, D), from the recogniser.
        ratio: the share of the episode that has been observed, in (0, 1]; None in a stream.
        workspace: the bounds by which viewpoints are scaled.
        camera: the camera by whose image joints are scaled.
        time: time since the first frame, which a stream shows [s].
        obstacles: what stands there; none are shown if there are none.
        centre: (B, 3) how far people's centre has moved since the first frame [m]; None if it stays.

    Returns:
        joints (B, P, J, 2) from the image centre in half image widths, confidence (B, P, J), viewpoint (B, 4),
        probabilities (B, K), embedding (B, D), and ratio (B, 1) or in a stream time (B, 1). Where something stands,
        also distances (B, 6): the `free_ways`, from 0 to 1 over their reach.
    """
    middle = np.array([camera.width / 2, camera.height / 2])
    joints = (joints_2d - middle) / (camera.width / 2)
    when = {"time": time} if ratio is None else {"ratio": ratio}
    around = {"distances": free_ways(obstacles, viewpoint, centre) / REACH} if obstacles else {}
    return {
        "joints": joints.astype(np.float32),
        "confidence": confidence.astype(np.float32),
        "viewpoint": scaled_viewpoint(viewpoint, workspace),
        "probabilities": np.clip(np.exp(log_probs), 0, 1).astype(np.float32),
        "embedding": embedding.astype(np.float32),
        **{name: np.full((len(viewpoint), 1), value, dtype=np.float32) for name, value in when.items()},
        **{name: values.astype(np.float32) for name, values in around.items()},
    }


def shown_to_agent(observation: Observation, context: Context) -> Observations:
    """Return a planner's observation as the environments show it, for agents that were trained in them."""
    return shown(
        joints_2d=observation.joints_2d,
        confidence=observation.confidence,
        viewpoint=observation.viewpoint,
        log_probs=observation.log_probs,
        embedding=observation.embedding,
        ratio=observation.ratio,
        time=observation.time,
        workspace=context.workspace,
        camera=context.world.camera,
        obstacles=context.world.obstacles,
        centre=observation.centre,
    )


def scaled_velocity(velocity: FloatArray, vehicle: Vehicle, workspace: Workspace) -> FloatArray:
    """Return rates of viewpoints (B, 3), each divided by the greatest that a vehicle can reach, from -1 to 1."""
    nearest = max(workspace.distance_min, 1e-3)
    greatest = np.array([vehicle.speed, vehicle.yaw_rate, vehicle.speed / nearest])
    scaled: FloatArray = np.clip(velocity / greatest, -1, 1).astype(np.float32)
    return scaled


def scaled_viewpoint(viewpoint: FloatArray, workspace: Workspace) -> FloatArray:
    """Return viewpoints (B, 3) as (B, 4): distance, sine and cosine of the azimuth, polar angle.

    Distance and polar angle run from 0 to 1 over the workspace.
    """
    azimuth = viewpoint[:, AZIMUTH]
    distance = (viewpoint[:, DISTANCE] - workspace.distance_min) / max(
        workspace.distance_max - workspace.distance_min, 1e-9
    )
    polar = (viewpoint[:, POLAR] - workspace.polar_min) / max(workspace.polar_max - workspace.polar_min, 1e-9)
    scaled = np.stack([np.clip(distance, 0, 1), np.sin(azimuth), np.cos(azimuth), np.clip(polar, 0, 1)], axis=1)
    return scaled.astype(np.float32)
