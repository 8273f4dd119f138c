"""What `ehar live` is told and nothing would come of, or does not exist, is refused."""

from typing import Any

import pytest

from ehar.errors import UsageError
from eval.live.start import live


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rehearse": "solo-stream", "source": "frames.jsonl"}, "--source: expected no --rehearse"),
        ({"rehearse": "solo-stream", "vehicle": "ideal"}, "unknown vehicle 'ideal'; expected one of: px4-auto"),
        ({"rehearse": "solo-stream", "world": "room", "models": None}, "world room: expected one in which nothing"),
        ({"minutes": 2.0}, "--minutes: expected --rehearse beside it"),
        ({"loss": 0.5}, "--loss: expected --rehearse beside it"),
        ({"origin": (1.0, 0.0, 0.0)}, "--origin: expected --mavlink"),
    ],
)
def test_an_option_that_nothing_comes_of_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        live(**({"models": "models"} | options))
