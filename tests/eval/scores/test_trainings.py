"""Numbers over several trainings of recogniser and gain field cover trainings, people and sequences."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t as student

from ehar.errors import UsageError
from eval.records.episodes import EpisodeRecords
from eval.scores.trainings import TrainingsSummary, summarise_trainings
from tests.helpers.made_records import make_records, summary_of


def training(seed: int, gain: float = 1.0, people: int = 6, **more: EpisodeRecords) -> dict[str, EpisodeRecords]:
    skills = {"no-act": 0.0, "nbv": gain, "h-rotate": 0.2, "oracle": 3.0}
    held = {
        name: make_records(10 * seed + row, skill=skill, episodes=60, people=people)
        for row, (name, skill) in enumerate(skills.items())
    }
    return {**held, **more}


def summarised(*runs: dict[str, EpisodeRecords], planner: str = "nbv") -> TrainingsSummary:
    return summarise_trainings(runs, {name.split("/")[0]: name == "oracle" for run in runs for name in run}, planner)


def test_numbers_are_means_over_trainings_beside_their_spread() -> None:
    runs = [training(seed) for seed in (1, 2, 3)]
    found, alone = summarised(*runs), [summary_of(run) for run in runs]
    assert (found.trainings, found.episodes, found.basis.groups) == (3, 60, 6)
    for planner in found.planners:
        acc = [one.planner(planner.name).acc_mean for one in alone]
        assert planner.acc_mean == pytest.approx(np.mean(acc)) and planner.acc_mean_sd == pytest.approx(
            np.std(acc, ddof=1)
        )
        gaps = [one.planner(planner.name).gap_closed for one in alone]
        assert planner.gap_closed == pytest.approx(np.mean(np.array(gaps, dtype=float)))
        assert (
            planner.acc_mean_ci95 is not None and planner.acc_mean_ci95[0] < planner.acc_mean < planner.acc_mean_ci95[1]
        )
    assert [(of.difference.planner, of.difference.other) for of in found.differences] == [
        ("nbv", "no-act"),
        ("nbv", "h-rotate"),
    ]
    each = [one.planner("nbv").acc_mean - one.planner("no-act").acc_mean for one in alone]
    assert found.differences[0].difference.acc_mean == pytest.approx(np.mean(each))
    assert found.differences[0].sd == pytest.approx(np.std(each, ddof=1))


def test_equal_trainings_are_as_certain_as_one() -> None:
    run = training(1)
    found, alone = summarised(run, run, run), summary_of(run)
    for planner in found.planners:
        one = alone.planner(planner.name)
        assert (planner.acc_mean, planner.acc_mean_sd) == (pytest.approx(one.acc_mean), pytest.approx(0))
        assert planner.acc_mean_ci95 == pytest.approx(one.acc_mean_ci95, rel=1e-6)
        assert planner.gap_closed_ci95 == pytest.approx(one.gap_closed_ci95, rel=1e-6)


def test_trainings_that_differ_widen_intervals_as_student_s_t_of_their_number_does() -> None:
    # Every episode is alike, so only trainings vary: nbv gains 25, 50 and 75 points.
    base = make_records(0, episodes=60, people=6)

    def right(frames: int) -> EpisodeRecords:
        return replace(base, predicted=np.tile(base.label[:, None], 4) + (np.arange(4) >= frames))

    found = summarised(*({"no-act": right(1), "nbv": right(1 + gain)} for gain in (1, 2, 3)))
    (of,) = found.differences
    assert (of.difference.acc_mean, of.sd) == (pytest.approx(50), pytest.approx(25))
    half = student.ppf(0.975, 2) * 25 / np.sqrt(3)
    assert of.difference.ci95_corrected is not None
    # Three trainings have seven different means, so a bootstrap of them is coarse, on the safe side.
    assert half <= of.difference.ci95_corrected[1] - 50 <= 1.3 * half
    assert not of.difference.is_clear


def test_planners_of_one_training_are_drawn_together() -> None:
    # Trainings differ by far, but nbv is 25 points above no-act in each of them.
    base = make_records(0, episodes=60, people=6)

    def right(frames: int) -> EpisodeRecords:
        return replace(base, predicted=np.tile(base.label[:, None], 4) + (np.arange(4) >= frames))

    found = summarised(*({"no-act": right(frames), "nbv": right(frames + 1)} for frames in (0, 1, 3)))
    assert found.planners[1].acc_mean_sd > 35
    assert found.differences[0].difference.ci95_corrected == pytest.approx((25, 25))


def test_a_planner_s_own_seeds_are_averaged_first() -> None:
    runs = [
        {
            **training(seed),
            "il/0": make_records(seed, people=6, episodes=60),
            "il/1": make_records(seed + 9, skill=2.0, people=6, episodes=60),
        }
        for seed in (1, 2)
    ]
    found = {planner.name: planner for planner in summarised(*runs).planners}
    assert found["il"].acc_mean == pytest.approx(
        np.mean([100 * run[name].correct.mean() for run in runs for name in ("il/0", "il/1")])
    )


def test_no_gap_and_no_intervals_are_none() -> None:
    runs = [training(1), {**training(2), "oracle": training(2)["no-act"]}]
    assert all(planner.gap_closed is None and planner.gap_closed_ci95 is None for planner in summarised(*runs).planners)
    single = [
        {name: replace(held, sequence=("only",) * 60, subjects=np.full((60, 1), 3)) for name, held in run.items()}
        for run in runs
    ]
    found = summarised(*single)
    assert found.no_intervals is not None and "one sequence" in found.no_intervals
    assert {planner.acc_mean_ci95 for planner in found.planners} == {None}
    assert {of.difference.ci95_corrected for of in found.differences} == {None}


def test_a_planner_that_is_not_in_all_runs_is_named() -> None:
    without = training(2)
    del without["nbv"]
    with pytest.raises(
        UsageError, match=r"no planner 'nbv' without the truth in all 2 runs; expected one of: no-act, h-"
    ):
        summarised(training(1), without)
    with pytest.raises(UsageError, match="no planner 'oracle' without the truth"):
        summarised(training(1), training(2), planner="oracle")
