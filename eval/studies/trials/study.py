"""The study of trials: a recogniser is trained with one thing changed each, and asked about people it has not met."""

import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from io import BytesIO
from itertools import cycle
from pathlib import Path

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.motion_data import MotionData
from ehar.data.scenario import USUAL_LENGTH, advised_length
from ehar.data.source import load_data
from ehar.errors import DataError, UsageError
from ehar.files import json_text, write_bytes, write_text
from ehar.world import PAPER
from eval.records.config import CONFIG
from eval.records.run_files import TABLE, check_out
from eval.render.tables import Table, html, interval_text, markdown, text
from eval.scores.summary_table import basis_lines
from eval.studies.trials.scores import Answered, SetScores, score_set
from recognition.devices import check_device
from recognition.torch_threads import use_threads
from recognition.trials.changes import CHANGES, LAST, ROWS, USUAL

KEPT_ON = 3  # what helps on so many sets is kept ...
KEPT_LOSS = 1.0  # ... if it costs no set more than this [points]


@dataclass(frozen=True, repr=False)
class TrialsReport:
    """What each part of a training is worth; it prints as tables, in a notebook as HTML.

    Args:
        clips: training clips of each trial, by data set.
        folds: number of folds over people.
        sets: the data sets of which a fold is done or has begun.
    """

    clips: dict[str, int]
    folds: int
    sets: tuple[SetScores, ...]

    def tables(self) -> list[Table]:
        """Return one table over all data sets, and one for each."""
        return [self._over_sets(), *(self._of_set(scores) for scores in self.sets)]

    def _over_sets(self) -> Table:
        rows = []
        for row in ROWS[1:]:
            gains = [next((score.gain for score in held.rows if score.row == row.name), None) for held in self.sets]
            known = [gain for gain in gains if gain is not None]
            if not known:
                continue
            rows.append(
                (
                    row.name,
                    *("-" if gain is None else f"{gain:+.1f}" for gain in gains),
                    f"{np.mean(known):+.1f}",
                    f"{sum(gain > 0 for gain in known)} of {len(known)}",
                    "yes" if _would_keep(known) else "no",
                    row.told,
                )
            )
        return Table(
            title="Mean accuracy on people who were left out, minus that of the usual training [points]",
            header=("change", *(held.data for held in self.sets), "mean", "helps on", "keep", "what it is"),
            rows=tuple(rows),
            footnotes=(
                f"{USUAL}: {ROWS[0].told}.",
                f"Keep: it helps on at least {KEPT_ON} sets, and costs none more than {KEPT_LOSS:g} point.",
                "Each trial learned from so many clips: "
                + ", ".join(f"{name} {clips:,}" for name, clips in self.clips.items())
                + ".",
                "Folds begun: " + ", ".join(f"{held.data} {held.folds} of {self.folds}" for held in self.sets) + ".",
            ),
            words=frozenset({len(self.sets) + 4}),
        )

    def _of_set(self, scores: SetScores) -> Table:
        basis = basis_lines(scores.basis, None)
        return Table(
            title=f"{scores.data}: {scores.clips:,} clips of people who were left out, "
            f"{scores.folds} of {self.folds} folds",
            header=(
                *("change", "mean acc", "acc@100", f"minus {USUAL} [95 %]", "NLL", "ECE"),
                *("NLL, calibrated", "ECE, calibrated"),
            ),
            rows=tuple(
                (
                    score.row,
                    f"{score.accuracy:.1f}",
                    f"{score.acc_end:.1f}",
                    "-" if score.row == USUAL else f"{score.gain:+.1f} {interval_text(score.gain_ci95)}",
                    f"{score.nll:.3f}",
                    f"{score.ece_late:.3f}",
                    "-" if score.nll_calibrated is None else f"{score.nll_calibrated:.3f}",
                    "-" if score.ece_calibrated is None else f"{score.ece_calibrated:.3f}",
                )
                for score in scores.rows
            ),
            footnotes=(
                "ECE: calibration error of the frames from half of a clip on. Calibrated: by temperatures that were "
                "fitted on the people of the other folds.",
                "Intervals are corrected for all rows of the table.",
                *basis.footnotes,
            ),
            notice=basis.notice,
        )

    def __repr__(self) -> str:
        """Return one line: the data sets."""
        return f"TrialsReport({', '.join(scores.data for scores in self.sets)})"

    def __str__(self) -> str:
        """Return the tables."""
        return text(*self.tables())

    def _repr_html_(self) -> str:
        """Return the tables for a notebook."""
        return "".join(map(html, self.tables()))


def trials(
    data: Sequence[str],
    *,
    out: str | Path,
    sensor: str = "estimator",
    folds: int = 3,
    only: Sequence[int] = (),
    changes: Sequence[str] = (),
    clips: Sequence[int] = (12_000,),
    device: str = "cpu",
    threads: int = 0,
) -> TrialsReport:
    """Train recognisers with one thing changed each, and score them on people who were left out of the training.

    People of the test part are never seen: what is kept is decided without them.

    Args:
        data: names of sets, or .npz files.
        out: folder of the results; every training that is done is kept there, and not made again. Who stops it
            has the table of what is done.
        sensor: name of the sensor.
        folds: number of groups that people are left out in.
        only: numbers of the folds to train now; none means all. Two processes may train different ones.
        changes: what to change now, beside the usual training; none means everything. More can be tried later.
        clips: training clips of each trial: one number for all sets, or one for each.
        device: torch device.
        threads: CPU threads of torch; with 0, torch decides.

    Raises:
        UsageError: an option is out of range, or `out` holds other trials.
        DataError: a set does not name its people, or has too few.
        ModelError: a loss is not finite.
    """
    _check_clips(clips, len(data))
    outside = [number for number in only if not 0 <= number < folds]
    if outside:
        raise UsageError(f"--only: got {outside[0]}, expected numbers from 0 to {folds - 1}")
    unknown = [name for name in changes if name not in CHANGES]
    if unknown:
        raise UsageError(f"--changes: got {unknown[0]!r}, expected names of: {', '.join(CHANGES)}")
    check_device(device)
    use_threads(threads)
    folder, sets = Path(out), [load_data(name) for name in data]
    repeated = {held.name for held in sets if sum(other.name == held.name for other in sets) > 1}
    if repeated or not sets:
        told = f"{', '.join(sorted(repeated))} more than once" if repeated else "none"
        raise UsageError(f"data: expected different sets, got {told}")
    per_set = dict(zip((held.name for held in sets), cycle(clips), strict=False))
    held_config = {
        "data_sha256": {held.name: held.sha256 for held in sets},
        "sensor": sensor,
        "folds": folds,
        "clips": per_set,
        "usual": ROWS[0].told,  # so that trials of another usual training are not beside these
    }
    runs = [
        _SetTrials(held, sets, folder, sensor=sensor, folds=folds, clips=per_set[held.name], device=device)
        for held in sets
    ]
    check_out(folder, held_config)
    write_text(folder / CONFIG, [json_text(held_config)])

    try:
        for number in only or range(folds):
            for run in runs:
                run.train(number, [USUAL, *changes] if changes else list(CHANGES))
    finally:  # who stops it has the table of what is done
        report = TrialsReport(per_set, folds, tuple(scores for run in runs if (scores := run.scores()) is not None))
        if report.sets:
            write_text(folder / "summary.json", [json_text(asdict(report))])
            write_text(folder / TABLE, [markdown(*report.tables())])
    return report


class _SetTrials:
    """The trials of one data set."""

    def __init__(
        self,
        data: MotionData,
        sets: Sequence[MotionData],
        out: Path,
        *,
        sensor: str,
        folds: int,
        clips: int,
        device: str,
    ) -> None:
        from ehar.sensors.registry import load_sensor  # imported here and below: torch takes seconds
        from recognition.trials.folds import people_folds
        from recognition.trials.trial import Lesson

        self._data, self._others = data, [other for other in sets if other is not data]
        self._folder = out / data.name
        self._folds = people_folds(data, folds)
        load_sensor(sensor, data, PAPER)  # to refuse one that is unknown before anything is written
        self._lesson = Lesson(sensor, clips, advised_length(data, USUAL_LENGTH), device)

    def train(self, number: int, changes: Sequence[str]) -> None:
        """Make those trainings of a fold that are not there yet, and print a line after each."""
        from recognition.trials.pretraining import pretrain  # imported here: torch takes seconds
        from recognition.trials.trial import held_clips, run_trial

        fold = self._folds[number]
        wanted = {name: CHANGES[name] for name in changes if self._others or not CHANGES[name].pretrained}
        held = held_clips(self._data, fold, self._lesson)
        for name, change in wanted.items():
            if self._path(number, name).is_file():
                continue
            since = time.monotonic()
            try:
                begin = pretrain(self._others, self._lesson, fps=self._data.fps) if change.pretrained else None
            except DataError as error:  # the other sets are too short, or lack joints: all else can be tried
                print(f"note: {self._data.name}: {name} is left out: {error}", file=sys.stderr, flush=True)
                continue
            averaged, last = run_trial(self._data, fold, self._lesson, change, held, begin=begin)
            self._keep(number, name, averaged)
            if name == USUAL:
                self._keep(number, LAST, last)
            right = 100 * (averaged.argmax(axis=-1) == held.labels.numpy()[:, None]).mean()
            took = (time.monotonic() - since) / 60
            line = f"{self._data.name}, fold {number}, {name}: {right:.1f} %, {took:.1f} minutes"
            print(line, file=sys.stderr, flush=True)

    def scores(self) -> SetScores | None:
        """Score what is there; None if no fold has begun."""
        from recognition.trials.trial import held_clips

        answered = []
        for number, fold in enumerate(self._folds):
            logits = {name: self._load(number, name) for name in (*CHANGES, LAST) if self._path(number, name).is_file()}
            if USUAL not in logits:
                continue
            held = held_clips(self._data, fold, self._lesson)
            names = np.array(self._data.sequence_names)[held.sequences]
            answered.append(Answered(logits, held.labels.numpy(), names, self._data.subjects[held.sequences]))
        return score_set(self._data.title, answered) if answered else None

    def _path(self, number: int, name: str) -> Path:
        return self._folder / f"fold-{number}" / f"{name.replace(' ', '-')}.npy"

    def _keep(self, number: int, name: str, logits: FloatArray) -> None:
        written = BytesIO()
        np.save(written, logits.astype(np.float32), allow_pickle=False)
        write_bytes(self._path(number, name), written.getvalue())

    def _load(self, number: int, name: str) -> FloatArray:
        path = self._path(number, name)
        try:
            held: FloatArray = np.load(path, allow_pickle=False)
        except (OSError, ValueError) as error:
            raise UsageError(f"{path}: expected logits of a trial, got {error}: remove it to train again") from error
        return held


def _check_clips(clips: Sequence[int], sets: int) -> None:
    """Refuse other numbers of clips than one for all sets or one for each, each at least 1."""
    if not clips or min(clips) < 1:
        raise UsageError(f"--clips: got {', '.join(map(str, clips)) or 'none'}, expected at least 1")
    if len(clips) not in (1, sets):
        raise UsageError(f"--clips: got {len(clips)} numbers, expected one for all sets, or one for each")


def _would_keep(gains: Sequence[float]) -> bool:
    """Return whether a change helps on enough sets and costs none too much."""
    return sum(gain > 0 for gain in gains) >= KEPT_ON and not any(gain < -KEPT_LOSS for gain in gains)
