"""How often a camera was too near to something, by episode; only records of worlds in which it can hit things have it.

These are obstacles, and passers-by who walk to where cameras may be.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.obstacles.surroundings import Surroundings, too_near


@dataclass(frozen=True, eq=False)
class ContactRecords:
    """The frames of N episodes in which a camera was too near.

    Args:
        near_frames: (N,) frames in which the camera was within the margin of something, or in it.
        hit_frames: (N,) frames in which it was in it.
    """

    near_frames: IntArray
    hit_frames: IntArray


@dataclass(frozen=True)
class ContactSummary:
    """The frames of all episodes of a planner in which a camera was too near, over all its trainings."""

    near_frames: int
    hit_frames: int


CONTACTS = tuple(field.name for field in fields(ContactRecords))  # of a line of episodes.jsonl and of summary.json


def contacts_of(
    surroundings: Surroundings | None, viewpoints: FloatArray, *, farther: float = 0.0
) -> ContactRecords | None:
    """Return the contacts of cameras at viewpoints (N, L, 3); None in a world in which nothing can be hit.

    Args:
        surroundings: what stands around them.
        viewpoints: where they are.
        farther: how much farther from things they are taken to be [m].
    """
    if surroundings is None or not surroundings.can_be_hit:
        return None
    clearance = surroundings.clearance(viewpoints, slice(None)) + farther
    return ContactRecords(too_near(clearance).sum(axis=1), (clearance < 0).sum(axis=1))


def join_contacts(pieces: Sequence[ContactRecords]) -> ContactRecords:
    """Return the records of several batches as one."""
    return ContactRecords(**{key: np.concatenate([getattr(piece, key) for piece in pieces]) for key in CONTACTS})


def summarise_contacts(contacts: ContactRecords) -> ContactSummary:
    """Return the sums over episodes."""
    return ContactSummary(*(int(getattr(contacts, key).sum()) for key in CONTACTS))


def contact_numbers(contacts: ContactSummary | None) -> Mapping[str, int]:
    """Return the numbers in summary.json; in a world in which nothing can be hit there are none."""
    return {} if contacts is None else asdict(contacts)
