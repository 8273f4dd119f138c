"""Asks whether simulation knows from which real camera an execution is recognised best."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.copies import copied
from ehar.data.motion_data import MotionData
from ehar.data.scenario import Scenarios, split_parts
from ehar.errors import DataError
from ehar.recogniser import Recogniser
from ehar.sensors.estimator import EstimatorSensor
from ehar.sensors.perfect import PerfectSensor
from ehar.viewpoint import spherical
from ehar.world import World
from eval.scores.metrics import ROUNDING, mean_acc
from eval.studies.real_views.executions import Execution, Poses
from eval.studies.real_views.watching import right_answers
from recognition.training.views import recorded_viewpoints

DRAWS = 4  # of the simulated estimator's errors


@dataclass(frozen=True)
class Choice:
    """How well simulation from one camera's joints predicts the accuracy at another camera.

    Args:
        executions: number of executions, none of which the recogniser learned from.
        correlation: over classes and cameras, of the predicted mean accuracy with the real one; None if one of both is
            the same everywhere.
        within_classes: the same between cameras alone: without what classes differ by on average, and the cameras whose
            joints were used.
        pairs: pairs of other cameras at one of which the execution is really recognised better.
        better: share of them in which simulation names that one, a tie counts as half; None without pairs.
    """

    executions: int
    correlation: float | None
    within_classes: float | None
    pairs: int
    better: float | None


@dataclass(frozen=True, eq=False)
class _View:
    """One camera's view of an execution, simulated from the joints of another camera, or of its own: real."""

    execution: Execution
    source: int  # the camera whose joints are used
    camera: int


def predict_cameras(
    data: MotionData,
    executions: Sequence[Execution],
    poses: Poses,
    recogniser: Recogniser,
    world: World,
    length: int,
) -> Choice:
    """Predict the accuracy at each camera from the joints of each other one, in the first `length` frames.

    Raises:
        DataError: there is no execution of that length that the recogniser has not learned from.
    """
    others = np.setdiff1d(np.arange(len(data.labels)), split_parts(data).recogniser)
    unknown = set(others[~copied(data, others)].tolist())
    views = [
        _View(execution, source, camera)
        for execution in executions
        if unknown.issuperset(execution.sequences.values())
        for source, sequence in execution.sequences.items()
        for camera in execution.sequences
        if data.lengths[sequence] >= length
    ]
    if not views:
        raise DataError(f"{data.name}: expected executions of {length} frames that the recogniser has not learned from")
    real = [view for view in views if view.source == view.camera]
    imagined = [view for view in views if view.source != view.camera]
    rng = np.random.default_rng(0)
    at_camera = _accuracy(data, real, poses, recogniser, PerfectSensor(camera=world.camera), length, rng)
    estimator = EstimatorSensor(skeleton=data.skeleton, camera=world.camera)
    drawn = [_accuracy(data, imagined, poses, recogniser, estimator, length, rng) for _ in range(DRAWS)]
    truth = {(view.execution.name, view.camera): value for view, value in zip(real, at_camera.tolist(), strict=True)}
    guesses = dict(zip(imagined, np.mean(drawn, axis=0).tolist(), strict=True))
    guesses = {view: guess for view, guess in guesses.items() if (view.execution.name, view.camera) in truth}
    return _score(guesses, truth)


def _accuracy(
    data: MotionData,
    views: Sequence[_View],
    poses: Poses,
    recogniser: Recogniser,
    sensor: PerfectSensor | EstimatorSensor,
    length: int,
    rng: np.random.Generator,
) -> FloatArray:
    """Return the mean accuracy over frames of each view, (n,)."""
    sequence = np.array([view.execution.sequences[view.source] for view in views])
    scenarios = Scenarios(data, length, sequence, np.zeros_like(sequence))
    centres = scenarios.centres(np.arange(len(views)))
    viewpoint = recorded_viewpoints(centres, 1)[:, 0]
    for row, view in enumerate(views):
        if view.camera != view.source:
            place = poses[view.execution.person, view.source, view.camera].other_camera
            viewpoint[row] = spherical(place - centres[row])
    return mean_acc(right_answers(recogniser, sensor, scenarios, viewpoint, rng))


def _score(guesses: Mapping[_View, float], truth: Mapping[tuple[str, int], float]) -> Choice:
    """Compare the predicted accuracies with the real ones, by (execution, camera)."""
    cells: dict[tuple[int, int, int], list[tuple[float, float]]] = {}
    by_source: dict[tuple[str, int], list[_View]] = {}
    for view, guess in guesses.items():
        real = truth[view.execution.name, view.camera]
        cells.setdefault((view.execution.label, view.source, view.camera), []).append((guess, real))
        by_source.setdefault((view.execution.name, view.source), []).append(view)
    means = np.array([np.mean(values, axis=0) for values in cells.values()])
    alike = np.array([cell[:2] for cell in cells])
    within = means - np.stack([means[(alike == own).all(axis=1)].mean(axis=0) for own in alike])
    hits = []
    for views in by_source.values():
        for i, one in enumerate(views):
            for other in views[i + 1 :]:
                really = truth[one.execution.name, one.camera] - truth[one.execution.name, other.camera]
                if abs(really) > ROUNDING:
                    guessed = guesses[one] - guesses[other]
                    hits.append(0.5 if abs(guessed) <= ROUNDING else float((guessed > 0) == (really > 0)))
    return Choice(
        executions=len({view.execution.name for view in guesses}),
        correlation=_correlation(means),
        within_classes=_correlation(within),
        pairs=len(hits),
        better=float(np.mean(hits)) if hits else None,
    )


def _correlation(values: FloatArray) -> float | None:
    """Return the correlation of two columns, (n, 2); None if one does not vary."""
    one, other = values.T
    varies = min(one.std(), other.std()) > ROUNDING
    return float(np.corrcoef(one, other)[0, 1]) if varies else None
