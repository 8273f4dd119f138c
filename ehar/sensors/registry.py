"""The sensors by name."""

from collections.abc import Callable

from ehar.data.skeleton import Skeleton
from ehar.errors import UsageError
from ehar.sensors.estimator import EstimatorSensor
from ehar.sensors.sensor import PerfectSensor, Sensor

SENSORS: dict[str, Callable[[Skeleton], Sensor]] = {
    "perfect": lambda skeleton: PerfectSensor(),
    "estimator": lambda skeleton: EstimatorSensor(skeleton=skeleton),
}


def make_sensor(sensor: str | Sensor, skeleton: Skeleton) -> Sensor:
    """Return the sensor that is meant, for joints of `skeleton`.

    Raises:
        UsageError: the name is unknown.
    """
    if not isinstance(sensor, str):
        return sensor
    if sensor not in SENSORS:
        raise UsageError(f"unknown sensor {sensor!r}; expected one of: {', '.join(SENSORS)}")
    return SENSORS[sensor](skeleton)
