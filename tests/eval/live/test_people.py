"""The same person keeps the same place, in whatever order people are given."""

import numpy as np

from eval.live.people import FORGET, People, Placed

BODY = np.array([[0.0, -90.0, 1.0], [0.0, 0.0, 1.0], [0.0, 90.0, 1.0]])


def at(x: float, *, size: float = 1.0) -> np.ndarray:
    return BODY * (size, size, 1.0) + (x, 300.0, 0.0)


def places(placed: Placed) -> list[float]:
    return [float(joints[1, 0]) if joints[1, 2] else -1.0 for joints in placed.joints]


def test_people_in_another_order_keep_their_places() -> None:
    people = People(2, 3)
    assert places(people.place([at(200), at(600)], [None, None], 0.0)) == [200, 600]
    assert places(people.place([at(590), at(210)], [None, None], 0.1)) == [210, 590]
    assert places(people.place([at(580)], [None], 0.2)) == [-1, 580]
    assert places(people.place([at(570), at(220)], [None, None], 0.3)) == [220, 570]


def test_a_tracker_knows_better_where_people_cross() -> None:
    people = People(2, 3)
    people.place([at(300), at(400)], ["a", "b"], 0.0)
    assert places(people.place([at(310), at(390)], ["b", "a"], 0.1)) == [390, 310]
    assert places(people.place([at(320), at(380)], ["c", "a"], 0.2)) == [380, 320]  # b has a new name


def test_who_is_gone_gives_up_the_place_after_a_while() -> None:
    people = People(1, 3)
    people.place([at(200)], [None], 0.0)
    far = people.place([at(900)], [None], 0.5)
    assert places(far) == [-1] and far.left_out == 1
    assert places(people.place([at(900)], [None], FORGET + 0.1)) == [900]


def test_of_too_many_the_larger_are_taken_and_kept() -> None:
    people = People(1, 3)
    first = people.place([at(200, size=0.5), at(600)], [None, None], 0.0)
    assert places(first) == [600] and first.left_out == 1
    assert places(people.place([at(610, size=0.9), at(200, size=2.0)], [None, None], 0.1)) == [610]


def test_people_of_whom_nothing_is_seen_hold_no_place() -> None:
    people = People(1, 3)
    nobody = np.zeros((3, 3))
    people.place([nobody], [None], 0.0)
    assert places(people.place([at(200)], [None], 0.1)) == [200]


def test_a_new_beginning_forgets_everybody() -> None:
    people = People(2, 3)
    people.place([at(200), at(600)], [None, None], 0.0)
    people.start()
    assert places(people.place([at(600), at(200)], [None, None], 0.1)) == [600, 200]
