"""Who is to blame: what a user's own code raises becomes one line that names its file and line."""

from collections.abc import Iterator
from contextlib import contextmanager

from ehar.errors import EharError, EpisodeError
from ehar.plugins.loading import failure


@contextmanager
def blamed(actor: object, where: str) -> Iterator[None]:
    """Turn what the code of a planner, a recogniser, a sensor or a motion raises into one line with its file and line.

    Raises:
        EpisodeError: something was raised; an error of ours goes on as it is.
    """
    try:
        yield
    except EharError:
        raise
    except Exception as error:
        raise EpisodeError(f"{where}: {failure(error, type(actor))}") from error
