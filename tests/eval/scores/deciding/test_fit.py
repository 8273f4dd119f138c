"""Rules are fitted to a price: by exhaustion where that is possible, and induction against an exact solution."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.errors import DataError
from eval.scores.deciding.fit import (
    Seen,
    fit_fixed_time,
    fit_induction,
    fit_sprt,
    fit_threshold,
    seen_in,
    worth_of,
)
from eval.scores.deciding.rules import FixedTime, Sprt, Threshold, Words, decide
from tests.helpers.made_records import make_stream_records
from tests.helpers.words import words_of

SECONDS = 0.1
FITS = (fit_fixed_time, fit_threshold, fit_sprt, fit_induction)


def coin(*, activities: int = 4000, frames: int = 12, seed: int = 0, shortest: int | None = None) -> Seen:
    """Return activities of two classes: each frame adds a normal log-likelihood ratio, and the posterior is exact."""
    rng = np.random.default_rng(seed)
    label, drift = rng.integers(0, 2, activities), 0.4
    steps = drift * (2 * label[:, None] - 1) + np.sqrt(2 * drift) * rng.standard_normal((activities, frames))
    ratio = np.cumsum(steps, axis=1)
    one = 1 / (1 + np.exp(-ratio))
    shown = None
    if shortest is not None:
        shown = np.arange(frames) < rng.integers(shortest, frames + 1, activities)[:, None]
    return Seen(words_of(np.stack([1 - one, one], axis=-1), shown), label, SECONDS)


def exact_worth(price: float, seen: Seen, bins: int = 60) -> float:
    """Return the worth of the best rule that knows frame and log-odds, from counts of a fine chain of them."""
    edges = np.quantile(seen.words.odds, np.linspace(0, 1, bins + 1)[1:-1])
    state = np.searchsorted(edges, seen.words.odds)
    frames = state.shape[1]
    now = 100.0 * seen.right - price * SECONDS * np.arange(1, frames + 1)
    value = np.array(
        [now[state[:, -1] == bin_, -1].mean() if (state[:, -1] == bin_).any() else 0 for bin_ in range(bins)]
    )
    for frame in range(frames - 2, -1, -1):
        later = value
        value = np.zeros(bins)
        for bin_ in range(bins):
            here = state[:, frame] == bin_
            if here.any():
                value[bin_] = max(now[here, frame].mean(), later[state[here, frame + 1]].mean())
        counts = np.bincount(state[:, frame], minlength=bins)
    return float(counts @ value / counts.sum())


def test_fixed_time_and_thresholds_are_the_best_of_all() -> None:
    seen = coin(activities=200)
    price = 40.0
    time = fit_fixed_time(seen, price)
    assert all(
        worth_of(time, seen, price).mean() >= worth_of(FixedTime(frame), seen, price).mean() for frame in range(12)
    )
    for fitted, kind, values in (
        (fit_threshold(seen, price), Threshold, seen.words.odds),
        (fit_sprt(seen, price), Sprt, seen.words.lead),
    ):
        best = max(worth_of(kind(bound), seen, price).mean() for bound in np.unique(values))
        assert worth_of(fitted, seen, price).mean() == pytest.approx(best, abs=0.5)


@pytest.mark.parametrize("price", [3.0, 20.0, 60.0])
def test_induction_is_nearly_as_good_as_the_exact_solution(price: float) -> None:
    """On other activities than it is fitted on."""
    scored = coin(activities=20_000, seed=2)
    found = worth_of(fit_induction(coin(), price), scored, price).mean()
    assert found > exact_worth(price, scored) - 1.0
    assert found > worth_of(fit_fixed_time(coin(), price), scored, price).mean() + 0.3


def test_without_a_price_it_waits_while_it_learns_and_with_a_high_one_it_does_not() -> None:
    seen = coin()
    waits, hurries = (decide(fit_induction(seen, price), seen.words).frame.mean() for price in (0.0, 1e4))
    assert waits > 6
    assert hurries == 0


@pytest.mark.parametrize("fit", FITS)
def test_a_dearer_price_is_never_a_later_answer(fit) -> None:
    seen = coin(activities=500)
    times = [decide(fit(seen, price), seen.words).frame.mean() for price in (1.0, 10.0, 100.0, 1000.0)]
    assert times == sorted(times, reverse=True)
    assert times[0] > times[-1]


@pytest.mark.parametrize("fit", FITS)
def test_frames_after_the_end_do_not_matter(fit) -> None:
    seen = coin(activities=300, shortest=3)
    other = np.where(seen.words.shown[..., None], np.stack([1 - seen.words.top, seen.words.top], -1), 0.5)
    rule = fit(seen, 20.0)
    ended = decide(rule, seen.words)
    assert (ended.frame <= seen.words.last).all()
    blank = words_of(np.where((seen.words.answer == 0)[..., None], other[..., ::-1], other), seen.words.shown)
    again = fit(Seen(blank, seen.label, SECONDS), 20.0)
    np.testing.assert_array_equal(decide(again, blank).frame, ended.frame)


def test_a_price_that_is_too_high_is_an_answer_at_once_whatever_is_seen() -> None:
    unsure = coin(seed=3).words
    for fit in FITS:
        assert (decide(fit(coin(activities=50), 1e4), unsure).frame == 0).all()


def test_a_rule_holds_for_longer_activities_than_it_was_fitted_on() -> None:
    rule = fit_induction(coin(frames=6), 5.0)
    decisions = decide(rule, coin(frames=12).words)
    assert decisions.frame.max() > 6


def silent_at_first(seen: Seen, frames: int) -> Seen:
    """Return activities of which nothing is said in the first frames: no activity is the word, and it is sure."""
    first = np.arange(seen.words.shown.shape[1]) < frames
    words = replace(
        seen.words, answer=np.where(first, -1, seen.words.answer), top=np.where(first, 0.99, seen.words.top)
    )
    return Seen(words, seen.label, SECONDS)


@pytest.mark.parametrize("fit", FITS)
def test_being_sure_of_no_activity_says_nothing_of_when_to_answer(fit) -> None:
    """The bounds are as good as those that are fitted on the words behind the silence alone."""
    quiet, price = silent_at_first(coin(), 4), 20.0
    rule = fit(quiet, price)
    decisions = decide(rule, quiet.words)
    assert (decisions.frame >= 4).all() and (decisions.answer >= 0).all()
    words = quiet.words
    behind = replace(words, **{name: getattr(words, name)[:, 4:] for name in ("answer", "top", "second", "shown")})
    alone = worth_of(fit(Seen(behind, quiet.label, SECONDS), price), Seen(behind, quiet.label, SECONDS), price)
    assert worth_of(rule, quiet, price).mean() == pytest.approx(alone.mean() - 4 * SECONDS * price, abs=0.5)


@pytest.mark.parametrize("fit", FITS)
def test_who_never_names_an_activity_never_answers(fit) -> None:
    mute = silent_at_first(coin(activities=50), 12)
    rule = fit(mute, 20.0)
    assert (decide(rule, mute.words).answer == -1).all()
    np.testing.assert_allclose(worth_of(rule, mute, 20.0), -20 * 12 * SECONDS)


def test_activities_of_streams_have_their_own_lengths_and_labels() -> None:
    labels = np.array([[-1, 1, 1, -1, 0, 0, 0, -1]])
    seen = seen_in(make_stream_records(labels, labels), SECONDS)
    assert seen.label.tolist() == [1, 0]
    np.testing.assert_array_equal(seen.right, [[True, True, True], [True, True, True]])
    np.testing.assert_array_equal(seen.words.last, [1, 2])


def test_nothing_to_fit_on_is_refused() -> None:
    words = coin(activities=3).words
    with pytest.raises(
        DataError, match="expected a label for each activity, at least 1, got 2 labels for 3 activities"
    ):
        Seen(words, np.array([0, 1]), SECONDS)


def test_induction_knows_a_moment_that_nothing_said_tells_of() -> None:
    """Answers are right for a while after the onset, and nothing but time tells: a fixed time is best."""
    rng = np.random.default_rng(0)
    label, frames = np.zeros(120, dtype=np.int64), np.arange(50)
    chance = np.where((frames >= 6) & (frames < 9), 0.9, 0.3)
    answer = np.where(rng.random((120, 50)) < chance, 0, 1)
    top, shown = 0.5 + 0.4 * rng.random((120, 50)), np.ones((120, 50), dtype=np.bool_)
    seen = Seen(Words(answer, top, (1 - top) / 2, shown), label, 0.1, np.arange(120) // 10)
    fit, held = seen.select(np.arange(120) < 60), seen.select(np.arange(120) >= 60)
    fixed, found, unchosen = (
        worth_of(rule, held, 1.0).mean()
        for rule in (fit_fixed_time(fit, 1.0), fit_induction(fit, 1.0), fit_induction(replace(fit, sequence=None), 1.0))
    )
    assert fixed > 80 and found > fixed - 5 and unchosen < found - 5
