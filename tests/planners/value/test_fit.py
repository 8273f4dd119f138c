"""Fits of gain fields: known fields are found again, noise is not, and no sequence is fitted and tested on."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.arrays import FloatArray, IntArray
from planners.value import fit as gain_fit
from planners.value.belief.clips import BeliefModel
from planners.value.collection import Collection
from planners.value.field import GainField
from planners.value.fit import VARIANTS, Fit, Scores, fork_situations
from planners.value.situation import PARTS
from planners.value.view_basis import BASIS_SIZE, PAPER_RANGE, basis_at, field_value, mean_direction
from tests.helpers.gain_models import random_situation

BELIEF = BeliefModel()
LENGTH = 12
PATHS = 5


def fit_field(
    collection: Collection, belief: BeliefModel, parts: tuple[str, ...], groups: IntArray | None = None
) -> Fit:
    return gain_fit.fit_field(collection, fork_situations(collection, belief), parts, groups)


def score_field(field: GainField, collection: Collection, belief: BeliefModel) -> Scores:
    return gain_fit.score_field(field, collection, fork_situations(collection, belief))


def random_viewpoints(rng: np.random.Generator, *leading: int) -> FloatArray:
    return rng.uniform([5, 0, 0], [15, 2 * np.pi, np.pi / 2], (*leading, 3))


def collected(rng: np.random.Generator, *, forks: int = 300, persons: int = 1, hidden: bool = False) -> Collection:
    """Return forks, one in each episode, with paths over random views that are worth nothing yet.

    With `hidden`, views show any share of people.
    """
    log_probs = np.log(rng.dirichlet(np.ones(3), (forks, LENGTH)))
    viewpoints = random_viewpoints(rng, forks, LENGTH)
    drawn = random_situation(rng, episodes=forks, persons=persons)
    visited = random_viewpoints(rng, forks, PATHS, 3)
    frame = rng.integers(0, LENGTH - 1, forks)
    visited[:, 0] = viewpoints[np.arange(forks), frame][:, None]
    seen = rng.uniform(size=(forks, PATHS, 3, 1)) if hidden else 1.0
    return Collection(
        log_probs=log_probs,
        viewpoints=viewpoints,
        labels=rng.integers(0, 3, forks),
        sequences=rng.integers(0, 60, forks),
        episode=np.arange(forks),
        frame=frame,
        frames=LENGTH - 1 - frame,
        facing=drawn.facing,
        facing_std=drawn.facing_std,
        position=drawn.position,
        embedding=drawn.embedding,
        worth=np.zeros((forks, PATHS)),
        path=(seen * basis_at(visited, PAPER_RANGE)).mean(axis=2),
    )


def worth(
    rng: np.random.Generator, collection: Collection, field: GainField, *, noise: float = 0.0, exactly: bool = False
) -> Collection:
    """Return the collection with what the paths are worth by a field, and what is the same along all of a fork's."""
    weights = field.weights(fork_situations(collection, BELIEF))
    gain = np.einsum("npk,nk->np", collection.path, weights)
    gain += field.spread * (collection.path[..., 0] ** 2 - (mean_direction(collection.path) ** 2).sum(axis=-1))
    gain += noise * rng.normal(size=gain.shape) + rng.normal(size=(len(gain), 1))
    return replace(collection, worth=gain)


def known_field(rng: np.random.Generator, *, spread: float = 0.0) -> GainField:
    """Return a field of the ratio and the facing that favours no constant, as what is not to be known."""
    absolute, relative = rng.normal(size=(2, 1 + 1 + 5, BASIS_SIZE)) / 5
    absolute[:, 0] = relative[:, 0] = 0
    return GainField(("ratio", "facing"), absolute, relative, spread)


def agreement(found: GainField, known: GainField, rng: np.random.Generator) -> float:
    """Return the share of the variance over views, in situations not fitted on, that is found."""
    situation = fork_situations(collected(rng, forks=40), BELIEF)
    views = random_viewpoints(rng, 1, 50)
    values = [field_value(field.weights(situation)[:, None], views, PAPER_RANGE) for field in (found, known)]
    fitted, true = (value - value.mean(axis=1, keepdims=True) for value in values)
    return float(1 - ((fitted - true) ** 2).sum() / (true**2).sum())


@pytest.fixture
def hardly_any_penalty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gain_fit, "PENALTIES", (1e-9,))
    monkeypatch.setattr(gain_fit, "CONSTANT_SHARES", (1.0,))


@pytest.mark.usefixtures("hardly_any_penalty")
@pytest.mark.parametrize("spread", [0.0, 0.7])
def test_a_known_field_is_found_again(spread: float) -> None:
    rng = np.random.default_rng(0)
    known = known_field(rng, spread=spread)
    fit = fit_field(worth(rng, collected(rng), known), BELIEF, known.parts)
    assert fit.field.parts == known.parts
    assert fit.field.spread == pytest.approx(spread, abs=1e-4)
    assert agreement(fit.field, known, rng) > 1 - 1e-6
    assert fit.scores.explained > 0.99
    assert fit.scores.chosen_gain == pytest.approx(fit.scores.best_gain, rel=0.01)


@pytest.mark.usefixtures("hardly_any_penalty")
@pytest.mark.parametrize("spread", [0.0, 0.7])
def test_where_views_are_hidden_at_times_what_seeing_is_worth_is_found_too(spread: float) -> None:
    rng = np.random.default_rng(0)
    known = known_field(rng, spread=spread)
    known.absolute[:, 0] = rng.normal(size=len(known.absolute))
    fit = fit_field(worth(rng, collected(rng, hidden=True), known), BELIEF, known.parts)
    assert fit.field.knows_hidden
    assert fit.field.spread == pytest.approx(spread, abs=1e-4)
    situation = fork_situations(collected(rng, forks=40), BELIEF)
    np.testing.assert_allclose(*(field.weights(situation)[:, 0] for field in (fit.field, known)), atol=1e-3)
    assert agreement(fit.field, known, rng) > 1 - 1e-6
    assert fit.scores.explained > 0.99


@pytest.mark.usefixtures("hardly_any_penalty")
def test_in_the_open_a_field_does_not_know_what_seeing_is_worth() -> None:
    rng = np.random.default_rng(0)
    known = known_field(rng)
    assert not fit_field(worth(rng, collected(rng), known), BELIEF, known.parts).field.knows_hidden


@pytest.mark.usefixtures("hardly_any_penalty")
def test_what_is_relative_and_what_is_not_are_told_apart() -> None:
    rng = np.random.default_rng(1)
    known = known_field(rng)
    fit = fit_field(worth(rng, collected(rng, forks=500), known), BELIEF, known.parts)
    # Functions of the height and the distance alone are the same counted from anywhere.
    told_apart = np.setdiff1d(np.arange(BASIS_SIZE), [0, 2, 6, 12, 16, 17, 20])
    situation = fork_situations(collected(rng, forks=40), BELIEF)
    nothing = np.zeros_like(known.absolute)
    for matrix in ("absolute", "relative"):
        found, true = (
            replace(field, **{"absolute": nothing, "relative": nothing, matrix: getattr(field, matrix)})
            for field in (fit.field, known)
        )
        np.testing.assert_allclose(
            found.weights(situation)[:, told_apart], true.weights(situation)[:, told_apart], atol=1e-3
        )


def test_with_the_penalties_that_are_tried_most_of_a_steady_field_is_found() -> None:
    rng = np.random.default_rng(2)
    known = known_field(rng)
    steady = replace(known, absolute=known.absolute * (np.arange(7) == 0)[:, None], relative=known.relative * 0)
    fit = fit_field(worth(rng, collected(rng), steady, noise=0.02), BELIEF, known.parts)
    assert fit.scores.explained > 0.9
    assert agreement(fit.field, steady, rng) > 0.9
    assert 0.9 * fit.scores.best_gain < fit.scores.chosen_gain <= fit.scores.best_gain


def test_penalties_grow_with_noise_and_pure_noise_is_not_believed() -> None:
    fits = []
    for noise in (0.01, 1.0, 30.0):
        rng = np.random.default_rng(3)
        known = known_field(rng)
        fits.append(fit_field(worth(rng, collected(rng), known, noise=noise), BELIEF, known.parts))
    assert fits[0].penalties[0] < fits[2].penalties[0]
    assert fits[0].penalties[1] < fits[2].penalties[1]
    assert fits[0].scores.explained > fits[1].scores.explained > fits[2].scores.explained
    assert fits[2].scores.explained < 0.02


def test_a_negative_spread_is_none() -> None:
    rng = np.random.default_rng(4)
    collection = collected(rng)
    same_views = (mean_direction(collection.path) ** 2).sum(axis=-1)
    fitted = fit_field(replace(collection, worth=same_views), BELIEF, ("ratio",))
    assert fitted.field.spread == 0
    # The rest is solved for without it: what is saved does as well on these rollouts as what was cross-validated.
    saved = score_field(fitted.field, replace(collection, worth=same_views), BELIEF)
    assert saved.explained > fitted.scores.explained
    assert fit_field(replace(collection, worth=-same_views), BELIEF, ("ratio",)).field.spread > 0.5


def test_no_sequence_is_fitted_and_tested_on() -> None:
    # What looking is worth depends on the sequence alone, and the embedding says which it is. To know some sequences
    # tells nothing of others; if their own forks were among what is fitted, it would tell nearly everything.
    rng = np.random.default_rng(5)
    collection = collected(rng, forks=400)
    sequences = np.arange(400) % 12
    weights = rng.normal(size=(12, BASIS_SIZE))
    gain = np.einsum("npk,nk->np", collection.path, weights[sequences])
    known = replace(collection, sequences=sequences, embedding=10 * np.eye(12)[sequences], worth=gain)
    grouped = fit_field(known, BELIEF, ("embedding",))
    assert grouped.scores.explained < 0.15
    each_its_own = fit_field(replace(known, sequences=np.arange(400)), BELIEF, ("embedding",))
    assert each_its_own.scores.explained > 0.4


def test_no_person_is_fitted_and_tested_on() -> None:
    # As above, but what looking is worth depends on the person: to hold out sequences alone does not help.
    rng = np.random.default_rng(5)
    collection = collected(rng, forks=400)
    person = np.arange(400) % 12
    weights = rng.normal(size=(12, BASIS_SIZE))
    gain = np.einsum("npk,nk->np", collection.path, weights[person])
    known = replace(collection, sequences=np.arange(400), embedding=10 * np.eye(12)[person], worth=gain)
    assert fit_field(known, BELIEF, ("embedding",)).scores.explained > 0.4
    assert fit_field(known, BELIEF, ("embedding",), person).scores.explained < 0.15


def test_scores_of_the_true_field_and_of_its_opposite() -> None:
    rng = np.random.default_rng(2)
    known = known_field(rng)
    collection = worth(rng, collected(rng), known)
    scores = score_field(known, collection, BELIEF)
    assert scores.explained == pytest.approx(1)
    assert scores.chosen_gain == pytest.approx(scores.best_gain)
    opposite = score_field(replace(known, absolute=-known.absolute, relative=-known.relative), collection, BELIEF)
    assert opposite.explained < 0
    assert opposite.chosen_gain < 0


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("persons", [1, 2])
def test_variants_depend_on_their_parts(variant: str, persons: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gain_fit, "PENALTIES", (1.0,))
    monkeypatch.setattr(gain_fit, "CONSTANT_SHARES", (0.1,))
    rng = np.random.default_rng(6)
    collection = collected(rng, forks=120, persons=persons)
    collection = replace(collection, worth=rng.normal(size=collection.worth.shape))
    field = fit_field(collection, BELIEF, VARIANTS[variant]).field
    sizes = {"ratio": 1, "history": 9, "belief": 3, "embedding": 4, "facing": 5 * persons}
    assert field.parts == VARIANTS[variant]
    assert field.absolute.shape == (1 + sum(sizes[part] for part in field.parts), BASIS_SIZE)
    assert (np.abs(field.relative).max() > 0) == ("facing" in field.parts)
    assert (field.absolute[:, 0] == 0).all()
    field.weights(fork_situations(collection, BELIEF))
    assert VARIANTS["full"] == PARTS
    assert variant == "full" or set(PARTS) - set(field.parts) == {variant.removeprefix("no-")}


@pytest.mark.parametrize("parts", [("embedding",), ("belief", "embedding", "facing")])
def test_only_the_embedding_s_main_directions_are_used(parts: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gain_fit, "EMBEDDING_DIRECTIONS", 2)
    rng = np.random.default_rng(7)
    collection = collected(rng)
    large = rng.normal(size=(300, 2))
    embedding = np.concatenate([10 * large, 0.1 * rng.normal(size=(300, 3)), np.ones((300, 1))], axis=1)
    collection = replace(collection, embedding=embedding, worth=rng.normal(size=(300, PATHS)))
    field = fit_field(collection, BELIEF, parts).field
    before = 1 + 3 * ("belief" in parts)
    rows = field.absolute[before : before + 6, 1:]
    assert np.linalg.matrix_rank(rows, tol=1e-9) == 2
    assert np.abs(rows[:2] * 10).max() > 10 * np.abs(rows[2:] * 0.1).max()


def test_neither_the_unit_of_an_embedding_nor_its_mean_matters() -> None:
    rng = np.random.default_rng(10)
    collection = collected(rng)
    collection = replace(collection, worth=rng.normal(size=(300, PATHS)) + collection.embedding[:, :1])
    other = replace(collection, embedding=7 * collection.embedding + np.arange(4))
    first, second = (fit_field(each, BELIEF, ("ratio", "embedding")) for each in (collection, other))
    assert second.penalties == first.penalties
    assert second.scores.explained == pytest.approx(first.scores.explained, abs=1e-9)
    np.testing.assert_allclose(
        second.field.weights(fork_situations(other, BELIEF)),
        first.field.weights(fork_situations(collection, BELIEF)),
        atol=1e-8,
    )


def test_a_feature_that_never_changes_has_no_weight() -> None:
    rng = np.random.default_rng(8)
    collection = collected(rng)
    collection = replace(collection, frame=np.full(300, 4), worth=rng.normal(size=(300, PATHS)))
    field = fit_field(collection, BELIEF, ("ratio",)).field
    np.testing.assert_array_equal(field.absolute[1], 0)


def test_situations_at_forks_are_those_of_their_frames() -> None:
    rng = np.random.default_rng(9)
    collection = collected(rng, forks=20)
    situation = fork_situations(collection, BELIEF)
    for fork in range(20):
        frame = collection.frame[fork]
        assert situation.ratio[fork] == pytest.approx((frame + 1) / LENGTH)
        seen = basis_at(collection.viewpoints[fork, : frame + 1], PAPER_RANGE).mean(axis=0)
        np.testing.assert_allclose(situation.seen[fork], seen, atol=1e-12)
        # The default belief is the recogniser's.
        np.testing.assert_allclose(situation.belief[fork], np.exp(collection.log_probs[fork, frame]), atol=1e-2)
