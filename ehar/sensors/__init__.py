"""Sensors: they turn joints in space into the output of a pose estimator."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from ehar.sensors.estimator import EstimatorSensor as EstimatorSensor
    from ehar.sensors.perfect import PerfectSensor as PerfectSensor
    from ehar.sensors.registry import make_sensor as make_sensor
    from ehar.sensors.sensor import Sensed as Sensed
    from ehar.sensors.sensor import Sensor as Sensor
    from ehar.sensors.sensor import SensorNoise as SensorNoise
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "Sensor": "ehar.sensors.sensor",
            "Sensed": "ehar.sensors.sensor",
            "SensorNoise": "ehar.sensors.sensor",
            "PerfectSensor": "ehar.sensors.perfect",
            "EstimatorSensor": "ehar.sensors.estimator",
            "make_sensor": "ehar.sensors.registry",
        },
    )
