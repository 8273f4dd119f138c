"""Where each class is best seen, how far apart these places are, and what it is worth to know the class."""

from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.data.recordings import UNKNOWN_SUBJECT
from ehar.viewpoint import AZIMUTH, POLAR, wrap_difference
from eval.render.tables import Table, interval_text
from eval.scores.resampling.resamples import resample_episodes
from eval.scores.resampling.statistics import Interval, pair
from eval.studies.headroom.places import angles_between

HALVINGS = 50  # ways to cut the people into halves that choose places
HALVES_SEED = 0  # the halves are properties of the episodes, not of a run


@dataclass(frozen=True, eq=False)
class Watched:
    """N episodes, each watched from M places that stay.

    Args:
        acc: (N, M) accuracy [%], mean over frames.
        labels: (N,) true class.
        sequence: (N,) sequence of each episode.
        subjects: (N, P), who performs; -1 is unknown.
        scored: (N,) whether it counts as a test; the others only help to choose.
    """

    acc: FloatArray
    labels: IntArray
    sequence: IntArray
    subjects: IntArray
    scored: BoolArray

    @property
    def groups(self) -> IntArray:
        """A number for each set of people who perform together, (N,); for each sequence if the data do not name all."""
        if (self.subjects == UNKNOWN_SUBJECT).any():
            return np.unique(self.sequence, return_inverse=True)[1]
        return np.unique(np.sort(self.subjects, axis=1), axis=0, return_inverse=True)[1].reshape(-1)


class ChosenPlaces(NamedTuple):
    """The places that others choose for N episodes."""

    one: IntArray  # (N,), the best place for all classes
    own: IntArray  # (N,), the best place of the episode's class
    by_strangers: bool  # whether nobody chose for an episode that he or she performs


class Apart(NamedTuple):
    """Mean angles between best places [degrees]."""

    classes: float  # of two classes
    classes_by_halves: float  # of two classes, each chosen by another half of the people
    same_by_halves: float  # of one class, chosen by each half of the people


@dataclass(frozen=True)
class ClassPlace:
    """Where one class is best seen, and what that is worth.

    Args:
        class_name: the class.
        scenarios: number of test scenarios.
        azimuth_deg: best place, chosen on all episodes: from the front, to the left above 0, -180 to 180.
        polar_deg: the same place, from the zenith.
        own: accuracy [%] at the class's best place, chosen on others.
        one: accuracy [%] at the place that is best for all classes, chosen on others.
        gain: own - one, points.
        ends: 95 % interval of `gain`; None if there is none.
        over_map: mean accuracy [%] over the map.
    """

    class_name: str
    scenarios: int
    azimuth_deg: float
    polar_deg: float
    own: float
    one: float
    gain: float
    ends: Interval | None
    over_map: float


@dataclass(frozen=True, eq=False)
class ClassMaps:
    """What there is to win by knowing the class, for who stays at a place relative to people.

    Args:
        classes: the classes that have test scenarios.
        acc_mean: (classes, M) accuracy [%] on test.
        best: (classes,) the best place of each, chosen on all episodes.
        one: the place that is best for all classes, chosen on all episodes.
        one_place: the same place: degrees from the front and from the zenith.
        worth: accuracy at each class's own best place minus that at the one best place, both chosen on others [points].
        ends: its 95 % interval; None if there is none.
        worth_same: the same, both chosen on the episodes that score them: too high.
        apart: how far apart the best places are.
        by_strangers: whether nobody chose for an episode that he or she performs.
        basis: what intervals rest on.
    """

    classes: tuple[ClassPlace, ...]
    acc_mean: FloatArray
    best: IntArray
    one: int
    one_place: tuple[float, float]
    worth: float
    ends: Interval | None
    worth_same: float
    apart: Apart
    by_strangers: bool
    basis: str

    def to_json(self) -> dict[str, Any]:
        """Return the content of headroom.json about classes."""
        return {
            "worth": {"points": self.worth, "ci95": self.ends, "chosen_on_the_scored": self.worth_same},
            "apart_deg": self.apart._asdict(),
            "one_place_deg": self.one_place,
            "chosen_by_strangers": self.by_strangers,
            "rows": [
                asdict(row) | {"acc_mean": acc.round(4).tolist()}
                for row, acc in zip(self.classes, self.acc_mean, strict=True)
            ],
        }


def class_maps(watched: Watched, places: FloatArray, class_names: tuple[str, ...]) -> ClassMaps:
    """Return the maps of all classes that are scored.

    Args:
        watched: episodes, some of them scored.
        places: (M, 3), the places, azimuths from the front.
        class_names: the classes.
    """
    chosen, scored = chosen_by_others(watched), watched.scored
    test, labels = watched.acc[scored], watched.labels[scored]
    sequence, subjects = watched.sequence[scored], watched.subjects[scored]
    own, one = scores_at(watched, chosen.own), scores_at(watched, chosen.one)
    best = best_per_class(watched.acc, watched.labels, len(class_names))
    overall = int(watched.acc.mean(axis=0).argmax())
    shown = np.unique(labels)
    classes = []
    for label in shown:
        mine = labels == label
        azimuth, polar = in_degrees(places[best[label]])
        classes.append(
            ClassPlace(
                class_name=class_names[label],
                scenarios=int(mine.sum()),
                azimuth_deg=azimuth,
                polar_deg=polar,
                own=float(own[mine].mean()),
                one=float(one[mine].mean()),
                gain=float((own - one)[mine].mean()),
                ends=gain_interval((own - one)[mine], sequence[mine], subjects[mine]),
                over_map=float(test[mine].mean()),
            )
        )
    return ClassMaps(
        classes=tuple(classes),
        acc_mean=np.stack([test[labels == label].mean(axis=0) for label in shown]),
        best=best[shown],
        one=overall,
        one_place=in_degrees(places[overall]),
        worth=float((own - one).mean()),
        ends=gain_interval(own - one, sequence, subjects),
        worth_same=worth_on_the_same(test, labels),
        apart=how_far_apart(watched, places),
        by_strangers=chosen.by_strangers,
        basis=resample_episodes(sequence, subjects).basis.sentence,
    )


def scores_at(watched: Watched, choice: IntArray) -> FloatArray:
    """Return the accuracies [%] of the scored episodes at the place that is chosen for each episode, (N,)."""
    scores: FloatArray = watched.acc[np.arange(len(choice)), choice][watched.scored]
    return scores


def worth_on_the_same(acc: FloatArray, labels: IntArray) -> float:
    """Return what the best place of each class has above the one best place [points], chosen where it is scored.

    It is never below 0. Noise alone brings it above.

    Args:
        acc: (N, M) accuracy [%].
        labels: (N,) true class.
    """
    own = best_per_class(acc, labels, int(labels.max()) + 1)[labels]
    return float(acc[np.arange(len(acc)), own].mean() - acc.mean(axis=0).max())


def best_per_class(acc: FloatArray, labels: IntArray, classes: int) -> IntArray:
    """Return the best viewpoint of each class, (K,), from accuracies (N, M); without samples, the best of all."""
    overall = int(acc.mean(axis=0).argmax())
    return np.array(
        [
            int(acc[labels == label].mean(axis=0).argmax()) if (labels == label).any() else overall
            for label in range(classes)
        ]
    )


def chosen_by_others(watched: Watched) -> ChosenPlaces:
    """Return the places that the episodes of other people choose, scored or not.

    For a set of people, others are those with whom they share nobody. If there are none, others are the episodes of
    other sequences.
    """
    groups, classes = watched.groups, int(watched.labels.max()) + 1
    named = not (watched.subjects == UNKNOWN_SUBJECT).any()
    one, own = np.zeros(len(groups), dtype=np.int64), np.zeros(len(groups), dtype=np.int64)
    by_strangers = named
    for group in np.unique(groups):
        mine = groups == group
        others = ~np.isin(watched.subjects, watched.subjects[mine]).any(axis=1) if named else ~mine
        if others.any():
            parts = [(mine, others)]
        else:
            by_strangers = False
            sequences = np.unique(watched.sequence[mine])
            parts = [(watched.sequence == sequence, watched.sequence != sequence) for sequence in sequences]
        for some, judges in parts:
            acc, labels = watched.acc[judges], watched.labels[judges]
            one[some] = acc.mean(axis=0).argmax()
            own[some] = best_per_class(acc, labels, classes)[watched.labels[some]]
    return ChosenPlaces(one, own, by_strangers)


def how_far_apart(watched: Watched, places: FloatArray) -> Apart:
    """Return mean angles between the best places of two classes, and of one class as other people choose them.

    Best places are the best of a noisy map, so they lie apart even if all classes are best seen from one place. The
    angle between two choices for one class says how far.

    Args:
        watched: the episodes.
        places: (M, 3), the places.
    """
    shown = np.unique(watched.labels[watched.scored])
    count, different = int(watched.labels.max()) + 1, ~np.eye(len(shown), dtype=bool)

    def between(one: IntArray, other: IntArray) -> FloatArray:
        return angles_between(places[one[shown], None], places[None, other[shown]])

    all_choose = best_per_class(watched.acc, watched.labels, count)
    groups, rng = watched.groups, np.random.default_rng(HALVES_SEED)
    people, found = np.unique(groups), []
    for _ in range(HALVINGS if len(people) > 1 else 0):
        half = np.isin(groups, rng.permutation(people)[: len(people) // 2])
        first, second = (best_per_class(watched.acc[side], watched.labels[side], count) for side in (half, ~half))
        found.append(between(first, second))
    halves = np.mean(found, axis=0) if found else np.full((len(shown), len(shown)), np.nan)
    return Apart(
        classes=_mean(between(all_choose, all_choose)[different]),
        classes_by_halves=_mean(halves[different]),
        same_by_halves=_mean(np.diagonal(halves)),
    )


def gain_interval(gain: FloatArray, sequence: IntArray, subjects: IntArray) -> Interval | None:
    """Return the 95 % interval of the mean of gains (N,) over people and sequences; None with a single sequence."""
    why_none = "one sequence" if len(np.unique(sequence)) < 2 else None
    resamples = resample_episodes(sequence, subjects, why_none=why_none)
    return pair(resamples.interval(gain.mean(), resamples.means(gain), bounds=(-100, 100)))


def in_degrees(place: FloatArray) -> tuple[float, float]:
    """Return degrees from the front, left above 0 and right below, and from the zenith, of a place (3,)."""
    azimuth = round(float(np.degrees(wrap_difference(place[AZIMUTH]))), 1)
    return 180.0 if azimuth == -180 else azimuth, round(float(np.degrees(place[POLAR])), 1)


def class_tables(maps: ClassMaps, counted_from: str) -> list[Table]:
    """Return two tables: the best place of each class, and what knowing the class is worth.

    Args:
        maps: the maps.
        counted_from: what azimuths are counted from, in words.
    """
    azimuth, polar = maps.one_place
    chosen = "people whom the row does not score" if maps.by_strangers else "other sequences than the row scores"
    return [
        Table(
            title="Where each class is best seen, and what it is worth to stay there",
            header=("class", "from the front [deg]", "from the zenith [deg]", "mean acc", "at the one best", "gain"),
            rows=tuple(
                (
                    row.class_name,
                    f"{row.azimuth_deg:.0f}",
                    f"{row.polar_deg:.0f}",
                    f"{row.own:.1f}",
                    f"{row.one:.1f}",
                    f"{row.gain:+.1f} {interval_text(row.ends)}",
                )
                for row in maps.classes
            ),
            footnotes=(
                f"Azimuths are counted from {counted_from}, to the left above 0.",
                f"Places are those that all episodes choose, test and validation; for all classes together it is "
                f"{azimuth:.0f} from the front, {polar:.0f} from the zenith. Accuracies are at places that were "
                f"chosen on {chosen}, so these may differ.",
                "Intervals are those of each class alone, not corrected for their number.",
            ),
        ),
        Table(
            title="What it is worth to know the class, for a camera that may choose where it stays",
            header=("number", "value"),
            rows=(
                (
                    "worth of the class, places chosen on others [points]",
                    f"{maps.worth:+.1f} {interval_text(maps.ends)}",
                ),
                ("the same, chosen on the episodes that score it [points]", f"{maps.worth_same:+.1f}"),
                ("angle between the best places of two classes [deg]", _angle(maps.apart.classes)),
                ("the same, each chosen by another half of the people [deg]", _angle(maps.apart.classes_by_halves)),
                ("of one class, chosen by each half of the people [deg]", _angle(maps.apart.same_by_halves)),
            ),
            footnotes=(
                "Worth: mean accuracy at each class's own best place minus that at the one best place. It is an upper "
                "bound for a belief that chooses where to stay: the class is known from the first frame, and the way "
                "there costs nothing.",
                "Best places of noisy maps lie apart even where all classes are seen best from one place. So compare "
                "the last two rows: if they are alike, nothing says that classes are best seen from different places.",
                maps.basis,
            ),
        ),
    ]


def _angle(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.0f}"


def _mean(values: FloatArray) -> float:
    return float(values.mean()) if values.size else float("nan")
