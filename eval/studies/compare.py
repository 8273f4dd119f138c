"""Compares two finished runs planner by planner, on the episodes that both ran."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ehar.errors import DataError, UsageError
from ehar.files import write_text
from eval.records.config import CONFIG, PlannerConfig
from eval.records.run_files import TABLE, check_no_run
from eval.render.tables import markdown
from eval.running.run import Run, read_run
from eval.scores.differences import compare_pairs
from eval.scores.planner_accuracy import draw_resamples, planner_accuracy
from eval.scores.resampling.training_seeds import SHARED, PlannerGroup, group_planners
from eval.studies.compare_table import ComparedPlanners
from eval.studies.compare_table import Comparison as Comparison
from eval.studies.same_episodes import check_same_episodes, label, shown

MAY_DIFFER = (  # a footnote says what differs
    *("recogniser_sha256", "views", "form", "readout", "track", "track_sha256", "vehicle", "gain_model_sha256"),
    *("onset", "versions"),
)


def compare(
    run_a: str | Path, run_b: str | Path, planners: Sequence[str] = (), *, out: str | Path | None = None
) -> Comparison:
    """Compare each planner that is in both runs: its accuracy in A minus its accuracy in B.

    Args:
        run_a: folder of a run of `ehar benchmark`.
        run_b: folder of another run of `ehar benchmark`.
        planners: empty, or one planner of A and one of B; `il-ppo` is all its training seeds, `il-ppo/0` is one.
        out: folder for table.md.

    Raises:
        UsageError: a folder holds no run, the runs have different episodes, or a planner did not run; or `out` holds a
            run.
        DataError: files cannot be read, or their episodes are not those of config.json.
    """
    if out is not None:
        check_no_run(Path(out))
    if len(planners) not in (0, 2):
        raise UsageError(f"planners: expected one of A and one of B, got {len(planners)}: {', '.join(planners)}")
    a, b = _read(run_a), _read(run_b)
    check_same_episodes(a, b)
    groups = [(of_a, _drawn(of_b, of_a, a, b)) for of_a, of_b in _choose(a, b, planners)]
    resamples = draw_resamples([*a.scored.values(), *b.scored.values()], [group for both in groups for group in both])
    pairs = [
        (planner_accuracy(of_a, a.scored, resamples), planner_accuracy(of_b, b.scored, resamples))
        for of_a, of_b in groups
    ]
    conditions = a.conditions
    found = Comparison(
        folders=(a.folder, b.folder),
        title=f"{a.config.data}, {conditions.sensor} sensor"
        + ("" if conditions.part == "test" else f", {conditions.part} part"),
        episodes=a.summary.episodes,
        activities=a.summary.activities,
        sequences=a.summary.sequences,
        differing=dict(_differing(a.config.to_json(), b.config.to_json())) | _known_of_people(a, b),
        planners=tuple(
            ComparedPlanners(
                difference=difference,
                acc=(100 * pair[0].mean, 100 * pair[1].mean),
                trainings=(len(of_a.records), len(of_b.records)),
                privileged=(_is_privileged(of_a, a), _is_privileged(of_b, b)),
                retrained=any(_weights(name, a) != _weights(name, b) for name in of_a.records if name in of_b.records),
                rewritten=any(_rewritten(name, a, b) for name in of_a.records if name in of_b.records),
            )
            for difference, pair, (of_a, of_b) in zip(compare_pairs(pairs, resamples), pairs, groups, strict=True)
        ),
        no_intervals=resamples.why_none,
        basis=resamples.basis,
    )
    if out is not None:
        write_text(Path(out) / TABLE, [markdown(*found.tables())])
    return found


def _read(directory: str | Path) -> Run:
    """Read a run, and check that its config.json names all of its planners."""
    run = read_run(directory)
    listed = [planner.name for planner in run.config.planners]
    for name in run.records:
        if name not in listed:
            path = run.folder / CONFIG
            raise DataError(f"{path}: expected every planner with episodes among its planners, {name!r} is not")
    return run


def _differing(a: Mapping[str, Any], b: Mapping[str, Any]) -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield what else differs between two runs, with both values.

    A gain field that only one run needed is left out. The hash of a motion and the vehicle are if the tracks differ.
    """
    for name in MAY_DIFFER:
        if name == "versions":
            versions = a.get(name) or {}, b.get(name) or {}
            for package in sorted(versions[0].keys() & versions[1].keys()):
                if versions[0][package] != versions[1][package]:
                    yield package, (str(versions[0][package]), str(versions[1][package]))
        elif name in ("track_sha256", "vehicle") and a.get("track") != b.get("track"):
            continue
        elif a.get(name) != b.get(name) and not (name == "gain_model_sha256" and None in (a.get(name), b.get(name))):
            yield label(name).replace("_", " "), (shown(name, a), shown(name, b))


def _known_of_people(a: Run, b: Run) -> dict[str, tuple[str, str]]:
    """Return what was known of where and who people are, if that differs; in clips it is known where they are."""
    one, other = (run.config.world for run in (a, b))
    known: dict[str, tuple[str, str]] = {"identity": (one.identity, other.identity)}
    if a.of_streams:
        known["localisation"] = (f"({one.localisation})", f"({other.localisation})")
    return {name: values for name, values in known.items() if values[0] != values[1]}


def _choose(a: Run, b: Run, planners: Sequence[str]) -> list[tuple[PlannerGroup, PlannerGroup]]:
    """Return the pairs to compare: a planner of A and a planner of B.

    Raises:
        UsageError: a requested planner did not run, or no planner ran in both.
    """
    in_a, in_b = ({group.name: group for group in group_planners(run.records)} for run in (a, b))
    if planners:
        return [(_find(a, planners[0], in_a), _find(b, planners[1], in_b))]
    both = [(group, in_b[name]) for name, group in in_a.items() if name in in_b]
    if not both:
        raise UsageError(
            f"no planner ran both in {a.directory} ({', '.join(in_a)}) and in {b.directory} ({', '.join(in_b)}); "
            "expected --planners A B, one of each"
        )
    return both


def _find(run: Run, name: str, groups: Mapping[str, PlannerGroup]) -> PlannerGroup:
    if name in groups:
        return groups[name]
    if name in run.records:
        return PlannerGroup(name=name, seeds=(), records=(name,), rows=(0,))
    raise UsageError(f"{run.directory}: no planner {name!r}; expected one of: {', '.join({**groups, **run.records})}")


def _config(name: str, run: Run) -> PlannerConfig:
    """Return the entry of a planner in config.json."""
    return next(planner for planner in run.config.planners if planner.name == name)


def _weights(name: str, run: Run) -> str | None:
    return _config(name, run).weights_sha256


def _rewritten(name: str, a: Run, b: Run) -> bool:
    """Return whether your own planner has another file or other arguments; False if one of the runs does not say."""
    one, other = _config(name, a), _config(name, b)
    if (one.source_sha256 is None) != (other.source_sha256 is None):
        return False
    return (one.source_sha256, one.arguments) != (other.source_sha256, other.arguments)


def _is_privileged(group: PlannerGroup, run: Run) -> bool:
    return any(_config(name, run).privileged for name in group.records)


def _drawn(of_b: PlannerGroup, of_a: PlannerGroup, a: Run, b: Run) -> PlannerGroup:
    """Return a planner of B so that its trainings are drawn with those of a planner of A only if they are the same."""
    if of_b.family is None:
        return of_b
    if of_a.family == of_b.family == SHARED:
        same = a.config.recogniser_sha256 == b.config.recogniser_sha256
    else:
        weights = [_weights(name, a) for name in of_a.records]
        same = None not in weights and weights == [_weights(name, b) for name in of_b.records]
    return replace(of_b, family=of_a.family if same else f"{of_b.family} of another run")
