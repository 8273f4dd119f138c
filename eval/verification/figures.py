"""The figures of summary.json, computed again from the records and compared value by value."""

import json
import math
from collections.abc import Mapping
from typing import Any

from ehar.files import json_text
from eval.records.config import RunConfig
from eval.records.episodes import EpisodeRecords
from eval.records.run_files import SUMMARY
from eval.scores.resampling.training_seeds import split_record_name
from eval.scores.summarise import summarise

UNRECORDED = (
    "step_ms",
    "solves",
    "fallback_share",
)  # figures of a planner that are not in the records: timings and plans
NOISE = 1e-9  # relative and absolute: the last digits of a sum depend on its order


def recompute(
    config: RunConfig,
    records: Mapping[str, EpisodeRecords],
    held: Any,
    on_ideal: Mapping[str, EpisodeRecords] | None,
) -> Any:
    """Return the content that summary.json should have.

    Args:
        config: configuration of the run.
        records: records of its planners.
        held: the content of summary.json; timings are taken from it.
        on_ideal: records of the run that flights were compared with.

    Raises:
        DataError: the records give no summary.
    """
    step_ms = _step_ms(held)
    summary = summarise(
        records,
        config,
        privileged={planner.name: planner.privileged for planner in config.planners},
        step_ms={name: step_ms.get(split_record_name(name)[0], 0.0) for name in records},
        on_ideal=on_ideal,
    )
    return json.loads(json_text(summary.to_json()))


def _step_ms(held: Any) -> dict[str, float]:
    """Return the timing of each planner in a summary; entries that are no number are left out."""
    planners = held.get("planners") if isinstance(held, dict) else None
    found = {}
    for planner in planners if isinstance(planners, list) else ():
        if isinstance(planner, dict) and _is_number(planner.get("step_ms")):
            found[str(planner.get("name"))] = float(planner["step_ms"])
    return found


def mismatch(got: Any, expected: Any, where: str = SUMMARY) -> str | None:
    """Return where two values of parsed JSON first differ, and how; None if they are the same.

    Numbers are the same if they differ by at most `NOISE`. `UNRECORDED` values are not compared.
    """
    if isinstance(expected, dict) and isinstance(got, dict):
        for name in {**expected, **got}:
            if name not in got or name not in expected:
                there = "nothing" if name not in got else _short(got[name])
                return f"{where}: {name}: got {there}, expected {_short(expected.get(name, 'nothing'))}"
            if name not in UNRECORDED:
                found = mismatch(got[name], expected[name], f"{where}: {name}")
                if found is not None:
                    return found
        return None
    if isinstance(expected, list) and isinstance(got, list) and len(got) == len(expected):
        pairs = enumerate(zip(got, expected, strict=True))
        return next(
            filter(None, (mismatch(one, other, _item(where, index, other)) for index, (one, other) in pairs)), None
        )
    if _is_number(got) and _is_number(expected):
        same = math.isclose(got, expected, rel_tol=NOISE, abs_tol=NOISE)
    else:
        same = type(got) is type(expected) and got == expected
    return None if same else f"{where}: got {_short(got)}, expected {_short(expected)}"


def count_figures(value: Any) -> int:
    """Return how many numbers are compared."""
    if isinstance(value, dict):
        return sum(count_figures(item) for name, item in value.items() if name not in UNRECORDED)
    return sum(map(count_figures, value)) if isinstance(value, list) else int(_is_number(value))


def _item(where: str, index: int, item: Any) -> str:
    """Return the place of an item of a list: its name if it has one, otherwise its index."""
    name = item.get("name") if isinstance(item, dict) else None
    return f"{where}: {name}" if name else f"{where}[{index}]"


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
