"""Asks whether simulation knows from which real camera an execution is recognised best."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

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
from eval.scores.resampling.resamples import Basis, resample_episodes
from eval.studies.real_views.executions import Execution, Poses
from eval.studies.real_views.moments import shared_moments
from eval.studies.real_views.watching import right_answers
from recognition.training.views import recorded_viewpoints

DRAWS = 4  # of the simulated estimator's errors


@dataclass(frozen=True)
class Named:
    """How often a simulation names the better one of two cameras.

    Args:
        share: the share of pairs of cameras in which it does, a tie counts as half; None without pairs.
        ends: its 95 % interval over people.
    """

    share: float | None
    ends: tuple[float, float]


@dataclass(frozen=True)
class ViewChoice:
    """How well simulation from one camera's joints predicts the accuracy at another camera, at the same moments.

    Args:
        executions: number of executions, none of which the recogniser learned from.
        frames: their frames, in the mean.
        correlation: over classes and cameras, of the predicted mean accuracy with the real one; None if one of both is
            the same everywhere.
        within_classes: the same between cameras alone: without what classes differ by on average, and the cameras whose
            joints were used.
        pairs: pairs of other cameras at one of which the execution is really recognised better.
        better: in how many of them simulation names that one.
        ceiling: in how many it would from the joints that each of the two cameras has itself.
        basis: the people that the intervals rest on.
    """

    executions: int
    frames: float
    correlation: float | None
    within_classes: float | None
    pairs: int
    better: Named
    ceiling: Named
    basis: Basis


@dataclass(frozen=True, eq=False)
class _View:
    """One camera's view of an execution, simulated from the joints of another camera, or of its own.

    Args:
        execution: the execution.
        source: the camera whose joints are used.
        camera: the camera that sees them.
        begin: the first frame of the source's recording that counts.
        frames: how many count.
    """

    execution: Execution
    source: int
    camera: int
    begin: int
    frames: int


def predict_cameras(
    data: MotionData,
    executions: Sequence[Execution],
    poses: Poses,
    recogniser: Recogniser,
    world: World,
    length: int,
) -> ViewChoice:
    """Predict the accuracy at each camera from the joints of each other one, in frames that all cameras recorded.

    Recordings of one execution begin up to a second apart, and two of them may be cut to different things. So what all
    of its cameras recorded is compared: `length` frames at most, and executions that share fewer than half are left
    out.

    Raises:
        DataError: there is no such execution that the recogniser has not learned from.
    """
    others = np.setdiff1d(np.arange(len(data.labels)), split_parts(data).recogniser)
    unknown = set(others[~copied(data, others)].tolist())
    views = []
    for execution in executions:
        if unknown.issuperset(execution.sequences.values()):
            moments = shared_moments(data, execution, poses)
            frames = min(length, moments.frames)
            if 2 * frames >= length:
                views += [
                    _View(execution, source, camera, begin, frames)
                    for source, begin in moments.begin.items()
                    for camera in moments.begin
                ]
    if not views:
        raise DataError(
            f"{data.name}: expected executions that the recogniser has not learned from, and of which all cameras "
            f"recorded the same {-(-length // 2)} frames"
        )
    own = [view for view in views if view.source == view.camera]
    rng = np.random.default_rng(0)
    at_camera = _accuracy(data, own, poses, recogniser, PerfectSensor(camera=world.camera), rng)
    estimator = EstimatorSensor(skeleton=data.skeleton, camera=world.camera)
    drawn = [_accuracy(data, views, poses, recogniser, estimator, rng) for _ in range(DRAWS)]
    truth = {(view.execution.name, view.camera): value for view, value in zip(own, at_camera.tolist(), strict=True)}
    return _score(dict(zip(views, np.mean(drawn, axis=0).tolist(), strict=True)), truth)


def _accuracy(
    data: MotionData,
    views: Sequence[_View],
    poses: Poses,
    recogniser: Recogniser,
    sensor: PerfectSensor | EstimatorSensor,
    rng: np.random.Generator,
) -> FloatArray:
    """Return the mean accuracy over frames of each view, (n,)."""
    accuracy = np.empty(len(views))
    frames = np.array([view.frames for view in views])
    for length in np.unique(frames).tolist():
        alike = np.flatnonzero(frames == length)
        seen = [views[row] for row in alike.tolist()]
        sequence = np.array([view.execution.sequences[view.source] for view in seen])
        scenarios = Scenarios(data, length, sequence, np.array([view.begin for view in seen]))
        centres = scenarios.centres(np.arange(len(seen)))
        viewpoint = recorded_viewpoints(centres, 1)[:, 0]
        for row, view in enumerate(seen):
            if view.camera != view.source:
                place = poses[view.execution.name, view.source, view.camera].other_camera
                viewpoint[row] = spherical(place - centres[row])
        accuracy[alike] = mean_acc(right_answers(recogniser, sensor, scenarios, viewpoint, rng))
    return accuracy


def _score(guesses: Mapping[_View, float], truth: Mapping[tuple[str, int], float]) -> ViewChoice:
    """Compare the predicted accuracies with the real ones, by (execution, camera)."""
    cells: dict[tuple[int, int, int], list[tuple[float, float]]] = {}
    of_execution: dict[Execution, dict[tuple[int, int], float]] = {}
    for view, guess in guesses.items():
        execution = view.execution
        of_execution.setdefault(execution, {})[view.source, view.camera] = guess
        if view.source != view.camera:
            real = truth[execution.name, view.camera]
            cells.setdefault((execution.label, view.source, view.camera), []).append((guess, real))
    means = np.array([np.mean(values, axis=0) for values in cells.values()])
    alike = np.array([cell[:2] for cell in cells])
    within = means - np.stack([means[(alike == own).all(axis=1)].mean(axis=0) for own in alike])
    named, own = list[tuple[Execution, float]](), list[tuple[Execution, float]]()
    for execution, guessed in of_execution.items():
        for one, other in combinations(execution.sequences, 2):
            really = truth[execution.name, one] - truth[execution.name, other]
            if abs(really) > ROUNDING:
                own.append((execution, _names(guessed[one, one] - guessed[other, other], really)))
                thirds = [camera for camera in execution.sequences if camera not in (one, other)]
                named += [(execution, _names(guessed[third, one] - guessed[third, other], really)) for third in thirds]
    names = np.array([execution.name for execution in of_execution])
    people = np.array([[execution.person] for execution in of_execution])
    return ViewChoice(
        executions=len(of_execution),
        frames=float(np.mean([view.frames for view in guesses])),
        correlation=_correlation(means),
        within_classes=_correlation(within),
        pairs=len(named),
        better=_share(named),
        ceiling=_share(own),
        basis=resample_episodes(names, people).basis,
    )


def _names(guessed: float, really: float) -> float:
    """Return 1 if a guessed difference has the sign of the real one, 0 if it has not, and 0.5 if there is none."""
    return 0.5 if abs(guessed) <= ROUNDING else float((guessed > 0) == (really > 0))


def _share(hits: Sequence[tuple[Execution, float]]) -> Named:
    """Return the mean of hits of executions, and its interval over people."""
    if not hits:
        return Named(None, (0.0, 1.0))
    executions, values = [execution for execution, _ in hits], np.array([hit for _, hit in hits])
    resamples = resample_episodes(
        np.array([execution.name for execution in executions]),
        np.array([[execution.person] for execution in executions]),
    )
    low, high = resamples.interval(values.mean(), resamples.means(values), bounds=(0, 1))
    return Named(float(values.mean()), (float(low), float(high)))


def _correlation(values: FloatArray) -> float | None:
    """Return the correlation of two columns, (n, 2); None if one does not vary."""
    one, other = values.T
    varies = min(one.std(), other.std()) > ROUNDING
    return float(np.corrcoef(one, other)[0, 1]) if varies else None
