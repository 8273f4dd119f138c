"""Sensors of a user: by file, or as an object; what is wrong with them is said in one line."""

from pathlib import Path

import numpy as np
import pytest

from ehar.conditions import Conditions
from ehar.errors import EpisodeError, UsageError
from ehar.sensors.estimator import EstimatorSensor
from ehar.sensors.perfect import PerfectSensor
from ehar.sensors.registry import SENSORS, load_sensor, make_sensor
from ehar.sensors.sensing import sense
from ehar.world import PAPER
from tests.helpers.fakes import CLASS_NAMES, SKELETON, tiny_batch, tiny_data
from tests.helpers.own_world import OWN

DATA = tiny_data()
pytestmark = pytest.mark.usefixtures("own_modules")


@pytest.fixture
def own(tmp_path: Path) -> Path:
    path = tmp_path / "mine.py"
    path.write_text(OWN)
    return path


def test_ours_are_made_by_name_for_the_data() -> None:
    assert list(SENSORS) == ["perfect", "estimator"]
    for name in SENSORS:
        loaded = load_sensor(name, DATA, PAPER)
        assert (loaded.sensor.name, loaded.named, loaded.sha256) == (name, name, None)
    estimator = make_sensor("estimator", DATA)
    assert isinstance(estimator, EstimatorSensor)
    assert estimator.skeleton is SKELETON


def test_a_class_of_a_file_is_handed_what_it_asks_for_of_the_data(own: Path) -> None:
    loaded = load_sensor(f"{own}:Blurred(pixels='8')", DATA, PAPER)
    made = loaded.sensor
    assert (made.pixels, made.given) == (8.0, (1, SKELETON, 25.0, CLASS_NAMES))  # type: ignore[attr-defined]
    assert loaded.named == f"{own}:Blurred(pixels='8')"
    other = load_sensor(f"{own}:Blurred(pixels=9)", DATA, PAPER)
    assert None is not loaded.sha256 != other.sha256
    own.write_text(OWN + "# changed\n")
    assert load_sensor(f"{own}:Blurred(pixels='8')", DATA, PAPER).sha256 != loaded.sha256


def test_an_object_is_meant_as_it_is() -> None:
    mine = EstimatorSensor(skeleton=SKELETON, relative_noise=0.1)
    loaded = load_sensor(mine, DATA, PAPER)
    assert loaded.sensor is mine
    assert loaded.named == "estimator"
    assert loaded.sha256 is not None, "it may be another than the one that goes by this name"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Blind", "expected what ehar.sensors.sensor.Sensor has, missing: sense"),
        ("Unnamed", "name: expected words of letters, digits, '.', '+', '-' and '_', got 'a/b'"),
        ("Lensless", "camera: expected an ehar.camera.Camera, got str"),
        ("Blurred(pixels='many')", "pixels: expected float, got 'many'"),
        ("Blurred(size=1)", "unknown argument 'size'; it takes pixels: float = 5.0, "),
        ("Broken", "its constructor raised RuntimeError: no lens ({own}, line "),
    ],
)
def test_what_is_wrong_is_said_in_one_line(own: Path, name: str, message: str) -> None:
    with pytest.raises(UsageError) as error:
        make_sensor(f"{own}:{name}", DATA)
    assert str(error.value).startswith(f"sensor {own}:{name.partition('(')[0]}: {message.format(own=own)}")
    assert "\n" not in str(error.value)


def test_what_is_no_sensor() -> None:
    with pytest.raises(UsageError, match=r"^unknown sensor 'radar'; expected one of: perfect, estimator, or path/to/f"):
        make_sensor("radar", DATA)
    with pytest.raises(UsageError, match=r"^sensor file absent.py: no such file; expected "):
        make_sensor("absent.py:Mine", DATA)
    with pytest.raises(
        UsageError, match=r"^sensor .*: expected a sensor, got a class; make one: PerfectSensor\(...\)$"
    ):
        make_sensor(PerfectSensor, DATA)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match=r"^sensor builtins.object: expected what .*Sensor has, missing: name, camera"):
        make_sensor(object(), DATA)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Raising", r"RuntimeError: no light \({own}, line \d+\)$"),
        ("Narrow", r"expected finite confidence of shape \(6, 1, 6\), got \(6, 1, 2\)$"),
        ("Endless", r"expected finite joints_2d of shape \(6, 1, 6, 2\), got NaN or infinity$"),
        ("Whole", r"joints_2d: expected an array of floats, got an array of int64$"),
        ("Sure", r"expected confidence from 0 to 1, got 0 to 2$"),
        ("Nothing", r"expected Sensed\(joints_2d, confidence\), got NoneType$"),
    ],
)
def test_what_goes_wrong_in_a_frame_is_one_line(own: Path, name: str, message: str) -> None:
    batch, sensor = tiny_batch(), make_sensor(f"{own}:{name}", DATA)
    with (
        np.errstate(invalid="ignore"),
        pytest.raises(EpisodeError, match=f"^sensor {name}, frame 3: " + message.format(own=own)),
    ):
        sense(sensor, batch.positions[:, 3], batch.starts, batch.noise.frame(3), "frame 3")


def test_weights_are_called_after_a_sensor_in_letters_that_a_file_can_have() -> None:
    def seen(sensor: object) -> str:
        return Conditions(sensor=sensor).seen  # type: ignore[arg-type]

    assert seen("perfect") == "perfect-moving"
    assert seen("lab/mine.py:Blurred") == seen("views.mine:Blurred") == "Blurred-moving"
    with_arguments = seen("mine.py:Blurred(pixels=8, seed=1)")
    assert with_arguments == seen("mine.py:Blurred(seed='1', pixels='8')")
    assert with_arguments.startswith("Blurred-")
    assert with_arguments != seen("mine.py:Blurred(pixels=9, seed=1)")
    sensor = PerfectSensor()
    sensor.name = "blurred joints"
    assert seen(sensor) == "blurred-joints-moving"
    assert (
        Conditions(sensor="mine.py:Blurred(pixels=8)").options
        == "--data duo --sensor 'mine.py:Blurred(pixels=8)' --views moving"
    )
