import numpy as np
import pytest

from ehar.arrays import FloatArray, IntArray
from eval.studies.headroom.class_maps import (
    Watched,
    best_per_class,
    chosen_by_others,
    class_maps,
    class_tables,
    how_far_apart,
    scores_at,
    worth_on_the_same,
)

FRONT, LEFT, BACK, RIGHT, ABOVE = range(5)
LEVEL = np.pi / 2
PLACES = np.array([[10, 0, LEVEL], [10, np.pi / 2, LEVEL], [10, np.pi, LEVEL], [10, -np.pi / 2, LEVEL], [10, 0, 0]])
NAMES = ("bow", "kick")


def watched(acc: FloatArray, labels: IntArray, people: IntArray) -> Watched:
    """Return episodes of a sequence each; those of the first person only help to choose."""
    return Watched(acc, labels, np.arange(len(acc)), people[:, None], people > 0)


def two_classes(best: tuple[int, int], *, noise: float = 0.0, people: int = 8, takes: int = 2) -> Watched:
    """Return people who perform two classes, each of which is right in 90 % at its best place and in 60 % elsewhere."""
    person, labels, _ = (grid.ravel() for grid in np.meshgrid(range(people), range(2), range(takes), indexing="ij"))
    acc = np.full((len(labels), len(PLACES)), 60.0)
    acc[np.arange(len(labels)), np.array(best)[labels]] = 90.0
    return watched(acc + noise * np.random.default_rng(3).standard_normal(acc.shape), labels, person)


def test_best_per_class_by_hand() -> None:
    acc = np.array([[1.0, 0.0], [0.0, 1.0], [0.2, 0.9]])
    assert best_per_class(acc, np.array([0, 1, 1]), 3).tolist() == [0, 1, 1]


def test_classes_that_share_a_place_make_the_class_worth_nothing() -> None:
    maps = class_maps(two_classes((LEFT, LEFT)), PLACES, NAMES)
    assert (maps.worth, maps.worth_same, maps.apart.classes) == (0, 0, 0)
    assert maps.ends == (0, 0)
    assert [(row.azimuth_deg, row.polar_deg, row.own, row.one) for row in maps.classes] == [(90, 90, 90, 90)] * 2


def test_classes_that_are_best_seen_from_two_places_are_worth_what_they_were_made_to_be() -> None:
    # One of the classes is seen at its best from the one best place, the other one loses 30 points there.
    maps = class_maps(two_classes((FRONT, RIGHT)), PLACES, NAMES)
    assert maps.worth == pytest.approx(15)
    assert sorted(row.gain for row in maps.classes) == [0, 30]
    assert maps.apart == pytest.approx((90, 90, 0), abs=1e-5)
    assert [row.azimuth_deg for row in maps.classes] == [0, -90]
    opposite = class_maps(two_classes((FRONT, BACK)), PLACES, NAMES)
    assert opposite.apart.classes == pytest.approx(180)
    assert [row.azimuth_deg for row in opposite.classes] == [0, 180]
    assert class_maps(two_classes((FRONT, ABOVE)), PLACES, NAMES).apart.classes == pytest.approx(90)


def noise(rng: np.random.Generator, *, people: int = 10) -> Watched:
    """Return people who perform two classes twice, which are seen equally well from everywhere."""
    acc = 50 + 30 * rng.standard_normal((4 * people, len(PLACES)))
    return watched(acc, np.tile([0, 0, 1, 1], people), np.repeat(np.arange(people), 4))


def test_noise_is_worth_nothing_where_others_choose() -> None:
    # Choosing on the episodes that are scored shows a gain where there is none.
    rng, honest, same = np.random.default_rng(0), [], []
    for _ in range(300):
        held = noise(rng)
        chosen = chosen_by_others(held)
        honest.append((scores_at(held, chosen.own) - scores_at(held, chosen.one)).mean())
        same.append(worth_on_the_same(held.acc[held.scored], held.labels[held.scored]))
    error = np.std(honest) / np.sqrt(len(honest))
    assert error < 0.5
    assert abs(np.mean(honest)) < 3 * error
    assert np.mean(same) > 2


def test_noise_puts_places_of_one_class_as_far_apart_as_those_of_two() -> None:
    rng = np.random.default_rng(1)
    _, classes, same = np.mean([how_far_apart(noise(rng, people=30), PLACES) for _ in range(10)], axis=0)
    assert same > 45
    assert same == pytest.approx(classes, rel=0.25)


def test_nobody_chooses_for_episodes_in_which_he_performs() -> None:
    # Couples (0, 1), (1, 2) and (3, 4): the third chooses for the first and the second, and they for the third.
    subjects = np.array([[0, 1], [2, 1], [3, 4], [4, 3]])
    acc = np.array([[9.0, 0, 0], [9.0, 0, 0], [0, 9.0, 0], [0, 9.0, 0]])
    chosen = chosen_by_others(Watched(acc, np.zeros(4, dtype=int), np.arange(4), subjects, np.ones(4, dtype=bool)))
    assert chosen.one.tolist() == chosen.own.tolist() == [1, 1, 0, 0]
    assert chosen.by_strangers


@pytest.mark.parametrize("person", [-1, 7])
def test_without_other_people_other_sequences_choose_and_the_table_says_so(person: int) -> None:
    acc, labels = np.array([[9.0, 0], [9.0, 0], [0, 9.0], [0, 9.0]]), np.array([0, 0, 1, 1])
    held = Watched(acc, labels, np.array([0, 0, 1, 2]), np.full((4, 1), person), np.ones(4, dtype=bool))
    chosen = chosen_by_others(held)
    assert not chosen.by_strangers
    assert chosen.own.tolist() == [1, 1, 1, 1]  # nothing else shows class 0, so it goes where all classes go
    assert "other sequences" in class_tables(class_maps(held, PLACES[:2], NAMES), "the front")[0].footnotes[1]


def test_intervals_cover_people() -> None:
    maps = class_maps(two_classes((FRONT, RIGHT), noise=20.0, people=20), PLACES, NAMES)
    assert maps.ends is not None
    assert maps.ends[0] < maps.worth < maps.ends[1]
    assert maps.ends[0] > 0
    assert "19 people" in maps.basis
