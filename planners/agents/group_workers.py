"""Runs groups of episodes in this process, or in another process behind the same calls."""

import multiprocessing
import pickle
import signal
from collections.abc import Iterable
from multiprocessing.connection import Connection
from typing import Any

import cloudpickle
import numpy as np
import torch

from ehar.arrays import IntArray
from ehar.errors import EpisodeError
from ehar.processes import leave_if_imported_again
from planners.agents.episode_groups import Group, GroupSetting, MakeEnv


class GroupsHere:
    """Groups in this process."""

    def __init__(self, make_env: MakeEnv, groups: Iterable[GroupSetting]) -> None:
        """Create the groups."""
        self._groups = [Group(make_env, setting) for setting in groups]

    def send(self, moves: IntArray | None) -> None:
        """Carry out moves, group after group in one array; None begins new episodes."""
        if moves is None:
            self._answer: list[Any] = [group.reset() for group in self._groups]
        else:
            pieces = np.split(moves, len(self._groups))
            self._answer = [group.step(piece) for group, piece in zip(self._groups, pieces, strict=True)]

    def receive(self) -> list[Any]:
        """Return the result of each group: `GroupStep`, or the first inputs if episodes have begun."""
        return self._answer

    def close(self) -> None:
        """Do nothing: there is no process to end."""


class GroupsThere:
    """Groups in another process, behind the same calls."""

    def __init__(self, make_env: MakeEnv, groups: Iterable[GroupSetting]) -> None:
        """Start the process."""
        leave_if_imported_again()
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs,))
        self._process.daemon = True
        self._process.start()
        theirs.close()  # so that only the process holds this end, and we notice when the process ends
        try:
            self._pipe.send_bytes(cloudpickle.dumps((make_env, list(groups))))
        except OSError as error:
            raise self._ended() from error

    def send(self, moves: IntArray | None) -> None:
        """Send moves, group after group in one array; None begins new episodes."""
        try:
            self._pipe.send(moves)
        except OSError as error:
            raise self._ended() from error

    def receive(self) -> list[Any]:
        """Wait, and return the result of each group: `GroupStep`, or the first inputs if episodes have begun."""
        try:
            answer = self._pipe.recv()
        except (EOFError, OSError) as error:
            raise self._ended() from error
        if isinstance(answer, Exception):
            raise answer
        return list(answer)

    def close(self) -> None:
        """End the process."""
        self._pipe.close()  # this ends the loop in the process
        self._process.join()

    def _ended(self) -> EpisodeError:
        self._process.join(timeout=1)  # a killed process needs a moment to have an exit code
        return EpisodeError(
            f"environments: a worker process has ended, with exit code {self._process.exitcode}: expected an answer"
        )


def _serve(pipe: Connection) -> None:
    """Answer calls until the other end is closed or its process is gone; after an error, every answer is that error."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent receives Ctrl-C too, and closes the pipe
    torch.set_num_threads(1)
    failed: Exception | None = None
    try:
        here = GroupsHere(*cloudpickle.loads(pipe.recv_bytes()))
    except Exception as error:
        failed = _sendable(error)
    while True:
        try:
            moves = pipe.recv()
        except (EOFError, OSError):
            return
        answer: Any = failed
        if failed is None:
            try:
                here.send(moves)
                answer = here.receive()
            except Exception as error:
                answer = failed = _sendable(error)
        try:
            pipe.send(answer)
        except OSError:
            return


def _sendable(error: Exception) -> Exception:
    """Return the error; if it cannot be pickled, an EpisodeError with its message."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return EpisodeError(f"environments: {type(error).__name__}: {error}")
    return error
