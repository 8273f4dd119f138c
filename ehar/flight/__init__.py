"""Flight: a vehicle carries the camera and keeps its limits."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from ehar.flight.motion import FlightMotion as FlightMotion
    from ehar.flight.multicopter import Multicopter as Multicopter
    from ehar.flight.telemetry import FlightTelemetry as FlightTelemetry
    from ehar.flight.vehicle import Vehicle as Vehicle
    from ehar.flight.vehicle import load_vehicle as load_vehicle
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "Vehicle": "ehar.flight.vehicle",
            "load_vehicle": "ehar.flight.vehicle",
            "FlightMotion": "ehar.flight.motion",
            "Multicopter": "ehar.flight.multicopter",
            "FlightTelemetry": "ehar.flight.telemetry",
        },
    )
