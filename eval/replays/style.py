"""How a replay is drawn: the colours of Okabe and Ito, as in a report's light theme, and lines that stand out."""

from typing import Any, Literal, NamedTuple

from matplotlib.patheffects import Normal, withStroke

TEXT, SOFT, GRID, FAINT, GREY = "#1b1f24", "#586069", "#cfd5dc", "#eef0f3", "#7a8794"
PEOPLE = ("#1b1f24", "#e69f00", "#009e73", "#cc79a7")  # one person each


class Look(NamedTuple):
    """How a planner is drawn: by colour and by dash, so that no reader depends on one of them."""

    colour: str
    dash: Literal["solid"] | tuple[float, tuple[float, ...]]


LOOKS = (Look("#0072b2", "solid"), Look("#d55e00", (0, (4.0, 1.6))))


def bone_colours(persons: int, bones: int) -> list[str]:
    """Return the colours of all bones, person by person."""
    return [PEOPLE[person % len(PEOPLE)] for person in range(persons) for _ in range(bones)]


def outlined(width: float) -> list[Any]:
    """Return effects that keep a line or a text apart from what is below it, by a white edge."""
    return [withStroke(linewidth=width, foreground="white"), Normal()]


def shortened(text: str, longest: int) -> str:
    """Return text on one line, cut off where it has more letters than there is room for."""
    line = " ".join(text.split())
    return line if len(line) <= longest else f"{line[: longest - 1]}…"
