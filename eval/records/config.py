"""The configuration of a run: everything that decides its episodes.jsonl, written to config.json and read back."""

import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields, make_dataclass
from functools import cache
from pathlib import Path
from typing import Any, get_type_hints

from ehar.conditions import Conditions
from ehar.errors import DataError, UsageError
from ehar.files import read_json
from ehar.flight.vehicle import Vehicle
from ehar.planner import Planner
from ehar.plugins.class_spec import json_arguments
from ehar.version import package_version
from planners.own_planner import Origin, planner_source_sha256
from recognition.setting import Setting

CONFIG = "config.json"
SCHEMA = 1  # of a run's files; raised when what is written has another form or meaning
PACKAGES = ("ehar", "numpy", "torch", "casadi", "filterpy", "ruckig")  # whose versions decide numbers


@dataclass(frozen=True)
class PlannerConfig:
    """Which planner ran, and whether it was handed the truth."""

    name: str
    privileged: bool
    implementation: str  # module and class; of your own, the class as it was named
    weights_sha256: str | None = None  # of a trained agent
    arguments: dict[str, Any] = field(default_factory=dict)  # that the constructor of your own was given
    source_sha256: str | None = None  # of the file that your own is defined in


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """Everything that decides a run's episodes.jsonl. The number of workers is not here, as it decides nothing.

    Args:
        conditions: with names in place of objects.
        data: the title of the data.
        data_sha256: of the data.
        recogniser_sha256: of the recogniser's weights; of your own, of its file and arguments.
        form: of the recogniser; of your own, its class and arguments.
        vehicle: that carried the camera, with its limits; None on the ideal track.
        readout: what was scored, `recogniser` or `belief`.
        gain_model_sha256: None where neither a planner nor the readout needed one.
        planners: who ran.
        versions: of the packages that decide numbers.
        ideal: folder of the run that flights were compared with; it decides part of summary.json.
        schema: of all files of the run.
        sensor_sha256: of the file and arguments of a sensor of your own; None for ours.
        track_sha256: of those of a motion of your own; likewise.
    """

    conditions: Conditions
    data: str
    data_sha256: str
    recogniser_sha256: str
    form: str
    vehicle: Vehicle | None
    readout: str
    gain_model_sha256: str | None
    planners: tuple[PlannerConfig, ...]
    versions: dict[str, str]
    ideal: str | None = None
    schema: int = SCHEMA
    sensor_sha256: str | None = None
    track_sha256: str | None = None

    @property
    def title(self) -> str:
        """What a figure or a table of this run is headed with."""
        told = self.conditions
        return f"{self.data}, {told.sensor} sensor, {told.views} views, {told.track} track" + (
            ", as believed" if self.readout == "belief" else ""
        )

    def to_json(self) -> dict[str, Any]:
        """Return what config.json holds: one flat object."""
        told, own = vars(self.conditions), {name: value for name, value in asdict(self).items() if name != "conditions"}
        return {name: own[name] if name in own else told[_TOLD.get(name, name)] for name in KEYS}


_KEY_OF = {"data": "source"}  # of the conditions, where config.json has another word
_TOLD = {key: name for name, key in _KEY_OF.items()}
KEYS = (  # of config.json, in the order of the file
    *("schema", "source", "data", "data_sha256", "models", "recogniser_sha256", "sensor", "views", "form", "track"),
    *("vehicle", "readout", "part", "gain_model_sha256", "starts", "seed", "length", "fps", "ideal", "planners"),
    *("versions", "recogniser", "sensor_sha256", "track_sha256"),
)
LATER: dict[str, Any] = {  # a file without one of these means its default
    "schema": SCHEMA,
    "ideal": None,
    "recogniser": None,
    "sensor_sha256": None,
    "track_sha256": None,
}


def run_config(
    setting: Setting,
    planners: Sequence[PlannerConfig] = (),
    *,
    readout: str = "recogniser",
    gain_model_sha256: str | None = None,
    ideal: Path | None = None,
) -> RunConfig:
    """Return what decides a run in a setting; the arguments are as in `RunConfig`."""
    return RunConfig(
        conditions=setting.conditions,
        data=setting.data.title,
        data_sha256=setting.data.sha256,
        recogniser_sha256=setting.recogniser_sha256,
        form=setting.form,
        vehicle=setting.runner.track.vehicle,
        readout=readout,
        gain_model_sha256=gain_model_sha256,
        planners=tuple(planners),
        versions=installed_versions(),
        ideal=None if ideal is None else str(ideal),
        sensor_sha256=setting.sensor_sha256,
        track_sha256=setting.track_sha256,
    )


def planner_config(planner: Planner, origin: Origin | None = None) -> PlannerConfig:
    """Return what config.json says of a planner, whose origin is known if it is none of ours."""
    weights = getattr(planner, "sha256", None)
    if origin is None:
        implementation = f"{type(planner).__module__}.{type(planner).__qualname__}"
        return PlannerConfig(planner.name, planner.privileged, implementation, weights)
    return PlannerConfig(
        planner.name,
        planner.privileged,
        origin.place,
        weights,
        arguments=json_arguments(origin.arguments),
        source_sha256=planner_source_sha256(planner),
    )


def installed_versions() -> dict[str, str]:
    """Return the versions that decide numbers."""
    return {"python": platform.python_version(), **{name: package_version(name) for name in PACKAGES}}


def read_config(directory: Path) -> RunConfig:
    """Read the configuration of a run of `ehar benchmark`.

    A run from before schemas were numbered is taken as one of schema 1 where it has all of its fields: those that were
    added with the number have defaults, and mean what was meant without them.

    Raises:
        UsageError: the folder holds no such run, or one of another schema.
        DataError: config.json is not the JSON of an object, or a field is not of its type or too small.
    """
    path, expected = directory / CONFIG, "a run of ehar benchmark"
    held = read_json(path, dict[str, Any], expected)
    missing, found = [name for name in KEYS if name not in held and name not in LATER], held.get("schema")
    if missing or found not in (None, SCHEMA):
        lacking = f" and no {', '.join(missing)}" if missing else ""
        raise UsageError(
            f"{path}: got {'no schema number' if found is None else f'schema {found!r}'}{lacking}, expected "
            f"{expected} of schema {SCHEMA}; run the benchmark again with this version"
        )
    values = vars(read_json(path, _config_file(), expected, unknown=True, defaults=True))
    told = {name: values[_KEY_OF.get(name, name)] for name in Conditions.named_types()}
    told["form"] = "ctrgcn" if values["form"] == "ctrgcn" else "causal"  # the file has your own recogniser's title
    try:
        conditions = Conditions(**told)
    except UsageError as error:
        raise DataError(f"{path}: {error}") from error
    own = {part.name: values[part.name] for part in fields(RunConfig) if part.name != "conditions"}
    return RunConfig(conditions=conditions, **own)


@cache
def _config_file() -> type[Any]:
    """Return the data class of config.json, which is flat."""
    own, told = get_type_hints(RunConfig), Conditions.named_types()
    types = {key: own[key] if key in own else told[_TOLD.get(key, key)] for key in KEYS}
    return make_dataclass(
        "ConfigFile",
        [(key, types[key], field(default=LATER[key])) if key in LATER else (key, types[key]) for key in KEYS],
        kw_only=True,
    )
