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
import subprocess
from collections.abc import Sequence
from typing import Any

import casadi as ca
from platformdirs import user_cache_path

COMPILER = "cc"
FLAGS = ("-O1", "-ffp-contract=off", "-fPIC", "-shared")  # -O2 takes twice as long to compile, and is as fast
COMPILE = 'nice "$@" -o "$0.tmp" "$0.c" -lm && mv "$0.tmp" "$0.so"; rm -f "$0.c" "$0.tmp"'  # a shell's command


def has_compiler() -> bool:
    """Return whether there is a C compiler."""
    return shutil.which(COMPILER) is not None


class MachineCode:
    """The machine code of some functions, in the cache of this machine's user."""

    def __init__(self, functions: Sequence[Any]) -> None:
        """Find out where that of CasADi functions is kept; each has a name of its own."""
        self._functions = functions
        text = [ca.CasadiMeta.version(), platform.platform(), COMPILER, *FLAGS, *(f.serialize() for f in functions)]
        self._library = user_cache_path("ehar") / f"{hashlib.sha256(''.join(text).encode()).hexdigest()[:32]}.so"
        self._making: subprocess.Popen[bytes] | None = None

    def load(self) -> dict[str, Any] | None:
        """Return the compiled functions by their names, or None while there are none."""
        if not self._library.is_file():
            return None
        try:
            return {function.name(): ca.external(function.name(), str(self._library)) for function in self._functions}
        except RuntimeError:  # a damaged file
            self._library.unlink(missing_ok=True)
            return None

    def make(self, *, wait: bool = False) -> None:
        """Begin to compile, unless another process does already, or code can't be kept.

        Args:
            wait: whether to return when it is done.
        """
        try:
            self._library.parent.mkdir(
                mode=0o700, parents=True, exist_ok=True
            )  # who writes here runs code as this user
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
