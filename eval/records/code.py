"""The code that makes a run: two runs of the same configuration may still be of different code."""

import hashlib
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from ehar.version import PACKAGES


@cache
def code_sha256() -> str:
    """Return the hash of all modules of this project, with their names, as they are when it is first asked for."""
    digest = hashlib.sha256()
    for package in PACKAGES:
        spec = find_spec(package)
        assert spec is not None and spec.origin is not None
        folder = Path(spec.origin).parent
        for path in sorted(folder.rglob("*.py")):
            digest.update(f"{package}/{path.relative_to(folder).as_posix()}\0".encode())
            digest.update(path.read_bytes() + b"\0")
    return digest.hexdigest()
