"""The simulated world of embodied human activity recognition, and the contracts of its planners and recognisers."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

# `rollout` is not lazy, because a module has the same name: this import makes the name stand for the function.
# `from ehar.rollout import Record` still finds the module.
from ehar.rollout import rollout as rollout

if TYPE_CHECKING:
    from ehar.camera import Camera as Camera
    from ehar.conditions import Conditions as Conditions
    from ehar.data.motion_data import MotionData as MotionData
    from ehar.data.motion_file import save_motion as save_motion
    from ehar.data.skeleton import Skeleton as Skeleton
    from ehar.data.source import load_data as load_data
    from ehar.errors import EharError as EharError
    from ehar.flight.motion import FlightMotion as FlightMotion
    from ehar.flight.vehicle import Vehicle as Vehicle
    from ehar.localisation import Localisation as Localisation
    from ehar.motion import GridMotion as GridMotion
    from ehar.planner import Context as Context
    from ehar.planner import Observation as Observation
    from ehar.planner import Planner as Planner
    from ehar.recogniser import Recogniser as Recogniser
    from ehar.recogniser import Recognition as Recognition
    from ehar.sensors.estimator import EstimatorSensor as EstimatorSensor
    from ehar.sensors.perfect import PerfectSensor as PerfectSensor
    from ehar.version import __version__ as __version__
    from ehar.viewpoint import Workspace as Workspace
    from ehar.world import World as World
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "Camera": "ehar.camera",
            "Conditions": "ehar.conditions",
            "Context": "ehar.planner",
            "EharError": "ehar.errors",
            "EstimatorSensor": "ehar.sensors.estimator",
            "FlightMotion": "ehar.flight.motion",
            "GridMotion": "ehar.motion",
            "Localisation": "ehar.localisation",
            "MotionData": "ehar.data.motion_data",
            "Observation": "ehar.planner",
            "PerfectSensor": "ehar.sensors.perfect",
            "Planner": "ehar.planner",
            "Recogniser": "ehar.recogniser",
            "Recognition": "ehar.recogniser",
            "Skeleton": "ehar.data.skeleton",
            "Vehicle": "ehar.flight.vehicle",
            "Workspace": "ehar.viewpoint",
            "World": "ehar.world",
            "__version__": "ehar.version",
            "load_data": "ehar.data.source",
            "rollout": "ehar.rollout",
            "save_motion": "ehar.data.motion_file",
        },
    )
