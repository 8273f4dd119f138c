"""The configuration of a run: everything that decides its episodes.jsonl, written to config.json and read back."""

import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, make_dataclass, replace
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, get_type_hints

from ehar.conditions import Conditions
from ehar.errors import DataError, UsageError
from ehar.files import read_json, shortened
from ehar.flight.vehicle import Vehicle
from ehar.localisation import Localisation
from ehar.planner import Planner
from ehar.plugins.class_spec import json_arguments
from ehar.version import package_version
from ehar.world import PAPER, World, by_name, load_world
from eval.records.code import code_sha256
from planners.own_planner import Origin, planner_source_sha256
from recognition.setting import ELSEWHERE, OTHER_SENSOR, Setting, length_note, localisation_note

CONFIG = "config.json"
UNFINISHED = "unfinished"  # folder in that of a run: what is done while the run is not finished
SCHEMA = 2  # of the files of a run; raised when their form or meaning changes
PACKAGES = ("ehar", "numpy", "torch", "casadi", "filterpy", "ruckig")  # their versions decide numbers


@dataclass(frozen=True)
class PlannerConfig:
    """The configuration of a planner that ran."""

    name: str
    privileged: bool
    implementation: str  # module and class; for your own planner, the class as it was given
    weights_sha256: str | None = None  # of a trained agent, or of a fitted place
    arguments: dict[str, Any] = field(default_factory=dict)  # constructor arguments of your own planner
    source_sha256: str | None = None  # of your own planner's file, and of what it imports from beside it


@dataclass(frozen=True)
class FoldConfig:
    """One of the runs that a run of folds was made of."""

    run: str  # its folder
    source: str  # of its data
    data_sha256: str
    episodes: int  # of each of its planners, which come one fold after the other


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """Everything that decides a run's episodes.jsonl. The number of workers is left out, because it decides nothing.

    Args:
        conditions: the conditions, with names in place of objects; a world that is not ehar's stays.
        data: title of the data.
        data_sha256: hash of the data.
        recogniser_sha256: hash of the recogniser's weights; for your own recogniser, of its file and arguments.
        form: form of the recogniser; for your own, its class and arguments.
        vehicle: the vehicle that carried the camera, with its limits; None on the ideal track.
        readout: the probabilities that were scored, `recogniser` or `belief`.
        gain_model_sha256: hash of the gain model; None if neither a planner nor the readout needed one.
        planners: the planners that ran.
        versions: versions of the packages that decide numbers.
        ideal: folder of the run that flights were compared with; it decides part of summary.json.
        schema: schema number of all files of the run.
        sensor_sha256: hash of the file and arguments of your own sensor; None for a sensor of ehar.
        track_sha256: hash of the file and arguments of your own motion; None for a track of ehar.
        trained_lengths: number of frames of an episode in the training of the recogniser, the gain field, each
            agent and a fixed place, as far as they are known; None in runs from before it was recorded.
        device: torch device of the recogniser; another one rounds otherwise.
        trained_open: whether the world has something in the way, and the training of the recogniser had nothing.
        trained_localisations: in streams, the localisation in the training of the recogniser, the gain field, each
            agent and a fixed place, of those that were trained with another than the world's; None if none was.
        trained_elsewhere: whether the recogniser was trained on other data, or on another version or fold of them.
        sensor_changed: whether the recogniser was trained with another version of your own sensor.
        folds: the runs that this one was made of, whose hashes are then hashed together; empty for a run of its own.
        trainings: folders of the runs of several trainings that this one was made of, likewise.
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
    trained_lengths: dict[str, int] | None = None
    device: str = "cpu"
    trained_open: bool = False
    trained_localisations: dict[str, Localisation] | None = None
    trained_elsewhere: bool = False
    sensor_changed: bool = False
    folds: tuple[FoldConfig, ...] = ()
    trainings: tuple[str, ...] = ()

    @property
    def made_of(self) -> tuple[str, ...]:
        """The folders of the runs that this one was made of; empty for a run of its own."""
        return self.trainings or tuple(fold.run for fold in self.folds)

    @property
    def parts(self) -> str:
        """How many folds or trainings this run was made of, for people."""
        return f"{len(self.made_of)} {'trainings' if self.trainings else 'folds'}"

    @property
    def data_hashes(self) -> tuple[str, ...]:
        """The hashes of the data that episodes are from: of a run of folds one for each."""
        return tuple(fold.data_sha256 for fold in self.folds) or (self.data_sha256,)

    @property
    def world(self) -> World:
        """The world of the run."""
        return load_world(self.conditions.world)

    @property
    def length_note(self) -> str | None:
        """The line that names the weights that were trained at another length; None if there are none."""
        return length_note(self.conditions.frames, self.trained_lengths or {})

    @property
    def warnings(self) -> tuple[str, ...]:
        """The lines that a reader of results must not miss."""
        opened = f"the recogniser was trained where nothing is in the way; in the world {self.world.name} something is"
        localised = localisation_note(self.world.localisation, self.trained_localisations or {})
        told = {opened: self.trained_open, ELSEWHERE: self.trained_elsewhere, OTHER_SENSOR: self.sensor_changed}
        return (*filter(None, (self.length_note, localised)), *(line for line, holds in told.items() if holds))

    @property
    def in_world(self) -> str:
        """The world in titles, with a comma before it, and whose joints are whose if that is not known.

        Nothing for the paper's.
        """
        tracked = "" if self.world.identity == "known" else f", identity {self.world.identity}"
        return "" if self.world == PAPER else f", world {self.world.name}{tracked}"

    @property
    def told_onset(self) -> str:
        """What titles say of onsets that the recogniser is told, with a comma before it; nothing where it is not."""
        return ", onset known" if self.conditions.onset == "known" else ""

    @property
    def title(self) -> str:
        """The title of this run's figures and tables."""
        told = self.conditions
        seen = f"{self.data}, {told.sensor} sensor, {told.views} views, {told.track} track{self.in_world}"
        return f"{seen}{self.told_onset}" + (", as believed" if self.readout == "belief" else "")

    def to_json(self) -> dict[str, Any]:
        """Return the content of config.json: one flat object."""
        told = vars(self.conditions) | {"world": self.world.to_json()}
        own = {name: value for name, value in asdict(self).items() if name != "conditions"}
        held = {name: own[name] if name in own else told[_TOLD.get(name, name)] for name in KEYS}
        for name in NEW:
            if held[name] == LATER[name]:
                del held[name]  # as in files from before there was another
        return held


_KEY_OF = {"data": "source"}  # conditions that have another name in config.json
_TOLD = {key: name for name, key in _KEY_OF.items()}
KEYS = (  # of config.json, in the order of the file
    *("schema", "source", "data", "data_sha256", "models", "recogniser_sha256", "sensor", "views", "form", "track"),
    *("vehicle", "readout", "part", "gain_model_sha256", "starts", "seed", "length", "fps", "ideal", "planners"),
    *("versions", "recogniser", "sensor_sha256", "track_sha256", "world", "trained_lengths", "device", "onset"),
    *("trained_open", "trained_localisations", "trained_elsewhere", "sensor_changed", "folds", "trainings"),
)
LATER: dict[str, Any] = {  # a file without one of these means its default
    "schema": SCHEMA,
    "ideal": None,
    "recogniser": None,
    "sensor_sha256": None,
    "track_sha256": None,
    "world": PAPER,
    "trained_lengths": None,
    "device": "cpu",
    "onset": "unknown",
    "trained_open": False,
    "trained_localisations": None,
    "trained_elsewhere": False,
    "sensor_changed": False,
    "folds": (),
    "trainings": (),
}
NEW = (
    "onset",
    "trained_open",
    "trained_localisations",
    "trained_elsewhere",
    "sensor_changed",
    "folds",
    "trainings",
)  # keys that a file has only where they say something else


def hashed_together(hashes: Sequence[str | None]) -> str | None:
    """Return one hash of what several runs have; None if some have none."""
    held = [one for one in hashes if one is not None]
    return sha256("".join(held).encode()).hexdigest() if len(held) == len(hashes) else None


def joined_config(configs: Sequence[RunConfig], **changes: Any) -> RunConfig:
    """Return the configuration of runs that are made one: the first one's, with the hashes and warnings of all.

    Args:
        configs: configurations of the runs, which have the same conditions.
        changes: what else the run that they make has of its own.
    """
    first = configs[0]
    lengths = [config.trained_lengths for config in configs]
    known = all(held is not None for held in lengths)
    localised = {name: told for config in configs for name, told in (config.trained_localisations or {}).items()}
    return replace(
        first,
        recogniser_sha256=hashed_together([config.recogniser_sha256 for config in configs]) or "",
        gain_model_sha256=hashed_together([config.gain_model_sha256 for config in configs]),
        trained_lengths=_first_other(first.conditions.frames, lengths) if known else None,
        trained_open=any(config.trained_open for config in configs),
        trained_localisations=localised or None,
        trained_elsewhere=any(config.trained_elsewhere for config in configs),
        sensor_changed=any(config.sensor_changed for config in configs),
        **changes,
    )


def _first_other(frames: int, lengths: Sequence[Mapping[str, int] | None]) -> dict[str, int]:
    """Return the length that each thing was trained with in several runs: the first that is not theirs, if one is."""
    joined: dict[str, int] = {}
    for held in lengths:
        for name, length in (held or {}).items():
            if joined.get(name) in (None, frames):
                joined[name] = length
    return joined


def run_config(
    setting: Setting,
    planners: Sequence[PlannerConfig] = (),
    *,
    readout: str = "recogniser",
    gain_model_sha256: str | None = None,
    ideal: Path | None = None,
    lengths: Mapping[str, int | None] | None = None,
    localisations: Mapping[str, Localisation | None] | None = None,
) -> RunConfig:
    """Return the configuration of a run in a setting; the arguments are as in `RunConfig`.

    `lengths` and `localisations` are those in the training of gain field, agents and fixed place.
    """
    localised = {"recogniser": setting.trained_localisation, **(localisations or {})}
    usual = setting.world.localisation
    others = {name: told for name, told in localised.items() if told is not None and told != usual}
    trained = {"recogniser": setting.trained_length, **(lengths or {})}
    return RunConfig(
        conditions=setting.conditions,
        data=setting.recordings.title,
        data_sha256=setting.recordings.sha256,
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
        trained_lengths={name: frames for name, frames in trained.items() if frames is not None},
        device=setting.device,
        trained_open=setting.trained_open,
        trained_localisations=others or None,
        trained_elsewhere=setting.trained_elsewhere,
        sensor_changed=setting.sensor_changed,
    )


def planner_config(planner: Planner, origin: Origin | None = None) -> PlannerConfig:
    """Return a planner's entry in config.json; `origin` is None for ehar's planners.

    Files that arguments of your own planner name are weights, unless it has a hash of its own.
    """
    weights = getattr(planner, "sha256", None)
    if origin is None:
        implementation = f"{type(planner).__module__}.{type(planner).__qualname__}"
        return PlannerConfig(planner.name, planner.privileged, implementation, weights)
    files = [value for value in origin.arguments.values() if isinstance(value, Path) and value.is_file()]
    if weights is None and files:  # what they hold decides what the planner does
        weights = sha256(b"".join(file.read_bytes() for file in files)).hexdigest()
    return PlannerConfig(
        planner.name,
        planner.privileged,
        origin.place,
        weights,
        arguments=json_arguments(origin.arguments),
        source_sha256=planner_source_sha256(planner),
    )


def installed_versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that decide numbers; ehar's ends in the hash of its code."""
    versions = {"python": platform.python_version(), **{name: package_version(name) for name in PACKAGES}}
    return versions | {"ehar": f"{versions['ehar']}+{shortened(code_sha256())}"}


def read_config(directory: Path) -> RunConfig:
    """Read the configuration of a run of `ehar benchmark`.

    Raises:
        UsageError: the folder holds no such run, one of another schema, or one that was stopped.
        DataError: config.json is not the JSON of an object, or a field is not of its type or too small.
    """
    path, expected = directory / CONFIG, "a run of ehar benchmark"
    if not path.exists() and (directory / UNFINISHED).is_dir():
        raise UsageError(
            f"{directory}: expected a finished run, this one was stopped; the command that began it goes on with it"
        )
    held = read_json(path, dict[str, Any], expected)
    missing, found = [name for name in KEYS if name not in held and name not in LATER], held.get("schema")
    if missing or found != SCHEMA:
        lacking = f" and no {', '.join(missing)}" if missing else ""
        raise UsageError(
            f"{path}: got {'no schema number' if found is None else f'schema {found!r}'}{lacking}, expected "
            f"{expected} of schema {SCHEMA}; run the benchmark again with this version"
        )
    values = vars(read_json(path, _config_file(), expected, unknown=True, defaults=True))
    told = {name: values[_KEY_OF.get(name, name)] for name in Conditions.named_types()}
    told["world"] = by_name(values["world"])
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
    own, told = get_type_hints(RunConfig), Conditions.named_types() | {"world": World, "length": int}
    types = {key: own[key] if key in own else told[_TOLD.get(key, key)] for key in KEYS}
    return make_dataclass(
        "ConfigFile",
        [(key, types[key], field(default=LATER[key])) if key in LATER else (key, types[key]) for key in KEYS],
        kw_only=True,
    )
