"""Trains on simulated views or on real ones, and tests on what a camera really saw that no training did."""

import json
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ehar.arrays import FloatArray
from ehar.camera import Camera
from ehar.conditions import Conditions
from ehar.data.copies import unseen_test
from ehar.data.motion_data import MotionData
from ehar.data.scenario import windows
from ehar.errors import UsageError
from ehar.sensors.perfect import PerfectSensor
from eval.running.training import train_recogniser
from eval.scores.metrics import ACC_AT, acc_at, mean_acc
from eval.scores.resampling.resamples import Basis, resample_episodes
from eval.studies.real_views.watching import right_answers
from recognition.storage import load_recogniser, recogniser_path
from recognition.training.config import TrainingConfig
from recognition.training.views import recorded_viewpoints
from recognition.weight_files import description_path, recorded_run

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


def train(
    conditions: Conditions, training: str, data: MotionData, out: Path, *, clips: int, threads: int
) -> Conditions:
    """Train a recogniser, unless it is there, and return the conditions that load it.

    Raises:
        UsageError: `out` holds one that was trained on other data, or at another length.
    """
    views, sensor = TRAININGS[training]
    own = replace(conditions, views=views, sensor=sensor, models=out)
    path = recogniser_path(out, own)
    if path.is_file():
        held = recorded_run(path) or {}
        if (held.get("data_sha256"), held.get("length")) != (data.sha256, conditions.frames):
            raise UsageError(f"{path}: trained on other data or at another length: remove it, or choose another --out")
        told = json.loads(description_path(path).read_text(encoding="utf-8"))["training"]
        seen = told["evaluations"][-1]["clips"]
        if told["cut_short"] and seen < clips:
            raise UsageError(
                f"{path}: cut short at {seen} clips, fewer than the {clips} of --clips: remove it, or choose another "
                "--out"
            )
    else:
        trained = train_recogniser(TrainingConfig(conditions=own, out=out, clips=clips, threads=threads))
        print("\n".join(trained.lines), file=sys.stderr, flush=True)
    return own


def test(conditions: Conditions, training: str, data: MotionData, camera: Camera) -> Transfer:
    """Test a recogniser on what the cameras of the test sequences saw."""
    recogniser = load_recogniser(conditions, data)
    scenarios = windows(data, unseen_test(data), conditions.frames, conditions.frames)
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
