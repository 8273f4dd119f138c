"""Live: a pose estimator's frames in, setpoints of a drone out, while people are watched."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from eval.live.messages import Answer as Answer
    from eval.live.messages import Frame as Frame
    from eval.live.setpoints import Setpoint as Setpoint
    from eval.live.watcher import Watcher as Watcher
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "Answer": "eval.live.messages",
            "Frame": "eval.live.messages",
            "Setpoint": "eval.live.setpoints",
            "Watcher": "eval.live.watcher",
        },
    )
