"""The summary of a run, with the results of each planner."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ehar.data.scenario import TEST
from ehar.errors import DataError, UsageError
from ehar.files import read_json
from eval.records.config import RunConfig
from eval.records.episodes import EpisodeRecords
from eval.scores.differences import Difference
from eval.scores.planner_summary import NO_ACT, PlannerSummary, parse_planner
from eval.scores.resampling.resamples import Basis
from eval.scores.resampling.training_seeds import group_planners

if TYPE_CHECKING:
    from eval.render.tables import Table

MET = "Passers-by walk to where cameras may be, and count as obstacles."


@dataclass(frozen=True, repr=False)
class Summary:
    """The results of each planner on the same episodes. It prints as a table, in a notebook as HTML.

    Args:
        config: configuration of the run.
        episodes: number of episodes of each planner.
        sequences: number of sequences that they are cut from.
        no_intervals: why there are no intervals; None if there are.
        basis: the people and sequences that intervals rest on.
        planners: results of each planner, in the order of the run.
        differences: paired differences between planners of interest and every other planner that is not privileged.
        activities: of streams, the number of activities that are scored; None for clips, each of which is one.
    """

    config: RunConfig
    episodes: int
    sequences: int
    no_intervals: str | None
    basis: Basis
    planners: tuple[PlannerSummary, ...]
    differences: tuple[Difference, ...]
    activities: int | None = None

    @property
    def length(self) -> int:
        """L, the frames of an episode."""
        return self.config.conditions.frames

    @property
    def title(self) -> str:
        """The title of tables: the conditions, except some that have their usual value."""
        config, told = self.config, self.config.conditions
        return (
            f"{config.data}: sensor {told.sensor}, views {told.views}, track {told.track}{config.in_world}"
            f"{config.told_onset}, "
            f"{'' if config.form == 'causal' else f'recogniser {config.form}, '}"
            f"{'' if config.readout == 'recogniser' else f'readout {config.readout}, '}"
            f"{'' if told.part == TEST else f'{told.part} part, '}{self.extent}"
        )

    @property
    def extent(self) -> str:
        """How much was watched."""
        scored = "" if self.activities is None else f"{self.activities} activities in "
        return f"{scored}{self.episodes} episodes of {self.length} frames from {self.sequences} sequences"

    @property
    def passing_notes(self) -> tuple[str, ...]:
        """What tables say of passers-by whom cameras may meet."""
        return (MET,) if self.config.world.meets_passers else ()

    @property
    def lead(self) -> str | None:
        """The most accurate planner without the truth, except no-act; None if there is none."""
        rivals = [planner for planner in self.planners if not planner.privileged and planner.name != NO_ACT]
        return max(rivals, key=lambda planner: planner.acc_mean).name if rivals else None

    def planner(self, name: str) -> PlannerSummary:
        """Return the summary of one planner.

        Raises:
            UsageError: the run has no such planner.
        """
        named = {planner.name: planner for planner in self.planners}
        if name not in named:
            raise UsageError(f"no planner {name!r} in this run; expected one of: {', '.join(named)}")
        return named[name]

    def tables(self) -> "list[Table]":
        """Return the table of the planners and, if they exist, the tables of differences and of the paper's rows."""
        from eval.scores.summary_table import basis_lines, summary_tables  # imported here: it brings rich

        tables = summary_tables(
            self.title, self.config.data, self.planners, self.differences, basis_lines(self.basis, self.no_intervals)
        )
        warnings = (f"Warning: {line}." for line in self.config.warnings)
        tables[0] = tables[0]._replace(footnotes=(*warnings, *tables[0].footnotes, *self.passing_notes))
        return tables

    def __repr__(self) -> str:
        """Return a line: who was compared, on what, over how many episodes."""
        count = f"{len(self.planners)} planner{'s' * (len(self.planners) != 1)}"
        return f"Summary({self.config.title}: {count}, {self.extent})"

    def __str__(self) -> str:
        """Return the tables as text."""
        from eval.render.tables import text  # imported here: it brings rich

        return text(*self.tables())

    def _repr_html_(self) -> str:
        """Return the tables for a notebook."""
        from eval.render.tables import html  # imported here: it brings rich

        return "".join(html(table) for table in self.tables())

    def to_json(self) -> dict[str, Any]:
        """Return the content of summary.json."""
        told = self.config.conditions
        return {
            "data": self.config.data,
            "sensor": told.sensor,
            "views": told.views,
            "track": told.track,
            "readout": self.config.readout,
            "episodes": self.episodes,
            **({} if self.activities is None else {"activities": self.activities}),
            "no_intervals": self.no_intervals,
            "basis": asdict(self.basis),
            "planners": [planner.to_json() for planner in self.planners],
            "differences": [asdict(difference) for difference in self.differences],
        }


@dataclass(frozen=True, kw_only=True)
class _File:
    """The keys of summary.json that a summary is made of; the other keys are in config.json too."""

    episodes: int
    planners: tuple[dict[str, Any], ...]
    basis: Basis
    differences: tuple[Difference, ...] = ()
    no_intervals: str | None = None
    activities: int | None = None


def read_summary(path: Path, config: RunConfig, records: Mapping[str, EpisodeRecords]) -> Summary:
    """Read summary.json.

    Args:
        path: the file.
        config: configuration of the run.
        records: records of the run.

    Raises:
        UsageError: the file is missing, for example because the run was interrupted.
        DataError: the file is not from `ehar benchmark`, or does not belong to these records.
    """
    held = read_json(path, _File, "a finished run of ehar benchmark", unknown=True, defaults=True)
    planners = tuple(
        parse_planner(planner, f"{path}: planners[{index}]") for index, planner in enumerate(held.planners)
    )
    ran = [group.name for group in group_planners(records)]
    if [planner.name for planner in planners] != ran:
        raise DataError(
            f"{path}: expected the planners of the records, {', '.join(ran)}, "
            f"got {', '.join(planner.name for planner in planners) or 'none'}"
        )
    sequences = len(set(next(iter(records.values())).sequence))  # all planners ran the same
    return Summary(
        config,
        held.episodes,
        sequences,
        held.no_intervals,
        held.basis,
        planners,
        held.differences,
        held.activities,
    )
