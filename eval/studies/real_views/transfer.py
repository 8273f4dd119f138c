"""Trains on simulated views or on real ones, and tests on what a camera really saw that no training did."""

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.camera import Camera
from ehar.conditions import Conditions
from ehar.data.copies import copied
from ehar.data.motion_data import MotionData
from ehar.data.scenario import windows
from ehar.errors import DataError
from ehar.sensors.perfect import PerfectSensor
from eval.running.training import train_recogniser
from eval.scores.metrics import ACC_AT, acc_at, mean_acc
from eval.scores.resampling.resamples import Basis, resample_episodes
from eval.studies.real_views.watching import right_answers
from recognition.storage import load_recogniser, recogniser_path
from recognition.training.config import TrainingConfig
from recognition.training.views import recorded_viewpoints

RECORDED, SIMULATED, ESTIMATED = "real views", "simulated views", "simulated views, estimator"
TRAININGS = {RECORDED: ("recorded", "perfect"), SIMULATED: ("moving", "perfect"), ESTIMATED: ("moving", "estimator")}


@dataclass(frozen=True)
class Transfer:
    """How well a training holds for the real camera.

    Args:
        training: what it was trained on.
        accuracy: accuracy [%] after each of `ACC_AT` of the frames.
        mean: mean accuracy [%] over frames.
        ends: its 95 % interval [%].
        basis: the people that the interval rests on.
        windows: number of test windows.
    """

    training: str
    accuracy: tuple[float, ...]
    mean: float
    ends: tuple[float, float]
    basis: Basis
    windows: int


def train(conditions: Conditions, training: str, out: Path, *, clips: int, threads: int) -> Conditions:
    """Train a recogniser, unless it is there, and return the conditions that load it."""
    views, sensor = TRAININGS[training]
    own = replace(conditions, views=views, sensor=sensor, models=out)
    if not recogniser_path(out, own).is_file():
        trained = train_recogniser(TrainingConfig(conditions=own, out=out, clips=clips, threads=threads))
        print("\n".join(trained.lines), file=sys.stderr, flush=True)
    return own


def unseen_test(data: MotionData) -> IntArray:
    """Return the test sequences that are no copies of training sequences, (n,).

    Raises:
        DataError: the data has no split, or every test sequence is a copy.
    """
    if data.is_test is None:
        raise DataError(f"{data.name}: expected a split by camera, as `split` names it")
    test = np.flatnonzero(data.is_test)
    found: IntArray = test[~copied(data, test)]
    if not len(found):
        raise DataError(f"{data.name}: expected a test sequence that is no copy of a training sequence")
    return found


def test(conditions: Conditions, training: str, data: MotionData, camera: Camera) -> Transfer:
    """Test a recogniser on what the cameras of the test sequences saw."""
    recogniser = load_recogniser(conditions, data)
    scenarios = windows(data, unseen_test(data), conditions.length, conditions.length)
    viewpoint: FloatArray = recorded_viewpoints(scenarios.centres(np.arange(len(scenarios))), 1)[:, 0]
    sensor = PerfectSensor(camera=camera)
    right = right_answers(recogniser, sensor, scenarios, viewpoint, np.random.default_rng(0))
    names = np.array(data.sequence_names)[scenarios.sequence]
    resamples = resample_episodes(names, data.subjects[scenarios.sequence])
    accuracy = mean_acc(right)
    low, high = 100 * resamples.interval(accuracy.mean(), resamples.means(accuracy), bounds=(0, 1))
    return Transfer(
        training=training,
        accuracy=tuple(100 * acc_at(right, percent) for percent in ACC_AT),
        mean=float(100 * accuracy.mean()),
        ends=(float(low), float(high)),
        basis=resamples.basis,
        windows=len(scenarios),
    )
