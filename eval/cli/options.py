"""Options that several commands share, and what their help says where they are not given."""

from pathlib import Path
from typing import Annotated

from tyro.conf import arg

Models = Annotated[Path | None, arg(help_behavior_hint="(default: those that ship)")]
Fps = Annotated[float | None, arg(help_behavior_hint="(default: the data's)")]
Out = Annotated[Path | None, arg(help_behavior_hint="(default: none)")]
AS_RECORDED = arg(help_behavior_hint="(default: as recorded)")  # of a finished run's data and weights
