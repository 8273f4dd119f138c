"""What lies beside the shipped weights is read whole: written again, it is the same text but for what came later."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from ehar.files import read_json
from planners.shipped import SHIPPED
from planners.value.model import LATER, GainDescription
from recognition.storage import SHIPPED as RECOGNISERS
from recognition.storage import RecogniserDescription


@pytest.mark.parametrize(
    ("folder", "pattern", "kind"),
    [
        (RECOGNISERS, "*/*.json", RecogniserDescription),
        (SHIPPED, "*/gain-field-*.json", GainDescription),
    ],
)
def test_what_is_read_is_written_as_it_was(folder: Path, pattern: str, kind: Any) -> None:
    paths = sorted(folder.glob(pattern))
    assert len(paths) == 6  # duo and solo, with exact joints and through the estimator; their streams through it
    for path in paths:
        text = path.read_text(encoding="utf-8")
        written = asdict(read_json(path, kind, "a description", optional=LATER))
        assert json.dumps(without_later(written, json.loads(text)), indent=1) + "\n" == text, path


def without_later(written: Any, held: Any) -> Any:
    """Return what was written without the keys of objects that `held`, which is older, does not have."""
    if isinstance(written, dict) and isinstance(held, dict):
        return {key: without_later(value, held[key]) for key, value in written.items() if key in held}
    return written
