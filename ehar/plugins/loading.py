"""Loads a user's own class from its file or module; every problem is an error of one line."""

import hashlib
import importlib
import importlib.util
import inspect
import os
import sys
import traceback
from pathlib import Path
from types import ModuleType
from typing import Any

import cloudpickle

from ehar.errors import EharError, UsageError
from ehar.plugins.beside import imported_from_beside
from ehar.plugins.class_spec import FORMS, ClassSpec


def load_class(spec: ClassSpec, what: str) -> type[Any]:
    """Run the file, or import the module, and return the class.

    A file may import modules in its folder. A module may lie in the present folder.

    Args:
        spec: a spec with a place.
        what: the kind of class that is expected, for errors: "planner".

    Raises:
        UsageError: there is no such file, module or class, or running it fails.
    """
    where = f"{what} {'file' if spec.is_file else 'module'} {spec.place}"
    module = _run_file(Path(spec.place), where) if spec.is_file else _import(spec.place, where)
    found = getattr(module, spec.name, None)
    if not inspect.isclass(found):
        own = [
            name
            for name, value in vars(module).items()
            if inspect.isclass(value) and value.__module__ == module.__name__
        ]
        raise UsageError(f"{where}: expected a class {spec.name!r}, it defines: {', '.join(own) or 'no class'}")
    return found


def source_sha256(cls: type[Any]) -> str | None:
    """Return the hash of the file that a class is defined in, and of the modules beside it that it imports.

    It is that of the file alone if it imports none; see `imported_from_beside`. None if there is no file, as in a
    notebook.
    """
    path = source_file(cls)
    if path is None:
        return None
    digest, folder = hashlib.sha256(path.read_bytes()), path.parent.resolve()
    for file in imported_from_beside(path):
        digest.update(f"\0{file.relative_to(folder).as_posix()}\0".encode() + file.read_bytes())
    return digest.hexdigest()


def source_file(cls: type[Any]) -> Path | None:
    """Return the file that a class is defined in; None if it has none."""
    try:
        found = inspect.getsourcefile(cls)
    except (TypeError, OSError):  # a built-in class, or a class of a notebook, a REPL or `python -c`
        return None
    return None if found is None or not Path(found).is_file() else Path(found)


def failure(error: BaseException, cls: type[Any] | None = None, *, path: Path | None = None) -> str:
    """Return one line about an error of a user's own code, with the last line of that code in the traceback.

    Args:
        error: the error that was caught.
        cls: a class of the user's module.
        path: the user's file, if there is no class yet.
    """
    said = " ".join(str(error).split())
    line = type(error).__name__ + (f": {said}" if said else "")
    own = [
        (frame.f_code.co_filename, number)
        for frame, number in traceback.walk_tb(error.__traceback__)
        # By the name of the module: a worker process has the class, but not its module.
        if (path is not None and Path(frame.f_code.co_filename) == path)
        or (cls is not None and frame.f_globals.get("__name__") == cls.__module__)
    ]
    own = [place for place in own if not place[0].startswith("<")]  # an annotation may be a string, without a file
    return "{} ({}, line {})".format(line, *own[-1]) if own else line


def _run_file(path: Path, where: str) -> ModuleType:
    """Run a file, once unless it changes, so that two planners of one file share its classes."""
    try:
        content = path.read_bytes()
    except OSError as error:
        reason = "no such file" if isinstance(error, FileNotFoundError) else error.strerror
        raise UsageError(f"{where}: {reason}; expected {FORMS}") from error
    path = path.resolve()
    # A name that no import uses: a user's `random.py` must not replace that of Python.
    name = f"own_{hashlib.sha256(str(path).encode() + content).hexdigest()[:16]}_{path.stem}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise UsageError(f"{where}: Python cannot load it; expected {FORMS}")
    module = importlib.util.module_from_spec(spec)
    _also_import_from(path.parent)
    sys.modules[name] = module  # dataclasses look names up there
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise UsageError(f"{where}: {_load_failure(error, path)}") from error
    cloudpickle.register_pickle_by_value(module)  # because a worker process cannot import it
    return module


def _import(name: str, where: str) -> ModuleType:
    _also_import_from(Path.cwd())
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is None or not f"{name}.".startswith(f"{error.name}."):
            raise UsageError(f"{where}: {_load_failure(error, None)}") from error
        raise UsageError(f"{where}: no module {error.name!r}; expected {FORMS}") from error
    except (Exception, SystemExit) as error:
        raise UsageError(f"{where}: {_load_failure(error, None)}") from error


def _also_import_from(folder: Path) -> None:
    """Let imports find modules in a folder, last, so that they replace no other module."""
    if os.fspath(folder) not in sys.path:
        sys.path.append(os.fspath(folder))


def _load_failure(error: BaseException, path: Path | None) -> str:
    if isinstance(error, SyntaxError):
        return f"{type(error).__name__}: {error.msg} ({error.filename}, line {error.lineno})"
    if isinstance(error, EharError):
        return str(error)
    return f"{failure(error, path=path)} while it was loaded"
