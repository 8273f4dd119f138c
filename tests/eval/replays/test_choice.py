from dataclasses import replace

import numpy as np
import pytest

from eval.records.episodes import EpisodeRecords
from eval.replays.choice import choose_episodes, choose_planners
from eval.scores.metrics import mean_acc
from tests.helpers.made_records import make_records, make_stream_records


def planners(episodes: int = 30) -> dict[str, EpisodeRecords]:
    return {name: make_records(seed, skill=seed, episodes=episodes) for seed, name in enumerate(("no-act", "a", "b"))}


def test_best_and_worst_come_first_and_no_episode_twice() -> None:
    records = planners()
    gain = mean_acc(records["a"].correct) - mean_acc(records["no-act"].correct)
    chosen = choose_episodes(records, "a", "no-act")
    assert gain[chosen[0].episode] == gain.max()
    assert gain[chosen[1].episode] == gain.min()
    assert chosen[0].why == f"a gains most against no-act: {100 * gain.max():+.0f} points"
    assert chosen[1].why == f"a loses most against no-act: {100 * gain.min():+.0f} points"
    assert len({one.episode for one in chosen}) == len(chosen) == 8


def test_the_telling_three_are_chosen_among_all_classes_and_the_others_from_classes_not_shown_yet() -> None:
    right = {"no-act": [2, 2, 2, 2, 2, 2], "a": [4, 0, 2, 0, 3, 1]}  # frames of 4
    label = np.array([0, 0, 0, 0, 1, 1])
    held = replace(make_records(1, episodes=6), label=label)
    records = {
        name: replace(held, predicted=np.where(np.arange(4) < np.array(frames)[:, None], label[:, None], 2))
        for name, frames in right.items()
    }
    chosen = choose_episodes(records, "a", "no-act")
    assert [one.episode for one in chosen] == [0, 1, 2, 4, 5, 3]
    assert chosen[1].why == "a loses most against no-act: -50 points"
    assert chosen[2].why == "typical: a is nearest to its median against no-act, +0 points"


def test_classes_take_turns_where_planners_differ() -> None:
    records = planners()
    labels = [int(records["a"].label[one.episode]) for one in choose_episodes(records, None, None, most=6)]
    assert np.bincount(labels).tolist() == [2, 2, 2]


def test_of_one_class_several_are_chosen_and_of_few_episodes_all() -> None:
    records = {name: replace(record, label=np.zeros(4, dtype=int)) for name, record in planners(4).items()}
    assert sorted(one.episode for one in choose_episodes(records, "b", "no-act")) == [0, 1, 2, 3]


def test_a_planner_alone_is_chosen_for_by_spread() -> None:
    chosen = choose_episodes({"{x}": make_records(1)}, None, None, most=2)
    assert [one.why for one in chosen] == ["planners differ: a standard deviation of 0 points between them"] * 2


def test_names_with_braces_are_names() -> None:
    records = {"no-act": make_records(1), "{a}": make_records(2)}
    assert choose_episodes(records, "{a}", "no-act", most=1)[0].why.startswith("{a} gains most against no-act")


@pytest.mark.parametrize(
    ("names", "lead", "shown"),
    [
        (["no-act", "a", "b"], "b", ("b", "no-act")),
        (["a", "b"], "b", ("b",)),
        (["no-act", "oracle"], None, ("no-act",)),
        (["oracle", "no-act"], None, ("oracle", "no-act")),
    ],
)
def test_the_lead_is_shown_first_beside_no_act(names: list[str], lead: str | None, shown: tuple[str, ...]) -> None:
    assert choose_planners(names, lead) == shown


def test_streams_are_chosen_by_their_activities_and_not_by_frames_that_show_none() -> None:
    label = np.full((3, 20), -1)
    label[:2, 12:16] = 0  # the third shows no activity
    shown = label == 0
    stays = np.where(shown, [[1], [0], [0]], -1)  # wrong on the first activity, right in all else
    moves = np.where(shown, [[0], [1], [0]], [[1], [-1], [1]])  # the other way round, and wrong where nothing is shown
    records = {"no-act": make_stream_records(label, stays), "a": make_stream_records(label, moves)}
    assert [(one.episode, one.why) for one in choose_episodes(records, "a", "no-act")] == [
        (0, "a gains most against no-act: +100 points"),
        (1, "a loses most against no-act: -100 points"),
    ]
