"""What summary.json says of a run: how well each planner did."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ehar.data.scenario import TEST
from ehar.errors import DataError, UsageError
from ehar.files import json_text, parse_json, read_json
from eval.records.config import RunConfig
from eval.records.episodes import EpisodeRecords
from eval.records.flights import KEYS, FlightSummary, flight_numbers
from eval.records.solves import Solves
from eval.scores.differences import Difference
from eval.scores.statistics import Interval
from eval.scores.training_seeds import group_planners

NO_ACT, ORACLE = "no-act", "oracle"  # the two ends of the gap


@dataclass(frozen=True)
class PlannerSummary:
    """How well one planner did; of one that was trained with several seeds every number is the mean over them.

    Args:
        name: the planner's, without seeds.
        privileged: whether it was handed the truth.
        training_seeds: which it was trained with, in ascending order; empty for a planner that names none.
        acc: accuracy [%] after 10 to 100 % of the frames.
        acc_mean: accuracy [%], the mean over all frames.
        acc_mean_ci95: its 95 % interval, bootstrap over sequences and, where there are several, training seeds; None,
            like all intervals, where they cannot be had.
        acc_mean_seed_sd: standard deviation (ddof 1) of `acc_mean` over training seeds [percentage points]; None below
            two seeds.
        acc_iqm: accuracy [%], the interquartile mean over sequences and training seeds, each sequence counting once.
        acc_iqm_ci95: its 95 % interval.
        gap_closed: the share of the way from no-act to the oracle, that of the ideal track for flights which are
            compared with it; None where one of them was not run, or the oracle was no better.
        gap_closed_ci95: its 95 % interval.
        nll: mean negative log-likelihood of the true class [nat].
        ece: expected calibration error, 0 to 1; each training's own, so that their errors do not cancel.
        path_length_m: mean distance travelled in an episode [m].
        step_ms: planning time of one frame of one episode [ms]; like `solves` not in the records.
        flight: what its flights demanded of the vehicle, those of all seeds; None on the ideal track.
        accuracy_kept: the gap closed in flight over that on the ideal track, both of the ideal track's gap, so that
            the oracle cancels: (acc in flight - acc of no-act) / (acc on the ideal track - acc of no-act), mean
            accuracies over frames. None without a run of each of its seeds on the ideal track, or where the planner
            gained nothing there.
        accuracy_kept_ci95: its 95 % interval, over the resamples in which the planner gained on the ideal track.
        solves: what became of its plans, those of all seeds; None for a planner that counts none.
    """

    name: str
    privileged: bool
    training_seeds: tuple[int, ...]
    acc: dict[str, float]
    acc_mean: float
    acc_mean_ci95: Interval | None
    acc_mean_seed_sd: float | None
    acc_iqm: float
    acc_iqm_ci95: Interval | None
    gap_closed: float | None
    gap_closed_ci95: Interval | None
    nll: float
    ece: float
    path_length_m: float
    step_ms: float
    flight: FlightSummary | None = None
    accuracy_kept: float | None = None
    accuracy_kept_ci95: Interval | None = None
    solves: Solves | None = None

    def to_json(self) -> dict[str, Any]:
        """Return what summary.json holds: the same keys for every planner on every track, flat."""
        values = {name: value for name, value in asdict(self).items() if name not in ("flight", "solves")}
        return {
            **values,
            **flight_numbers(self.flight),
            "solves": None if self.solves is None else self.solves.counts,
            "fallback_share": None if self.solves is None else self.solves.fallback_share,
        }


@dataclass(frozen=True)
class Summary:
    """How well each planner did on the same episodes. It prints as a table, in a notebook as HTML.

    Args:
        config: what decided the episodes.
        episodes: how many each planner ran.
        sequences: how many sequences they are cut from.
        no_intervals: why intervals cannot be had; None where they can.
        planners: in the order of the run.
        differences: those of `differences.SUBJECTS` and every other planner that is not privileged.
    """

    config: RunConfig
    episodes: int
    sequences: int
    no_intervals: str | None
    planners: tuple[PlannerSummary, ...]
    differences: tuple[Difference, ...]

    @property
    def length(self) -> int:
        """L, the frames of an episode."""
        return self.config.conditions.length

    @property
    def title(self) -> str:
        """What a table is headed with: the conditions, those that are the usual ones left out."""
        config, told = self.config, self.config.conditions
        return (
            f"{config.data}: sensor {told.sensor}, views {told.views}, track {told.track}, "
            f"{'' if config.form == 'causal' else f'recogniser {config.form}, '}"
            f"{'' if config.readout == 'recogniser' else f'readout {config.readout}, '}"
            f"{'' if told.part == TEST else f'{told.part} part, '}"
            f"{self.episodes} episodes of {told.length} frames from {self.sequences} sequences"
        )

    def planner(self, name: str) -> PlannerSummary:
        """Return the summary of one planner.

        Raises:
            UsageError: it is not among the run's planners.
        """
        named = {planner.name: planner for planner in self.planners}
        if name not in named:
            raise UsageError(f"no planner {name!r} in this run; expected one of: {', '.join(named)}")
        return named[name]

    def to_json(self) -> dict[str, Any]:
        """Return what summary.json holds."""
        told = self.config.conditions
        return {
            "data": self.config.data,
            "sensor": told.sensor,
            "views": told.views,
            "track": told.track,
            "readout": self.config.readout,
            "episodes": self.episodes,
            "no_intervals": self.no_intervals,
            "planners": [planner.to_json() for planner in self.planners],
            "differences": [asdict(difference) for difference in self.differences],
        }


@dataclass(frozen=True, kw_only=True)
class _File:
    """The keys of summary.json that a summary is made of; what else is there stands in config.json too."""

    episodes: int
    planners: tuple[dict[str, Any], ...]
    differences: tuple[Difference, ...] = ()
    no_intervals: str | None = None


def read_summary(path: Path, config: RunConfig, records: Mapping[str, EpisodeRecords]) -> Summary:
    """Read summary.json.

    Args:
        path: of the file.
        config: of the run.
        records: of the run.

    Raises:
        UsageError: there is none, as when the run was interrupted.
        DataError: it is not what `ehar benchmark` writes, or not of these records.
    """
    held = read_json(path, _File, "a finished run of ehar benchmark", unknown=True, defaults=True)
    planners = tuple(_planner(planner, f"{path}: planners[{index}]") for index, planner in enumerate(held.planners))
    ran = [group.name for group in group_planners(records)]
    if [planner.name for planner in planners] != ran:
        raise DataError(
            f"{path}: expected the planners of the records, {', '.join(ran)}, "
            f"got {', '.join(planner.name for planner in planners) or 'none'}"
        )
    sequences = len({name for of in records.values() for name in of.sequence})
    return Summary(config, held.episodes, sequences, held.no_intervals, planners, held.differences)


def _planner(held: dict[str, Any], where: str) -> PlannerSummary:
    """Return what is said of one planner; flights and plans lie flat beside the rest."""
    flown = {key: held.get(key) for key in KEYS}
    solves = held.get("solves")
    nested: dict[str, Any] = {name: value for name, value in held.items() if name not in KEYS}
    nested["flight"] = None if None in flown.values() else flown
    if isinstance(solves, dict):  # the file has the share of plans that fell back, not their number
        share = held.get("fallback_share")
        plans = sum(count for count in solves.values() if isinstance(count, int))
        nested["solves"] = {"counts": solves, "fallbacks": round(share * plans) if isinstance(share, float) else share}
    return parse_json(json_text(nested), PlannerSummary, where, "a planner's summary", unknown=True, defaults=True)
