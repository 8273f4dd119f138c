"""The files of a run's folder: their names, and whether a folder may be written to."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ehar.errors import UsageError
from ehar.files import check_folder
from ehar.world import PAPER
from eval.records.config import CONFIG, SCHEMA, UNFINISHED

EPISODES, SUMMARY = "episodes.jsonl", "summary.json"
TABLE = "table.md"  # the last file of a run, but for its report, or of a study: `make` takes it for done by it
BELIEF_JSON = "belief.json"  # of what a study of the belief wrote, in place of a summary


def check_out(out: Path, config: Mapping[str, Any]) -> None:
    """Check that a folder can be written to, and that it holds no run with another configuration, finished or not.

    Raises:
        UsageError: the folder is not usable; the message says what differs.
    """
    check_folder(out)
    if (out / UNFINISHED / CONFIG).exists():
        _check_same(out / UNFINISHED, config, f"remove {out / UNFINISHED}, or choose another --out")
    if (out / CONFIG).exists():
        _check_same(out, config, "choose another --out")
        return
    found = [name for name in (EPISODES, SUMMARY) if (out / name).exists()]
    if found:
        raise UsageError(f"{out}: expected a new folder, or this run's; it holds {found[0]} without {CONFIG}")


def check_no_run(out: Path) -> None:
    """Check that a folder can be written to, and that it holds no run, whose figures a study would write over.

    Raises:
        UsageError: the folder is not usable, or holds a run.
    """
    check_folder(out)
    if (out / CONFIG).exists() or (out / UNFINISHED / CONFIG).exists():
        raise UsageError(f"{out}: expected a folder without a run, this one holds the {CONFIG} of one")


def _check_same(folder: Path, config: Mapping[str, Any], remedy: str) -> None:
    """Raise a UsageError if the config.json of a folder is not this configuration."""
    try:
        held = json.loads((folder / CONFIG).read_text(encoding="utf-8"))
    except ValueError as error:
        raise UsageError(f"{folder / CONFIG}: expected the JSON of a run, got {error}") from error
    wanted = json.loads(json.dumps(config))
    held = held if isinstance(held, dict) else {}
    if "schema" in wanted:
        found = held.get("schema", SCHEMA)  # a run without a schema number may be overwritten
        if found != SCHEMA:
            raise UsageError(f"{folder}: holds a run of schema {found!r}, expected {SCHEMA}; {remedy}")
        later = {"world": json.loads(json.dumps(PAPER.to_json())), "device": "cpu"}
        later["trained_lengths"] = wanted.get("trained_lengths")
        held = {**later, **held, "schema": SCHEMA, "planners": _with_later_fields(held.get("planners"))}
    held, wanted = _of_any_code(held), _of_any_code(wanted)
    differing = [name for name in {**wanted, **held} if held.get(name) != wanted.get(name)]
    if differing:
        place, was, now = _first_difference(differing[0], held.get(differing[0]), wanted.get(differing[0]))
        raise UsageError(
            f"{folder}: holds another run, which differs in {', '.join(differing)} ({place} was {was!r}, now {now!r}); "
            f"{remedy}"
        )


def _of_any_code(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration without the version of ehar: other code makes the same run, and makes it anew."""
    versions = config.get("versions")
    if not isinstance(versions, dict):
        return dict(config)
    return {**config, "versions": {name: told for name, told in versions.items() if name != "ehar"}}


def _first_difference(place: str, was: Any, now: Any) -> tuple[str, Any, Any]:
    """Return the place inside two values where they first differ, and both values there."""
    if isinstance(was, dict) and isinstance(now, dict) and was.keys() == now.keys():
        inner = [(f"{place}.{key}", was[key], now[key]) for key in was if was[key] != now[key]]
    elif isinstance(was, list) and isinstance(now, list) and len(was) == len(now):
        inner = [
            (f"{place}[{i}]", one, other) for i, (one, other) in enumerate(zip(was, now, strict=True)) if one != other
        ]
    else:
        return place, was, now
    return _first_difference(*inner[0])


def _with_later_fields(planners: Any) -> Any:
    """Return the planners of a config.json, with the defaults of fields that an older version did not write."""
    if not isinstance(planners, list) or not all(isinstance(planner, dict) for planner in planners):
        return planners
    return [{"arguments": {}, "source_sha256": None, **planner} for planner in planners]
