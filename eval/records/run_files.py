"""The files of a run's folder: their names, and whether a folder may be written to."""

import json
import os
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ehar.errors import UsageError
from ehar.world import PAPER
from eval.records.config import CONFIG, SCHEMA

EPISODES, SUMMARY = "episodes.jsonl", "summary.json"


def check_out(out: Path, config: Mapping[str, Any]) -> None:
    """Check that a folder can be written to, and that it holds no run with another configuration.

    Raises:
        UsageError: the folder is not usable; the message says what differs.
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
        found = held.get("schema", SCHEMA)  # a run without a schema number may be overwritten
        if found != SCHEMA:
            raise UsageError(f"{out}: holds a run of schema {found!r}, expected {SCHEMA}; choose another --out")
        later = {"world": json.loads(json.dumps(asdict(PAPER))), "device": "cpu"}
        later["trained_lengths"] = wanted.get("trained_lengths")
        held = {**later, **held, "schema": SCHEMA, "planners": _with_later_fields(held.get("planners"))}
    differing = [name for name in {**wanted, **held} if held.get(name) != wanted.get(name)]
    if differing:
        name = differing[0]
        raise UsageError(
            f"{out}: holds another run, which differs in {', '.join(differing)} "
            f"({name} was {held.get(name)!r}, now {wanted.get(name)!r}); choose another --out"
        )


def _with_later_fields(planners: Any) -> Any:
    """Return the planners of a config.json, with the defaults of fields that an older version did not write."""
    if not isinstance(planners, list) or not all(isinstance(planner, dict) for planner in planners):
        return planners
    return [{"arguments": {}, "source_sha256": None, **planner} for planner in planners]
