"""The errors that ehar raises: each message says what was got, what was expected, and where."""


class EharError(Exception):
    """Any error that a user can fix; the CLI prints it as one line and exits with code 2."""


class DataError(EharError):
    """A motion file is missing, malformed, or lacks the requested data."""


class ModelError(EharError):
    """Weights are missing, malformed, or do not fit the data."""


class EpisodeError(EharError):
    """A planner, a sensor or a motion broke its contract in an episode."""


class UsageError(EharError):
    """An option or a name is unknown, or options contradict each other."""
