"""Trained recognisers on disk: safetensors for the weights, JSON for what they were built and trained for."""

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any, get_args

from safetensors import SafetensorError
from safetensors.torch import load_file, save
from torch import Tensor

from ehar.conditions import Form
from ehar.data.motion_data import MotionData
from ehar.data.skeleton import Skeleton
from ehar.errors import ModelError
from ehar.files import write_bytes
from recognition.calibration import Temperature
from recognition.networks.causal import CausalCTRGCN
from recognition.networks.spec import Network, NetworkSpec
from recognition.streaming import PrefixRecogniser, StreamingRecogniser
from recognition.training.config import Size

SHIPPED = Path(__file__).parent / "weights"


def recogniser_path(directory: Path, *, form: Form, sensor: str, views: str) -> Path:
    """Return where a recogniser's weights lie in a models directory; the JSON lies beside them."""
    return directory / f"{form}-{sensor}-{views}.safetensors"


def save_recogniser(
    path: Path, network: Network, spec: NetworkSpec, temperature: Temperature, history: dict[str, Any]
) -> None:
    """Save weights, and beside them what they are for and how they came about.

    Args:
        path: of the safetensors file.
        network: trained.
        spec: what it was built for.
        temperature: fitted on validation data.
        history: how it was trained; kept for people, not read back.
    """
    state = {name: tensor.detach().cpu().contiguous() for name, tensor in network.state_dict().items()}
    description = {"spec": asdict(spec), "log_temperatures": temperature.log_temperatures, "training": history}
    write_bytes(path, save(state))
    write_bytes(path.with_suffix(".json"), (json.dumps(description, indent=1) + "\n").encode())


def load_recogniser(
    directory: Path | None,
    data: MotionData,
    *,
    sensor: str,
    views: str,
    form: Form = "causal",
    device: str = "cpu",
) -> StreamingRecogniser | PrefixRecogniser:
    """Load a trained recogniser and check that it fits the data.

    Args:
        directory: of models; None means the weights shipped for a synthetic set.
        data: what it will be used on.
        sensor: the sensor that it was trained with.
        views: the regime that it was trained with.
        form: "causal" streams, "ctrgcn" is the published network on each prefix.
        device: a torch device.

    Raises:
        ModelError: the files are missing or malformed, or were made for other joints, classes, persons or rates.
    """
    if directory is None and not (data.synthetic and (SHIPPED / data.name).is_dir()):
        raise ModelError(
            f"no weights are shipped for {data.name!r}: expected --models DIR, as made by "
            f"`ehar train recogniser --data X.npz --out DIR`"
        )
    path = recogniser_path(directory or SHIPPED / data.name, form=form, sensor=sensor, views=views)
    for file in (path, path.with_suffix(".json")):
        if not file.is_file():
            raise ModelError(
                f"{file}: no such file: expected a recogniser trained with "
                f"--sensor {sensor} --views {views} --form {form}"
            )
    spec, temperature = _read_description(path.with_suffix(".json"))
    if spec.form != form:
        raise ModelError(f"{path.with_suffix('.json')}: spec.form: expected {form!r}, got {spec.form!r}")
    _check_fit(path, spec, data)
    network = spec.build()
    load_weights(path, network)
    digest = hashlib.sha256(path.read_bytes() + repr(temperature.log_temperatures).encode()).hexdigest()
    if isinstance(network, CausalCTRGCN):
        return StreamingRecogniser(network=network, spec=spec, temperature=temperature, sha256=digest, device=device)
    return PrefixRecogniser(network=network, spec=spec, temperature=temperature, sha256=digest, device=device)


def _read_description(path: Path) -> tuple[NetworkSpec, Temperature]:
    """Read the JSON beside the weights."""
    try:
        description = json.loads(path.read_text())
        fields = description["spec"]
        skeleton = fields["skeleton"]
        spec = NetworkSpec(
            form=fields["form"],
            size=fields["size"],
            class_names=tuple(fields["class_names"]),
            skeleton=Skeleton(tuple(skeleton["joint_names"]), tuple((int(a), int(b)) for a, b in skeleton["bones"])),
            persons=int(fields["persons"]),
            fps=float(fields["fps"]),
            length=int(fields["length"]),
        )
        for field, known in (("form", get_args(Form)), ("size", get_args(Size))):
            if fields[field] not in known:
                raise ValueError(f"{field}: expected one of {', '.join(known)}, got {fields[field]!r}")
        if spec.length < 1:
            raise ValueError(f"length: expected at least 1 frame, got {spec.length}")
        temperature = Temperature(tuple(float(value) for value in description["log_temperatures"]))
    except (ValueError, KeyError, TypeError, OverflowError, OSError) as error:
        raise ModelError(f"{path}: expected the JSON that `ehar train recogniser` writes, got {error!r}") from error
    return spec, temperature


def load_weights(path: Path, network: Network) -> None:
    """Load weights into a network.

    Raises:
        ModelError: the file is missing or malformed, its tensors have other names or shapes, or are not finite.
    """
    try:
        state: dict[str, Tensor] = load_file(path)
    except (SafetensorError, OSError) as error:
        raise ModelError(f"{path}: expected a safetensors file, got {error}") from error
    wanted = network.state_dict()
    wrong = sorted(
        name
        for name in wanted.keys() | state.keys()
        if name not in state or name not in wanted or state[name].shape != wanted[name].shape
    )
    if wrong:
        raise ModelError(f"{path}: {len(wrong)} tensors do not fit the network that is expected, first {wrong[0]!r}")
    for name, tensor in state.items():
        if not tensor.isfinite().all():
            raise ModelError(f"{path}: tensor {name!r} is not finite everywhere")
    network.load_state_dict(state)


def _check_fit(path: Path, spec: NetworkSpec, data: MotionData) -> None:
    """Raise where weights and data disagree, naming what differs."""
    pairs = (
        ("class_names", spec.class_names, data.class_names),
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
