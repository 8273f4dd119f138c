"""Checks that finished runs have the same episodes and planners, for studies that put runs side by side."""

from collections.abc import Mapping, Sequence
from typing import Any

from ehar.errors import DataError, UsageError
from ehar.files import shortened
from ehar.flight.vehicle import LIMITS
from eval.records.config import CONFIG, LATER
from eval.records.same_planners import other_planner
from eval.running.run import Run

SAME_EPISODES = (
    "data_sha256",
    "part",
    "starts",
    "seed",
    "length",
    "fps",
    "sensor",
    "sensor_sha256",
    "world",
)  # they decide the episodes; of the world all but its name and what is known of people
LOCALISATION, IDENTITY = "localisation", "identity"  # of the world: where people are, and whose joints are whose
VEHICLE = "vehicle"  # of one name, with other limits
# For studies of runs that differ in their weights alone.
SAME_CONDITIONS = ("views", "form", "readout", "track", "track_sha256", VEHICLE, LOCALISATION, IDENTITY)


def check_same_episodes(a: Run, b: Run, *, also: Sequence[str] = ()) -> None:
    """Check that two runs have the same episodes.

    Args:
        a: a run.
        b: another run.
        also: further keys of config.json whose values have to be the same, or `LOCALISATION` and `IDENTITY`.

    Raises:
        UsageError: their configurations differ; the message names what differs, with both values.
        DataError: their episodes differ although their configurations do not.
    """
    check_same_config(a, b, (*SAME_EPISODES, *also))
    where = f"{a.directory} and {b.directory}"
    of_a, of_b = (next(iter(one.records.values())) for one in (a, b))
    if not of_a.same_episodes(of_b):
        raise DataError(
            f"{where}: expected the same episodes, as their {CONFIG} say, got {len(of_a)} and {len(of_b)} that differ "
            "in sequence, first frame, start, label or people"
        )


def check_same_config(a: Run, b: Run, keys: Sequence[str], *, expected: str = "runs of the same episodes") -> None:
    """Check that two runs have the same values of some keys of config.json, or the same `LOCALISATION` and `IDENTITY`.

    Args:
        a: a run.
        b: another run.
        keys: the keys.
        expected: what they have to be, for people.

    Raises:
        UsageError: their configurations differ; the message names what differs, with both values.
    """
    in_a, in_b = ({**LATER, **run.config.to_json()} for run in (a, b))
    differing = [name for name in keys if _decisive(name, in_a) != _decisive(name, in_b)]
    if differing:
        got = ", ".join(f"{label(name)} ({shown(name, in_a)}, {shown(name, in_b)})" for name in differing)
        raise UsageError(f"{a.directory} and {b.directory}: expected {expected}; they differ in {got}")


def check_same_planners(runs: Sequence[Run]) -> None:
    """Check that the planners that ran in all runs are the same, but for weights of their own.

    Raises:
        UsageError: a planner has another file or other arguments in one of them.
    """
    first, *others = runs
    everywhere = set.intersection(*({planner.name for planner in run.config.planners} for run in runs))
    shared = [planner for planner in first.config.planners if planner.name in everywhere]
    for run in others:
        difference = other_planner(shared, run.config.planners, retrained=True)
        if difference is not None:
            raise UsageError(f"{first.directory} and {run.directory}: expected the same planners; {difference}")


def versions_note(runs: Sequence[Run]) -> str | None:
    """Return a line that names the versions that differ between runs; None if all are the same."""
    versions = [run.config.versions for run in runs]
    found = {
        package: dict.fromkeys(one.get(package, "none") for one in versions)
        for package in dict.fromkeys(package for one in versions for package in one)
    }
    differing = [f"{package} {' and '.join(values)}" for package, values in found.items() if len(values) > 1]
    return f"Versions differ between the runs: {'; '.join(differing)}." if differing else None


def _decisive(name: str, config: Mapping[str, Any]) -> Any:
    """Return what of a key of config.json decides the episodes.

    However well it is known where and who people are, they are the same people, seen from the same starts.
    """
    if name in (LOCALISATION, IDENTITY):
        return config["world"].get(name)
    if name == VEHICLE:
        return _limits(config)
    if name != "world":
        return config[name]
    return {key: value for key, value in config["world"].items() if key not in ("name", LOCALISATION, IDENTITY)}


def _limits(config: Mapping[str, Any]) -> dict[str, float] | None:
    """Return the limits of a run's vehicle; None on the ideal track."""
    vehicle = config.get(VEHICLE)
    return None if vehicle is None else {limit: vehicle[limit] for limit in LIMITS}


def label(name: str) -> str:
    """Return a key of config.json for people."""
    return name.removesuffix("_sha256")


def shown(name: str, config: Mapping[str, Any]) -> str:
    """Return a value of config.json for people: a hash is cut short, and the hash of the data follows its name."""
    if name == "world":
        return str(config["world"]["name"])
    if name == LOCALISATION:
        held = config["world"].get(name)
        return "usual" if held is None else ", ".join(f"{key} {value:g}" for key, value in held.items())
    if name == IDENTITY:
        return str(config["world"].get(name, "known"))
    if name == VEHICLE:
        held = _limits(config)
        return "none" if held is None else ", ".join(f"{key} {value:g}" for key, value in held.items())
    value = config.get(name, LATER.get(name))
    text = shortened(str(value)) if name.endswith("_sha256") else str(value)
    return f"{config.get('data')} {text}" if name == "data_sha256" else text
