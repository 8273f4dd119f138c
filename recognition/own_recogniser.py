"""Your own recognisers: objects, or classes from a file or a module, made for the data that they will see."""

from ehar.data.recordings import Recordings
from ehar.errors import ModelError, UsageError
from ehar.plugins.own_class import HANDED, Contract, Own, bring
from ehar.recogniser import Recogniser
from ehar.world import World

CONTRACT = Contract("recogniser", Recogniser, ("start", "step"), ("class_names", "embedding_size"))


def resolve_recogniser(brought: str | Recogniser, data: Recordings, world: World) -> Own:
    """Return your own recogniser, checked against the classes of the data; in streams no activity is one more.

    A constructor with arguments called `class_names`, `skeleton`, `persons` or `fps` is handed those of the data, one
    with an argument called `camera` the world's.

    Args:
        brought: an object, or the text that names its class.
        data: the data that it will see.
        world: the world that it will see it in.

    Raises:
        UsageError: the recogniser cannot be loaded or made, or the object is not a recogniser.
        ModelError: the recogniser has other classes than the data.
    """
    names = data.recognised_names  # in streams, no activity is one of them
    handed = {name: getattr(data, name) for name in HANDED} | {"class_names": names, "camera": world.camera}
    own = bring(brought, CONTRACT, handed)
    known, size = own.made.class_names, own.made.embedding_size
    try:
        fits = tuple(known) == names
    except TypeError:
        fits = False
    if not fits:
        raise ModelError(f"{own.what}: class_names: expected those of {data.name}, {names}, got {known}")
    if not isinstance(size, int) or size < 1:
        raise UsageError(f"{own.what}: embedding_size: expected a number of at least 1, got {size!r}")
    return own
