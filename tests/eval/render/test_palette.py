"""The palette: planners look different, in a report and on paper."""

import pytest
from matplotlib.colors import to_rgb

from eval.render.palette import DARK, LIGHT, Theme, looks


def test_planners_look_different() -> None:
    names = {"no-act": False, **{f"p{index}": False for index in range(15)}, "oracle": True, "oracle-lookahead": True}
    assert len({look.symbol + look.token for look in looks(names).values()}) == 18
    assert len({look.dash + look.token for look in looks(names).values()}) == 18


def test_planners_whose_colours_repeat_differ_in_their_lines() -> None:
    styles = looks({f"p{index}": False for index in range(22)}).values()
    assert len({(look.colour, look.line) for look in styles}) == 22 > len({look.colour for look in styles})
    told = looks({"oracle": True, "oracle-lookahead": True})
    assert all(look.line != "solid" for look in told.values())


@pytest.mark.parametrize("theme", [LIGHT, DARK])
def test_a_theme_has_the_variables_of_the_page(theme: Theme) -> None:
    css = theme.css()
    for name in ("paper", "ground", "text", "soft", "grid", "neutral", "accent", "focus", *(f"c{n}" for n in range(6))):
        assert f"--{name}: #" in css
    assert len(set(map(to_rgb, theme.planners))) == 6
