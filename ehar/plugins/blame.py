"""Turns an error of a user's own code into one line that names the file and line of that code."""

from collections.abc import Iterator
from contextlib import contextmanager

from ehar.errors import EharError, EpisodeError
from ehar.plugins.loading import failure


@contextmanager
def blamed(actor: object, where: str) -> Iterator[None]:
    """Turn an error of a planner, a recogniser, a sensor or a motion into one line with its file and line.

    Raises:
        EpisodeError: the code raised an error, or called `sys.exit`, which would end the command without a word; an
            `EharError` is not changed.
    """
    try:
        yield
    except EharError:
        raise
    except (Exception, SystemExit) as error:
        raise EpisodeError(f"{where}: {failure(error, type(actor))}") from error
