"""What lies beside the shipped weights is read whole: written again, it is the same text, so that hashes stay."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from ehar.files import read_json
from planners.value.model import SHIPPED, GainDescription
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
    assert len(paths) == 4  # duo and solo, with exact joints and through the estimator
    for path in paths:
        text = path.read_text(encoding="utf-8")
        written = asdict(read_json(path, kind, "a description"))
        assert json.dumps(written, indent=1) + "\n" == text, path
