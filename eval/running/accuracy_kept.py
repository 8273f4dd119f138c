"""Reads the run that a flight is compared with: the same planners and episodes on the ideal track."""

from collections.abc import Mapping
from pathlib import Path

from ehar.errors import UsageError
from ehar.track import IDEAL
from eval.records.config import RunConfig
from eval.records.episodes import EpisodeRecords
from eval.records.same_planners import other_planner
from eval.running.run import read_run
from eval.scores.planner_summary import NO_ACT

SAME = ("data_sha256", "recogniser_sha256", "sensor_sha256", "form", "readout")  # of both configurations
TOLD = ("sensor", "views", "part", "starts", "seed", "length", "fps", "world", "onset")  # of both conditions


def read_ideal_run(directory: Path, config: RunConfig) -> Mapping[str, EpisodeRecords]:
    """Return the records of each planner of a run on the ideal track that a flight may be compared with.

    Args:
        directory: folder of the run.
        config: configuration of the flight.

    Raises:
        UsageError: the flight's track is `ideal`; or the folder holds no run, or a run on another track, under other
            conditions, with other weights of a learned planner, or without no-act.
        DataError: the files of the run cannot be read, or the run is incomplete.
    """
    if config.conditions.track == IDEAL:
        raise UsageError(f"{directory}: a run to compare flights with, but the track is {IDEAL}; expected a vehicle")
    run = read_run(directory)
    held = run.config
    wanted, got = _decided(config), _decided(held)
    if config.gain_model_sha256 is None or held.gain_model_sha256 is None:  # not every run needs one
        del wanted["gain_model_sha256"]
    _check_same(directory, got, {**wanted, "track": IDEAL})
    difference = other_planner(config.planners, held.planners)
    if difference is not None:
        raise UsageError(f"{directory}: expected the planners of the flight; {difference}")
    if NO_ACT not in run.records:
        raise UsageError(f"{directory}: expected a run with {NO_ACT} among its planners, got {', '.join(run.records)}")
    return run.records


def _decided(config: RunConfig) -> dict[str, object]:
    """Return the values that both runs have to share, and the track."""
    own = {name: getattr(config, name) for name in (*SAME, "gain_model_sha256")}
    return own | {name: getattr(config.conditions, name) for name in (*TOLD, "track")}


def _check_same(directory: Path, got: Mapping[str, object], wanted: Mapping[str, object]) -> None:
    """Raise a UsageError that says what differs."""
    differing = [name for name, value in wanted.items() if got[name] != value]
    if differing:
        name = differing[0]
        raise UsageError(
            f"{directory}: expected a run under the flight's conditions, on the {IDEAL} track; it differs in "
            f"{', '.join(differing)} ({name}: expected {wanted[name]!r}, got {got[name]!r})"
        )
