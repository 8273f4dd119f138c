"""The files of a run: config.json, episodes.jsonl, summary.json, each written to a temporary name and renamed."""

import json
import os
import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from ehar.errors import UsageError
from ehar.files import json_text, write_text
from ehar.flight.vehicle import Vehicle
from ehar.planner import Planner
from ehar.plugins.class_spec import json_arguments
from eval.records.episodes import EpisodeRecords, episode_lines
from eval.scores.summary import Conditions, Summary
from planners.own_planner import Origin, planner_source_sha256

CONFIG, EPISODES, SUMMARY = "config.json", "episodes.jsonl", "summary.json"
SCHEMA = 1  # of a run's files; raised when what is written has another form or meaning
PACKAGES = ("ehar", "numpy", "torch", "casadi", "filterpy", "ruckig")  # whose versions decide numbers


@dataclass(frozen=True)
class PlannerConfig:
    """Which planner ran, and whether it was handed the truth."""

    name: str
    privileged: bool
    implementation: str  # module and class; of one's own, the class as it was named
    weights_sha256: str | None = None  # of a trained agent
    arguments: dict[str, Any] = field(default_factory=dict)  # that the constructor of one's own was given
    source_sha256: str | None = None  # of the file that one's own is defined in


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """Everything that decides a run's episodes.jsonl. The number of workers is not here, as it decides nothing.

    A field with a default may be missing in a file: a run without it is as one with the default.
    """

    schema: int = SCHEMA  # of all files of the run
    source: str  # the data as named on the command line
    data: str  # its title
    data_sha256: str
    models: str | None  # folder of the weights; None: those shipped
    recogniser_sha256: str
    sensor: str
    views: str
    form: str  # of the recogniser; of one's own, its class and arguments
    track: str  # "ideal" or the vehicle's name
    vehicle: Vehicle | None  # its limits
    readout: str  # what was scored: "recogniser" or "belief"
    part: str  # whose scenarios ran: "test", or another of ehar.data.scenario.PARTS
    gain_model_sha256: str | None  # None where neither a planner nor the readout needed one
    starts: int
    seed: int
    length: int
    fps: float | None
    ideal: str | None = None  # folder of the run that flights were compared with: decides part of summary.json
    planners: tuple[PlannerConfig, ...]
    versions: dict[str, str]
    recogniser: str | None = None  # one's own, as it was named; None: ours, which form, sensor and views name

    @property
    def conditions(self) -> Conditions:
        """What the summary says beside its numbers."""
        return Conditions(
            data=self.data,
            sensor=self.sensor,
            views=self.views,
            track=self.track,
            form=self.form,
            readout=self.readout,
            part=self.part,
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


def package_version(name: str) -> str:
    """Return the version of an installed package; a source tree that is not installed has none."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def check_out(out: Path, config: Mapping[str, Any]) -> None:
    """Refuse a folder that cannot be written to, or that holds another run than the one `config` decides.

    Raises:
        UsageError: with the path and what differs.
    """
    parent = next(path for path in (out, *out.absolute().parents) if path.exists())
    if not parent.is_dir() or not os.access(parent, os.W_OK):
        raise UsageError(f"{out}: expected a folder that can be written to, {parent} is not one")
    if not (out / CONFIG).exists():
        found = [name for name in (EPISODES, SUMMARY) if (out / name).exists()]
        if found:
            raise UsageError(f"{out}: expected a new folder, or this run's; it holds {found[0]} without {CONFIG}")
        return
    try:
        held = json.loads((out / CONFIG).read_text(encoding="utf-8"))
    except ValueError as error:
        raise UsageError(f"{out / CONFIG}: expected the JSON of a run, got {error}") from error
    wanted = json.loads(json.dumps(config))
    held = held if isinstance(held, dict) else {}
    if "schema" in wanted:
        found = held.get("schema", SCHEMA)  # a run from before schemas were numbered may be written anew
        if found != SCHEMA:
            raise UsageError(f"{out}: holds a run of schema {found!r}, expected {SCHEMA}; choose another --out")
        held = {**held, "schema": SCHEMA, "planners": _with_later_fields(held.get("planners"))}
    differing = [name for name in {**wanted, **held} if held.get(name) != wanted.get(name)]
    if differing:
        name = differing[0]
        raise UsageError(
            f"{out}: holds another run, which differs in {', '.join(differing)} "
            f"({name} was {held.get(name)!r}, now {wanted.get(name)!r}); choose another --out"
        )


def _with_later_fields(planners: Any) -> Any:
    """Return the planners of a config.json with the fields that were added since, as they are for ours."""
    if not isinstance(planners, list) or not all(isinstance(planner, dict) for planner in planners):
        return planners
    return [{"arguments": {}, "source_sha256": None, **planner} for planner in planners]


def write_run(out: Path, config: RunConfig, records: Mapping[str, EpisodeRecords], summary: Summary | None) -> None:
    """Write a run; `records` may hold more than `summary` covers where the run was interrupted."""
    out.mkdir(parents=True, exist_ok=True)
    write_text(out / CONFIG, [json_text(asdict(config))])
    write_text(out / EPISODES, episode_lines(records))
    if summary is None:
        (out / SUMMARY).unlink(missing_ok=True)
    else:
        write_text(out / SUMMARY, [json_text(summary.to_json())])
