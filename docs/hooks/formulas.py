"""Formulas as drawings: matplotlib, which ehar needs anyway, sets them while the site is built; no script is loaded.

Pages write them between dollars, docstrings in Sphinx's way. Both go through `pymdownx.arithmatex`.
"""

import re
from html import escape, unescape
from typing import Any

from markdown import Markdown
from markdown.extensions import Extension
from markdown.preprocessors import Preprocessor
from matplotlib.font_manager import FontProperties
from matplotlib.mathtext import MathTextParser
from matplotlib.path import Path
from matplotlib.textpath import TextToPath
from mkdocs.exceptions import PluginError

POINTS = 100  # of the drawing's units in an em; coordinates are rounded to one
FONT = FontProperties(size=POINTS, math_fontfamily="stix")
INLINE, DISPLAYED = 1.1, 1.3  # the text's ems in one of the formula
LETTERS = {Path.MOVETO: "M", Path.LINETO: "L", Path.CURVE3: "Q", Path.CURVE4: "C", Path.CLOSEPOLY: "Z"}

_BLOCK = re.compile(r"^( *)\.\. math:: (.*)$")
_INLINE = re.compile(r":math:`([^`]*)`")
_SHORT = re.compile(r"\\(ge|le|ne)\b")  # matplotlib knows them by their longer names only
_SET = re.compile(
    r'<span class="arithmatex">\\\((?P<inline>.*?)\\\)</span>'
    r'|<div class="arithmatex">\s*\\\[(?P<block>.*?)\\\]\s*</div>',
    re.DOTALL,
)


class SphinxFormulas(Preprocessor):
    """Turns `.. math:: x` and `:math:`...`` of docstrings into what pages write."""

    def run(self, lines: list[str]) -> list[str]:
        """Return the lines with formulas between brackets."""
        blocks = [_BLOCK.sub(r"\1\\[\2\\]", line) for line in lines]
        return [_INLINE.sub(r"\\(\1\\)", line) for line in blocks]


class SphinxFormulasExtension(Extension):
    """The preprocessor as an extension of Markdown."""

    def extendMarkdown(self, md: Markdown) -> None:
        """Let it run first."""
        md.preprocessors.register(SphinxFormulas(md), "sphinx-formulas", 100)


def on_config(config: Any) -> Any:
    """Add the extension, for pages and docstrings."""
    config.markdown_extensions.append(SphinxFormulasExtension())
    return config


def on_page_content(html: str, page: Any, **_: Any) -> str:
    """Return a page in which every formula is drawn."""
    where = page.file.src_uri
    return _SET.sub(lambda found: _drawn(found["inline"], found["block"], where), html)


def _drawn(inline: str | None, block: str | None, where: str) -> str:
    if inline is not None:
        return svg(unescape(inline), INLINE, where)
    lines = unescape(block or "").strip().split("\\\\")  # one drawing a line
    return f'<div class="arithmatex">{"".join(svg(line.strip(), DISPLAYED, where) for line in lines)}</div>'


def svg(formula: str, em: float, where: str) -> str:
    """Return a formula as an SVG element that stands on the line of the text around it.

    Args:
        formula: what matplotlib's mathtext knows of TeX.
        em: its size [em of the text].
        where: the page, for errors.

    Raises:
        PluginError: matplotlib cannot set it.
    """
    text = "$" + _SHORT.sub(r"\\\1q", formula) + "$"
    try:
        width, height, depth, *_ = MathTextParser("path").parse(text, 72, FONT)
        vertices, codes = TextToPath().get_text_path(FONT, text, ismath=True)
    except ValueError as error:
        raise PluginError(f"{where}: expected a formula that matplotlib can set, got {formula!r}: {error}") from error
    drawn = outline(Path(vertices, codes))
    ems = [em * float(size) / POINTS for size in (width, height, depth)]
    return (
        f'<svg class="formula" role="img" aria-label="{escape(formula)}" viewBox="0 {depth - height:.0f} {width:.0f} '
        f'{height:.0f}" style="width:{ems[0]:.3f}em;height:{ems[1]:.3f}em;vertical-align:{-ems[2]:.3f}em">'
        f'<path d="{drawn}"/></svg>'
    )


def outline(path: Path) -> str:
    """Return the outlines of a path as SVG writes them, y downwards."""
    pieces = []
    for vertices, code in path.iter_segments(simplify=False):
        numbers = vertices.reshape(-1, 2) * (1, -1)
        at = "" if code == Path.CLOSEPOLY else " ".join(f"{x:.0f} {y:.0f}" for x, y in numbers)
        pieces.append(LETTERS[code] + at)
    return "".join(pieces)
