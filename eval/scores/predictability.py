"""After how much of an activity it is recognised (Table 4): instantly, early, late, or not by the end.

The paper defines predictability "by the portion of an activity sequence that needs to be observed before being
classified correctly", at 10, 50 and 100 %, and lists classes, but does not define the level of a class. Our definition:

- A class is as predictable as the smallest of the three ratios at which at least half of its episodes are classified
  correctly. The later ratios do not matter.
- An episode is as predictable as the smallest of the three ratios from which on it is always classified correctly: one
  that is right at 10 % and 100 % but wrong at 50 % is predictable late.

Axes: N episodes, L frames, K classes.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from eval.records.episodes import EpisodeRecords
from eval.scores.metrics import right_at

RATIOS = (10, 50, 100)  # Sec. 5.2: the observation ratios of the three levels [%]
LEVELS = ("instantly", "early", "late", "never")  # never: not by the end
NEVER = len(RATIOS)
NO_EPISODE = -1  # the level of a class without episodes
ENOUGH = 0.5  # the share of a class's episodes that have to be right


@dataclass(frozen=True, eq=False)
class Predictability:
    """The predictability of activities with one planner.

    Args:
        class_level: (K,) index into `LEVELS` by class, `NO_EPISODE` where there is none.
        accuracy: (K, 3), the share of a class's episodes classified correctly at each ratio; NaN without any.
        share: (K, 4), the share of a class's episodes at each level; NaN without any.
        total: (4,), the share of all episodes at each level.
    """

    class_level: IntArray
    accuracy: FloatArray
    share: FloatArray
    total: FloatArray

    def classes_at(self, level: int) -> list[int]:
        """Return the classes at a level, in the order of the data."""
        return np.flatnonzero(self.class_level == level).tolist()

    def to_json(self, names: tuple[str, ...]) -> dict[str, Any]:
        """Return the object in analysis.json; classes without episodes are left out."""
        held = np.flatnonzero(self.class_level != NO_EPISODE).tolist()
        return {
            "classes": {name: [names[label] for label in self.classes_at(level)] for level, name in enumerate(LEVELS)},
            "episode_share": dict(zip(LEVELS, self.total.tolist(), strict=True)),
            "by_class": {
                names[label]: {
                    "level": LEVELS[int(self.class_level[label])],
                    "acc": dict(zip(map(str, RATIOS), (100 * self.accuracy[label]).tolist(), strict=True)),
                    "episode_share": dict(zip(LEVELS, self.share[label].tolist(), strict=True)),
                }
                for label in held
            },
        }


def predictability(episodes: EpisodeRecords, classes: int) -> Predictability:
    """Return how predictable each of K classes is from the records of one planner."""
    at = correct_at_ratios(episodes.correct)
    levels = episode_levels(at)
    accuracy = class_means(at, episodes.label, classes)
    of_level: BoolArray = levels[:, None] == np.arange(len(LEVELS))
    return Predictability(
        class_level=class_levels(accuracy),
        accuracy=accuracy,
        share=class_means(of_level, episodes.label, classes),
        total=of_level.mean(axis=0),
    )


def correct_at_ratios(correct: BoolArray) -> BoolArray:
    """Return which episodes are right after 10, 50 and 100 % of their frames, (N, 3) from (N, L)."""
    return np.stack([right_at(correct, percent) for percent in RATIOS], axis=1)


def episode_levels(at: BoolArray) -> IntArray:
    """Return the level of each episode, (N,) from (N, 3): from which ratio on it is right."""
    stays = np.logical_and.accumulate(at[:, ::-1], axis=1)  # from the last ratio backwards
    levels: IntArray = NEVER - stays.sum(axis=1)
    return levels


def class_means(values: FloatArray | BoolArray, label: IntArray, classes: int) -> FloatArray:
    """Return the mean over each class's episodes, (K, R) from (N, R) and labels (N,); NaN where there is none."""
    of_class = (label == np.arange(classes)[:, None]).astype(np.float64)
    count = of_class.sum(axis=1)[:, None]
    means: FloatArray = np.where(count > 0, of_class @ values / np.maximum(count, 1), np.nan)
    return means


def class_levels(accuracy: FloatArray) -> IntArray:
    """Return the level of each class, (K,) from accuracies (K, 3): the first ratio that is right often enough."""
    enough = accuracy >= ENOUGH
    levels = np.where(enough.any(axis=1), enough.argmax(axis=1), NEVER)
    return np.where(np.isnan(accuracy).any(axis=1), NO_EPISODE, levels)
