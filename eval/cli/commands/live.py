"""`ehar live`."""

from eval.cli.command import Command, Flag
from eval.cli.show import show_live

LIVE = Command(
    "eval.live.start:live",
    show_live,
    text="""Watch people live, and say where a drone should fly.

    Frames of a pose estimator in, a JSON object a line; setpoints out.

    For example:
        ehar live --models models/mine --source udp:127.0.0.1:5005
        ehar live --rehearse solo-stream --page 8000
    """,
    flags={
        "models": Flag(metavar="PATH", hint="none"),
        "sensor": Flag(),
        "belief": Flag(hint="believe the recogniser"),
        "mavlink": Flag(metavar="ADDRESS", hint="none"),
        "origin": Flag(metavar="EAST NORTH UP"),
        "page": Flag(metavar="PORT", hint="none"),
        "rehearse": Flag(metavar="DATA", hint="none"),
        "world": Flag(metavar="WORLD", hint="that of the weights"),
    },
)
