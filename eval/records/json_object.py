"""The JSON object that a file of a run holds."""

import json
from pathlib import Path
from typing import Any

from ehar.errors import DataError, UsageError


def read_object(path: Path, expected: str) -> dict[str, Any]:
    """Read a file's one JSON object.

    Args:
        path: of the file.
        expected: what it is part of, as errors name it: "a run of ehar benchmark".

    Raises:
        UsageError: the file cannot be opened.
        DataError: it is not JSON, or not an object.
    """
    try:
        held = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"{path}: expected {expected}, got: {error.strerror}") from error
    except ValueError as error:
        raise DataError(f"{path}: expected the JSON of {expected}, got {error}") from error
    if not isinstance(held, dict):
        raise DataError(f"{path}: expected the JSON object of {expected}, got {type(held).__name__}")
    return held
