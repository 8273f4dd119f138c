"""Trained recognisers on disk: safetensors for the weights, JSON for their description."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from shlex import quote
from typing import Any, TypeVar

from ehar.conditions import Conditions
from ehar.data.recordings import Recordings
from ehar.errors import ModelError
from ehar.files import read_json
from ehar.world import LATER as OBSTACLES
from recognition.calibration import Temperature
from recognition.networks.causal import CausalCTRGCN
from recognition.networks.spec import Network, NetworkSpec
from recognition.streaming import PrefixRecogniser, StreamingRecogniser
from recognition.weight_files import (
    check_files,
    check_world,
    description_path,
    load_tensors,
    network_bytes,
    save_weights,
)

Told = TypeVar("Told")

SHIPPED = Path(__file__).parent / "weights"
LATER = ("fading", *OBSTACLES)  # fields that descriptions from before streams and obstacles do not have


@dataclass(frozen=True)
class RecogniserDescription:
    """The JSON beside a recogniser's weights.

    Args:
        spec: the data and size that the network was built for.
        log_temperatures: the log-temperatures of `Temperature`.
        training: how it was trained; kept for people, and for what tells one run from another.

    Raises:
        ValueError: there is not one finite temperature for each knot.
    """

    spec: NetworkSpec
    log_temperatures: tuple[float, ...]
    training: dict[str, Any]

    def __post_init__(self) -> None:
        """Check the temperatures."""
        _ = self.temperature

    @property
    def data_sha256(self) -> str | None:
        """The hash of the data that it was trained on; None if that is not recorded."""
        return self._recorded("data_sha256", str)

    @property
    def sensor_sha256(self) -> str | None:
        """The hash of the file and arguments of your own sensor in its training; None for a sensor of ehar."""
        return self._recorded("sensor_sha256", str)

    @property
    def in_the_way(self) -> bool:
        """Whether things were in the way in its training, in a world that has none."""
        return self._recorded("in_the_way", bool) or False

    def _recorded(self, key: str, kind: type[Told]) -> Told | None:
        """Return what its training recorded."""
        run = self.training.get("run")
        told = run.get(key) if isinstance(run, dict) else None
        return told if isinstance(told, kind) else None

    @property
    def temperature(self) -> Temperature:
        """The fitted temperature."""
        return Temperature(self.log_temperatures)


def recogniser_path(directory: Path, conditions: Conditions) -> Path:
    """Return the path of a recogniser's weights in a models directory; the JSON lies beside them."""
    return directory / f"{conditions.form}-{conditions.seen}.safetensors"


def save_recogniser(
    path: Path, network: Network, spec: NetworkSpec, temperature: Temperature, history: dict[str, Any]
) -> None:
    """Save weights, and beside them a description of the network and its training.

    Args:
        path: the safetensors file.
        network: the trained network.
        spec: the data and size that it was built for.
        temperature: the temperature, fitted on validation data.
        history: how it was trained; kept for people, but hashes of data and sensor and `in_the_way` are read back.
    """
    save_weights(path, network_bytes(network), RecogniserDescription(spec, temperature.log_temperatures, history))


def load_recogniser(
    conditions: Conditions, data: Recordings, *, device: str = "cpu"
) -> StreamingRecogniser | PrefixRecogniser:
    """Load a trained recogniser and check that it fits the data.

    Args:
        conditions: conditions of the training: folder, sensor, views, form and world.
        data: the data that it will be used on.
        device: a torch device.

    Raises:
        ModelError: the files are missing or malformed, or were made for other joints, classes, persons or rates, or
            in another world.
    """
    directory = conditions.directory
    if directory is None and not (data.synthetic and (SHIPPED / data.name).is_dir()):
        raise ModelError(
            f"no weights are shipped for {data.name!r}: expected --models DIR, as made by "
            f"`ehar train recogniser {conditions.options} --out DIR`"
        )
    path = recogniser_path(directory or SHIPPED / data.name, conditions)
    recogniser = open_recogniser(path, conditions, device=device)
    _check_fit(path, recogniser.spec, data)
    check_world(path, recogniser.spec.world, conditions)
    return recogniser


def open_recogniser(
    path: Path, conditions: Conditions, *, device: str = "cpu"
) -> StreamingRecogniser | PrefixRecogniser:
    """Load a trained recogniser without the data that it will be used on: its description says what it can see.

    Args:
        path: the safetensors file.
        conditions: conditions of the training: folder, sensor, views and form.
        device: a torch device.

    Raises:
        ModelError: the files are missing or malformed, or of another form.
    """
    folder = "DIR" if conditions.directory is None else quote(str(conditions.directory))
    command = f"ehar train recogniser {conditions.options} --out {folder}"
    check_files(path, f"a recogniser, as made by `{command}`" + ("" if conditions.directory else ", and --models DIR"))
    file, what = description_path(path), "a recogniser, as `ehar train recogniser` writes it"
    description = read_json(file, RecogniserDescription, what, wrong=ModelError, optional=LATER)
    spec, temperature = description.spec, description.temperature
    if spec.form != conditions.form:
        raise ModelError(f"{file}: spec.form: expected {conditions.form!r}, got {spec.form!r}")
    network = spec.build()
    load_weights(path, network)
    digest = recogniser_sha256(path, temperature)
    made: StreamingRecogniser | PrefixRecogniser
    if isinstance(network, CausalCTRGCN):
        made = StreamingRecogniser(network=network, spec=spec, temperature=temperature, sha256=digest, device=device)
    else:
        made = PrefixRecogniser(network=network, spec=spec, temperature=temperature, sha256=digest, device=device)
    made.data_sha256, made.sensor_sha256 = description.data_sha256, description.sensor_sha256
    made.in_the_way = description.in_the_way
    return made


def recogniser_sha256(path: Path, temperature: Temperature) -> str:
    """Return the hash that stands for a recogniser in records: of its weights and its temperature."""
    return hashlib.sha256(path.read_bytes() + repr(temperature.log_temperatures).encode()).hexdigest()


def load_weights(path: Path, network: Network) -> None:
    """Load weights into a network.

    Raises:
        ModelError: the file is missing or malformed, its tensors have other names or shapes, or are not finite.
    """
    network.load_state_dict(load_tensors(path, network, "a recogniser"))


def _check_fit(path: Path, spec: NetworkSpec, data: Recordings) -> None:
    """Raise a ModelError that names what differs, if weights and data disagree."""
    pairs = (
        ("class_names", spec.class_names, data.recognised_names),
        ("joint_names", spec.skeleton.joint_names, data.skeleton.joint_names),
        ("bones", spec.skeleton.bones, data.skeleton.bones),
        ("persons", spec.persons, data.persons),
    )
    for field, trained, given in pairs:
        if trained != given:
            raise ModelError(f"{path}: {field} do not fit {data.name}: trained on {trained}, the data has {given}")
    if abs(spec.fps - data.fps) > 1e-3:
        raise ModelError(
            f"{path}: fps does not fit {data.name}: trained at {spec.fps:g}, the data has {data.fps:g}; "
            f"expected --fps {spec.fps:g}"
        )
