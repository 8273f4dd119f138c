"""The one palette: the colours of reports, films and figures, how planners look in them, and how wide lines are.

Planners and people have the colours of Okabe and Ito, which colour-blind readers can tell apart; they also differ in
dashes and symbols. A report has a light and a dark theme; everything else uses the light one.
"""

from collections.abc import Mapping
from typing import Literal, NamedTuple

from planners.heuristic import NoAct

BLUE, VERMILION, GREEN, PURPLE, SKY, ORANGE = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00"
YELLOW = "#f0e442"  # fades on white: only above dark fields


class Theme(NamedTuple):
    """The colours of a page, by purpose; `planners` are the colours of planners that compete."""

    paper: str
    ground: str
    text: str
    soft: str
    grid: str
    neutral: str
    accent: str
    focus: str
    planners: tuple[str, ...]

    def css(self) -> str:
        """Return the theme as CSS variables: `--paper`, ..., and `--c0` to `--c5` of planners."""
        named = {name: colour for name, colour in self._asdict().items() if name != "planners"}
        named |= {f"c{index}": colour for index, colour in enumerate(self.planners)}
        return " ".join(f"--{name}: {colour};" for name, colour in named.items())


LIGHT = Theme(
    paper="#ffffff",
    ground="#f4f5f7",
    text="#1b1f24",
    soft="#586069",
    grid="#dfe3e8",
    neutral="#6b7280",
    accent="#0b5cad",
    focus=VERMILION,
    planners=(BLUE, VERMILION, GREEN, PURPLE, SKY, ORANGE),
)
DARK = Theme(  # lightened where they would fade
    paper="#171a1f",
    ground="#0f1114",
    text="#e7eaee",
    soft="#a5adb8",
    grid="#343a43",
    neutral="#9aa3af",
    accent="#7cc0f5",
    focus="#ff9a4d",
    planners=("#4a9fdc", "#ef8543", "#2fbf94", "#dd9cc2", "#a3d8f7", "#f2b632"),
)

TEXT, SOFT, GRID, NEUTRAL = LIGHT.text, LIGHT.soft, LIGHT.grid, LIGHT.neutral
EDGE, FAINT = "#cfd5dc", "#eef0f3"  # frames and floors, which a film would lose in the grid's grey; empty areas
RIGHT = "#dcebd9"  # behind frames that were recognised correctly
PEOPLE = (TEXT, ORANGE, GREEN, PURPLE)  # one person each
CLASSES = (*LIGHT.planners, "#7f5539", "#6a51a3")

THIN, LINE, STRONG = 0.8, 1.8, 2.6  # grids and hints; curves; what stands out [pt]

Dash = Literal["solid", "dashdot", "longdash", "longdashdot", "dot", "dash"]  # as Plotly names them
DASHES: tuple[Dash, ...] = ("solid", "dashdot", "longdash", "longdashdot")
TOLD_DASHES: tuple[Dash, ...] = ("dot", "dash")
SYMBOLS = ("circle", "square", "diamond", "triangle-up", "cross", "star", "pentagon", "triangle-down", "x", "hexagon")
TOLD_SYMBOLS = ("star-open", "hexagram-open")
_LINES: dict[Dash, tuple[float, ...]] = {  # lengths of dashes and gaps, in widths of the line
    "dashdot": (5, 1.6, 1.2, 1.6),
    "longdash": (4, 1.6),
    "longdashdot": (8, 1.6, 1.2, 1.6),
    "dot": (1, 1.5),
    "dash": (2.5, 1.5),
}


class Look(NamedTuple):
    """How a planner is drawn: colour, dash and symbol, so that no reader depends on one of them.

    Args:
        token: token of its colour in the page of a report: `@0` to `@5`, `@neutral` or `@text`.
        dash: dash of its lines.
        symbol: symbol of its points, as Plotly names it.
    """

    token: str
    dash: Dash
    symbol: str

    @property
    def colour(self) -> str:
        """The colour in the light theme."""
        name = self.token.removeprefix("@")
        return LIGHT.planners[int(name)] if name.isdecimal() else {"neutral": NEUTRAL, "text": TEXT}[name]

    @property
    def line(self) -> Literal["solid"] | tuple[float, tuple[float, ...]]:
        """The dash as matplotlib takes it."""
        return "solid" if self.dash == "solid" else (0.0, _LINES[self.dash])


PAIR = (Look("@0", "solid", "circle"), Look("@1", "longdash", "square"))  # of a film, which shows one planner or two


def looks(planners: Mapping[str, bool]) -> dict[str, Look]:
    """Return the look of each planner by name; `planners` says whether each was handed the truth.

    No-act is grey. Planners that were handed the truth have the colour of the text, dotted or dashed.
    """
    rivals = [name for name, privileged in planners.items() if name != NoAct.name and not privileged]
    told = [name for name, privileged in planners.items() if privileged]
    colours = len(LIGHT.planners)
    found = {NoAct.name: Look("@neutral", "solid", "circle-open")}
    for index, name in enumerate(rivals):
        dash = DASHES[index // colours % len(DASHES)]
        found[name] = Look(f"@{index % colours}", dash, SYMBOLS[index % len(SYMBOLS)])
    for index, name in enumerate(told):
        found[name] = Look("@text", TOLD_DASHES[index % len(TOLD_DASHES)], TOLD_SYMBOLS[index % len(TOLD_SYMBOLS)])
    return {name: found[name] for name in planners}


def bone_colours(persons: int, bones: int) -> list[str]:
    """Return the colours of all bones, person by person."""
    return [PEOPLE[person % len(PEOPLE)] for person in range(persons) for _ in range(bones)]
