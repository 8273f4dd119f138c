"""Machine code of a problem's functions: made once, in the background, where there is a C compiler, and kept.

CasADi interprets a formula, some 5 ns for each operation. Compiled, second derivatives among obstacles take a sixteenth
of the time. Results stay the same bit by bit, because the compiler may neither reorder nor contract operations. So it
does not matter to a plan from when on there is machine code, and on machines without a compiler there is none.
"""

import fcntl
import hashlib
import os
import platform
import shutil
import stat
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import casadi as ca
from platformdirs import user_cache_path

COMPILER = "cc"
FLAGS = ("-O1", "-ffp-contract=off", "-fPIC", "-shared")  # -O2 takes twice as long to compile, and is as fast
KEPT = 90 * 24 * 3600  # [s] that code is kept after its last use
COMPILE = 'nice "$@" -o "$0.tmp" "$0.c" -lm && mv "$0.tmp" "$0.so"; rm -f "$0.c" "$0.tmp"'  # a shell's command


def has_compiler() -> bool:
    """Return whether there is a C compiler."""
    return shutil.which(COMPILER) is not None


class MachineCode:
    """The machine code of some functions, in the cache of this machine's user."""

    def __init__(self, functions: Sequence[Any]) -> None:
        """Find out where that of CasADi functions is kept; each has a name of its own."""
        self._functions = functions
        machine = platform.machine(), *platform.libc_ver()
        text = [ca.CasadiMeta.version(), *machine, COMPILER, *FLAGS, *(f.serialize() for f in functions)]
        self._library = user_cache_path("ehar") / f"{hashlib.sha256(''.join(text).encode()).hexdigest()[:32]}.so"
        self._making: subprocess.Popen[bytes] | None = None

    def load(self) -> dict[str, Any] | None:
        """Return the compiled functions by their names, or None while there are none that can be loaded."""
        try:
            if not self._library.is_file() or not _is_ours(self._library.parent):
                return None
            os.utime(self._library)
            return {function.name(): ca.external(function.name(), str(self._library)) for function in self._functions}
        except (OSError, RuntimeError):  # a damaged file, or a folder from which nothing may run
            return None

    def make(self, *, wait: bool = False) -> None:
        """Begin to compile, unless another process does already, or code can't be kept.

        Args:
            wait: whether to return when it is done.
        """
        try:
            folder = self._library.parent
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not _is_ours(folder):
                return
            _forget(folder)
            lock = os.open(self._library.with_suffix(".lock"), os.O_CREAT | os.O_RDWR, 0o644)
        except OSError:
            return
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
            if not self._library.is_file():
                self._compile(lock)
                if wait and self._making is not None:
                    self._making.wait()
        except OSError:
            pass  # another process compiles, or the folder is full
        finally:
            os.close(lock)  # the shell holds it on until it ends

    def _compile(self, lock: int) -> None:
        """Write the functions down in C, and start a shell that compiles them, and outlives this process."""
        generator = ca.CodeGenerator("functions")
        for function in self._functions:
            generator.add(function)
        self._library.with_suffix(".c").write_text(generator.dump())
        command = ["sh", "-c", COMPILE, str(self._library.with_suffix("")), COMPILER, *FLAGS]
        quiet = subprocess.DEVNULL
        self._making = subprocess.Popen(command, pass_fds=[lock], stdout=quiet, stderr=quiet, start_new_session=True)


def _is_ours(folder: Path) -> bool:
    """Return whether nobody but this user may write into a folder: who does runs code as this user."""
    found = folder.stat()
    return found.st_uid == os.getuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _forget(folder: Path) -> None:
    """Remove code that nobody has used for long: that of another version is never asked for again."""
    for library in folder.glob("*.so"):
        if time.time() - library.stat().st_mtime > KEPT:
            library.unlink(missing_ok=True)
            library.with_suffix(".lock").unlink(missing_ok=True)
