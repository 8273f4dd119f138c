"""The check that every recorded step is one that the camera can make by itself."""

from collections.abc import Mapping

from ehar.steps import StepLimits, from_rest
from ehar.track import IDEAL
from eval.records.config import RunConfig
from eval.records.episodes import DIGITS, EpisodeRecords
from eval.verification.checks import FAILED, OK, UNCHECKED, Check
from eval.verification.records import place

NAME = "steps"
ROUNDED = 0.51 * 10**-DIGITS  # [m], [rad]: half of the last recorded digit, and its own rounding


def check_steps(config: RunConfig, records: Mapping[str, EpisodeRecords], fps: float | None) -> Check:
    """Check every recorded step against the grid's moves, or against the limits of the vehicle.

    Args:
        config: configuration of the run.
        records: records of its planners.
        fps: frame rate of the data [Hz]; None if the data are not here.
    """
    if config.track_sha256 is not None:
        return Check(NAME, UNCHECKED, f"{config.conditions.track}: nobody knows what your own motion can do")
    rate = config.conditions.fps or fps
    if config.vehicle is not None and rate is None:
        return Check(NAME, UNCHECKED, f"{config.vehicle.name}: the data are not here, and the run names no frame rate")
    if config.vehicle is None and config.conditions.track != IDEAL:
        return Check(NAME, UNCHECKED, f"{config.conditions.track}: the run does not name the limits of its vehicle")
    limits = StepLimits(config.world.workspace, 1 / (rate or 1.0), config.vehicle)
    for name, held in records.items():
        broken = limits.first_broken(from_rest(held.viewpoint), ROUNDED)
        if broken is not None:
            where = place(name, held, broken.episode, broken.step + 1)
            return Check(NAME, FAILED, f"{where}: viewpoint: {broken.what}")
    count = sum(len(held) * (held.viewpoint.shape[1] - 1) for held in records.values())
    within = "moves of the grid" if config.vehicle is None else f"within the limits of {config.vehicle.name!r}"
    return Check(NAME, OK, f"{count} steps are {within}")
