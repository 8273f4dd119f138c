"""Motion data: recordings and their skeletons, files, scenarios cut from them, and two synthetic sets."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from ehar.data.motion_data import MotionData as MotionData
    from ehar.data.motion_file import load_motion as load_motion
    from ehar.data.motion_file import save_motion as save_motion
    from ehar.data.scenario import Scenarios as Scenarios
    from ehar.data.scenario import split_parts as split_parts
    from ehar.data.scenario import windows as windows
    from ehar.data.skeleton import Skeleton as Skeleton
    from ehar.data.source import load_data as load_data
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "MotionData": "ehar.data.motion_data",
            "Skeleton": "ehar.data.skeleton",
            "load_motion": "ehar.data.motion_file",
            "save_motion": "ehar.data.motion_file",
            "load_data": "ehar.data.source",
            "Scenarios": "ehar.data.scenario",
            "split_parts": "ehar.data.scenario",
            "windows": "ehar.data.scenario",
        },
    )
