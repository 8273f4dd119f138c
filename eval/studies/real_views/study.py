"""The study of real views: its three parts, one table each."""

import sys
from dataclasses import asdict, dataclass
from pathlib import Path

from ehar.conditions import Conditions
from ehar.data.copies import unseen_test
from ehar.errors import UsageError
from ehar.files import json_text, write_text
from ehar.sensors.estimator import NOISE_FLOOR, OCCLUDED_NOISE, RELATIVE_NOISE
from ehar.world import INDOOR
from eval.records.run_files import TABLE, check_no_run
from eval.render.tables import Table, html, markdown, text
from eval.scores.metrics import ACC_AT
from eval.studies.real_views.choice import Named, ViewChoice, predict_cameras
from eval.studies.real_views.errors import JointErrors, real_errors, simulated_errors
from eval.studies.real_views.executions import agreed, find_executions, find_poses
from eval.studies.real_views.transfer import ESTIMATED, TRAININGS, Transfer, test, train
from recognition.setting import load_motion_of
from recognition.storage import load_recogniser
from recognition.training.config import TrainingConfig


@dataclass(frozen=True, repr=False)
class RealViewsReport:
    """Whether what is simulated holds for real cameras; it prints as tables, in a notebook as HTML.

    Args:
        data: title of the data.
        length: frames of a window.
        transfer: trainings on real and on simulated views, tested on what a real camera saw.
        choice: whether simulation knows the best real camera.
        real: errors of the real trackers, if all executions of a person tell how cameras stand.
        real_alone: the same, if each execution tells it by itself.
        simulated: errors of our pose estimator, measured in the same way.
    """

    data: str
    length: int
    transfer: tuple[Transfer, ...]
    choice: ViewChoice
    real: JointErrors
    real_alone: JointErrors
    simulated: JointErrors

    def tables(self) -> list[Table]:
        """Return the three tables."""
        basis = self.transfer[0].basis
        return [
            Table(
                title=f"{self.data}: trained on views of some cameras, tested on what another one saw, in percent",
                header=("trained on", *(f"acc@{percent}" for percent in ACC_AT), "mean acc [95 %]"),
                rows=tuple(
                    (
                        row.training,
                        *(f"{value:.1f}" for value in row.accuracy),
                        f"{row.mean:.1f} [{row.ends[0]:.1f}, {row.ends[1]:.1f}]",
                    )
                    for row in self.transfer
                ),
                footnotes=(
                    f"{self.transfer[0].windows} windows of {self.length} frames, none of a sequence that is a copy of "
                    "a training sequence. One training each. Training may have had the same "
                    "executions from other cameras, as in the published split.",
                    basis.sentence,
                ),
                bold=frozenset(
                    {(max(range(len(self.transfer)), key=lambda i: self.transfer[i].mean), len(ACC_AT) + 1)}
                ),
            ),
            Table(
                title="From which real camera is an execution recognised best? Predicted from another camera's joints",
                header=("question", "answer"),
                rows=(
                    (
                        "correlation of predicted and real accuracy, over classes and cameras",
                        _told(self.choice.correlation, ".2f"),
                    ),
                    ("the same between cameras alone", _told(self.choice.within_classes, ".2f")),
                    (
                        f"share of {self.choice.pairs} pairs of cameras of which it names the better one [95 %]",
                        _share(self.choice.better),
                    ),
                    ("the same from the joints of the two cameras themselves", _share(self.choice.ceiling)),
                ),
                footnotes=(
                    f"{self.choice.executions} executions that the recogniser did not learn from, which was trained on "
                    "simulated views with the estimator's errors; of each the frames that all of its cameras recorded, "
                    f"{self.choice.frames:.1f} in the mean. 0.5 is chance.",
                    self.choice.basis.sentence,
                ),
                words=frozenset({0}),
            ),
            Table(
                title="Errors of joints: the estimator's parameters, and what lies between real cameras",
                header=("error", "default", "in simulation", "real, places of a person", "real, of an execution"),
                rows=tuple(_error_rows(self.simulated, self.real, self.real_alone)),
                footnotes=(
                    f"Real: {self.real.frames} frames. Where cameras stand, all executions of a person tell together, "
                    "or each by itself. What is left of places and times counts as errors that last; a place of an "
                    "execution's own takes a part of the tracker's errors away. So the truth lies between.",
                    "In simulation: our estimator's errors on the same motion, where places and times are "
                    "known; it should find the defaults.",
                    "A person is seen from the side between 60 and 120 degrees. By default sides are swapped only if a "
                    "body is seen edge-on, and errors of one frame say nothing of the next.",
                    "These trackers work on depth images. Joints that they miss are not marked, so misses have no row.",
                ),
                words=frozenset({0}),
            ),
        ]

    def __repr__(self) -> str:
        """Return one line: the data and the number of test windows."""
        return f"RealViewsReport({self.data}: {self.transfer[0].windows} test windows)"

    def __str__(self) -> str:
        """Return the tables."""
        return text(*self.tables())

    def _repr_html_(self) -> str:
        """Return the tables for a notebook."""
        return "".join(map(html, self.tables()))


def real_views(
    data: str, *, out: str | Path, length: int = 20, clips: int = TrainingConfig.clips, threads: int = 0
) -> RealViewsReport:
    """Ask whether what is simulated holds for real cameras.

    It trains on real and on simulated views of the training cameras, and tests on what the test camera really saw. It
    predicts from one camera's joints how well an execution is recognised at another one. And it measures what the
    trackers of real cameras get wrong.

    Args:
        data: an .npz with `views`, whose sequences of one execution differ in `_v1`, `_v2` in their names.
        out: folder of the results and of the three recognisers; what is trained there is not trained again.
        length: frames of a window.
        clips: the most training clips of each recogniser.
        threads: CPU threads of torch; with 0, torch decides.

    Raises:
        UsageError: the length is below 1, or `out` holds recognisers of other data or another length, or a run.
        DataError: the data is malformed, or has no cameras, no split, or no execution that several cameras recorded.
    """
    if length < 1:
        raise UsageError(f"--length: got {length}, expected at least 1")
    world, folder = INDOOR, Path(out)
    check_no_run(folder)
    conditions = Conditions(data=data, length=length, world=world.name)
    motion = load_motion_of(conditions)
    executions = find_executions(motion)
    unseen_test(motion)  # refuses data without a test before anything is trained
    rows = []
    for training in TRAININGS:
        print(f"training on {training}", file=sys.stderr, flush=True)
        own = train(conditions, training, motion, folder, clips=clips, threads=threads)
        rows.append(test(own, training, motion, world.camera))
        if training == ESTIMATED:
            recogniser = load_recogniser(own, motion)
    alone = find_poses(motion, executions)
    poses = agreed(alone, executions)
    found = RealViewsReport(
        data=motion.title,
        length=length,
        transfer=tuple(rows),
        choice=predict_cameras(motion, executions, poses, recogniser, world, length),
        real=real_errors(motion, executions, poses, world.camera),
        real_alone=real_errors(motion, executions, alone, world.camera),
        simulated=simulated_errors(motion, executions, poses, world.camera),
    )
    write_text(folder / "summary.json", [json_text(asdict(found))])
    write_text(folder / TABLE, [markdown(*found.tables())])
    return found


def _error_rows(*measured: JointErrors) -> list[tuple[str, ...]]:
    """Return one row for each error: its name, the default, and the measured values."""

    def row(name: str, default: str, form: str, *values: float) -> tuple[str, ...]:
        return (name, default, *(format(value, form) for value in values))

    swaps = zip(*(errors.swaps for errors in measured), strict=True)
    sides = zip(("front", "side", "back"), ("0", "up to 25", "0"), swaps, strict=True)
    return [
        row(
            "noise [% of a person's height]",
            f"{100 * RELATIVE_NOISE:g}",
            ".1f",
            *(100 * errors.relative_noise for errors in measured),
        ),
        row("noise on top of it [px]", f"{NOISE_FLOOR:g}", ".1f", *(errors.noise_floor for errors in measured)),
        row(
            "factor for joints behind limbs",
            f"{OCCLUDED_NOISE:g}",
            ".1f",
            *(errors.occluded_noise for errors in measured),
        ),
        *(
            row(f"sides swapped, seen from the {side} [%]", told, ".1f", *(100 * share for share in shares))
            for side, told, shares in sides
        ),
        row("share that lasts for a whole recording", "0", ".2f", *(errors.lasting for errors in measured)),
        row("correlation of the rest with the next frame's", "0", ".2f", *(errors.correlation for errors in measured)),
    ]


def _share(named: Named) -> str:
    return "-" if named.share is None else f"{named.share:.3f} [{named.ends[0]:.3f}, {named.ends[1]:.3f}]"


def _told(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)
