"""Holds the recogniser to published figures: both forms by the published protocol of Northwestern-UCLA."""

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ehar.arrays import FloatArray
from ehar.conditions import Form
from ehar.data.copies import unseen_test
from ehar.data.source import load_data
from ehar.errors import UsageError
from ehar.files import json_text, write_text
from eval.records.run_files import TABLE, check_no_run
from eval.render.tables import Table, html, markdown, text
from planners.agents.config import check_seeds
from recognition.devices import check_device
from recognition.networks.sizes import Size
from recognition.published.clips import STREAMS, Stream
from recognition.published.training import RATIOS, PublishedRun, accuracies, train_published
from recognition.torch_threads import use_threads
from recognition.training.optimisers import PUBLISHED_EPOCHS

FORMS: tuple[Form, ...] = ("ctrgcn", "causal")
SHOWN = (10, 30, 50, 70, 100)  # observation ratios in the table [%]
# Chen et al., ICCV 2021, and Chi et al., CVPR 2022: several streams together, all frames seen.
PUBLISHED = (("CTR-GCN, four streams, as published", 96.5), ("InfoGCN, as published", 97.0))


@dataclass(frozen=True)
class PublishedRow:
    """A form and its streams.

    Args:
        form: form of the network.
        streams: "joint", "bone" or "joint + bone".
        accuracy: (seeds, R) accuracy [%] after each of `RATIOS` of the frames.
        accuracy_new: (seeds, R) the same without test sequences that are copies of training sequences.
        accuracy_mean: (seeds, R) accuracy [%] by the mean of the weights of the epochs at the lower rate.
        accuracy_best: (seeds,) accuracy [%] after all frames, of the epoch that is best on the test.
    """

    form: Form
    streams: str
    accuracy: FloatArray
    accuracy_new: FloatArray
    accuracy_mean: FloatArray
    accuracy_best: FloatArray

    @property
    def area(self) -> FloatArray:
        """The area under accuracy over the observation ratio [%], (seeds,): the mean over the ratios."""
        return np.asarray(self.accuracy.mean(axis=1))


@dataclass(frozen=True, repr=False)
class PublishedReport:
    """Both forms by the published protocol; it prints as a table, in a notebook as HTML.

    Args:
        data: title of the data.
        size: widths of the networks.
        epochs: epochs of each training.
        seeds: seeds of the trainings of each form and stream.
        rows: the results.
        tests: number of test sequences.
        copies: the class of each of them that is a copy of a training sequence.
        arithmetic: the arithmetic of trainings, bfloat16 or float32.
    """

    data: str
    size: Size
    epochs: int
    seeds: tuple[int, ...]
    rows: tuple[PublishedRow, ...]
    tests: int
    copies: tuple[str, ...]
    arithmetic: tuple[str, ...]

    def tables(self) -> list[Table]:
        """Return the table."""
        whole = RATIOS.index(100)
        return [
            Table(
                title=f"{self.data}: the published protocol, {self.size} widths, in percent",
                header=(
                    *("form", "streams", *(f"acc@{ratio}" for ratio in SHOWN), "area"),
                    *("acc@100, no copies", "acc@100, mean weights", "acc@100, best epoch"),
                ),
                rows=(
                    *(
                        (
                            row.form,
                            row.streams,
                            *(_spread(row.accuracy[:, RATIOS.index(ratio)]) for ratio in SHOWN),
                            _spread(row.area),
                            _spread(row.accuracy_new[:, whole]),
                            _spread(row.accuracy_mean[:, whole]),
                            _spread(row.accuracy_best),
                        )
                        for row in self.rows
                    ),
                    *((name, *[""] * (len(SHOWN) + 4), f"{figure:.1f}") for name, figure in PUBLISHED),
                ),
                footnotes=(
                    f"{_told_trainings(len(self.seeds))} "
                    f"{self.epochs} epochs, as published {PUBLISHED_EPOCHS}. Products in training: "
                    f"{' or '.join(self.arithmetic)}.",
                    "acc@x: the network sees the first x % of the frames, scaled and cut to a clip by themselves. "
                    "area: the mean over 10, 20, ..., 100 %.",
                    "mean weights: the mean of those after each epoch at the lower rate, in place of the last epoch's, "
                    "with statistics of batch norms from many more training clips.",
                    "best epoch: among those at the lower rate, the one that is best on the test itself. The public "
                    "code reports it, so published figures are held against it. It is no figure for new people.",
                    _told_copies(self.copies, self.tests),
                ),
                bold=frozenset({(max(range(len(self.rows)), key=lambda i: self.rows[i].accuracy[:, whole].mean()), 6)}),
                words=frozenset({1}),
            )
        ]

    def __repr__(self) -> str:
        """Return one line: the data and the number of trainings."""
        return f"PublishedReport({self.data}: {len(self.rows)} rows of {len(self.seeds)} trainings)"

    def __str__(self) -> str:
        """Return the table."""
        return text(*self.tables())

    def _repr_html_(self) -> str:
        """Return the table for a notebook."""
        return "".join(map(html, self.tables()))


def published(
    data: str,
    *,
    out: str | Path,
    size: Size = "small",
    seeds: Sequence[int] = (0,),
    forms: Sequence[Form] = FORMS,
    streams: Sequence[Stream] = STREAMS,
    epochs: int = PUBLISHED_EPOCHS,
    device: str = "cpu",
    threads: int = 0,
) -> PublishedReport:
    """Train forms by the published protocol on joints, on bones, or on both for an ensemble, and test them.

    Args:
        data: an .npz with 3D joints and a split, such as Northwestern-UCLA by camera.
        out: folder of the results; what is done there is kept, and a training goes on from its last epoch.
        size: widths of the networks.
        seeds: seeds of the trainings of each form and stream.
        forms: what is trained. Processes may train different forms or streams into one folder, side by side; one that
            then asks for all of them trains nothing, and writes the whole table.
        streams: what networks see: joints, bones, or both, and then both together as well.
        epochs: epochs of each training.
        device: torch device.
        threads: CPU threads of torch; with 0, torch decides.

    Raises:
        UsageError: the number of epochs is below 1, a seed is no seed, there is no form or stream, one that does not
            exist or one twice, or `out` holds results of other data, or a run.
        DataError: the data is malformed, or has no split.
        ModelError: a loss is not finite, or a checkpoint is damaged.
    """
    check_seeds(seeds)
    for name, chosen, known in (("forms", forms, FORMS), ("streams", streams, STREAMS)):
        if not chosen or len(set(chosen)) < len(chosen) or not {*chosen} <= {*known}:
            got = " ".join(chosen) or "none"
            raise UsageError(f"--{name}: got {got}, expected {' or '.join(known)}, each once")
    if epochs < 1:
        raise UsageError(f"--epochs: got {epochs}, expected at least 1")
    check_device(device)
    use_threads(threads)
    motion, folder = load_data(data), Path(out)
    check_no_run(folder)
    unseen = unseen_test(motion)
    runs = [PublishedRun(form, stream, size, seed, epochs) for form in forms for seed in seeds for stream in streams]
    results = train_published(runs, motion, folder, device=device, report=_epoch_done)
    answers = iter(results)
    held = {form: [[next(answers) for _ in streams] for _ in seeds] for form in forms}
    arithmetic = {result.arithmetic for result in results}
    assert motion.is_test is not None
    test = np.flatnonzero(motion.is_test)
    labels, new = motion.labels[test], np.isin(test, unseen)
    copies = tuple(motion.class_names[label] for label in labels[~new])
    together: Sequence[tuple[str, slice]] = (
        *((stream, slice(i, i + 1)) for i, stream in enumerate(streams)),
        *([(" + ".join(streams), slice(None))] if len(streams) > 1 else []),
    )
    rows = []
    for form, trained in held.items():
        for name, part in together:
            ensembles = [members[part] for members in trained]  # of each seed, a result for each stream of the row
            whole = [accuracies([one.log_probs for one in members], labels) for members in ensembles]
            without_copies = [accuracies([one.log_probs[new] for one in members], labels[new]) for members in ensembles]
            mean = [accuracies([one.mean for one in members], labels) for members in ensembles]
            best = [accuracies([one.best for one in members], labels) for members in ensembles]
            rows.append(PublishedRow(form, name, *map(np.array, (whole, without_copies, mean, best))))
    found = PublishedReport(
        motion.title, size, epochs, tuple(seeds), tuple(rows), len(new), copies, tuple(sorted(arithmetic))
    )
    kept = {**asdict(found), "rows": [_for_json(row) for row in rows]}
    write_text(folder / "summary.json", [json_text(kept)])
    write_text(folder / TABLE, [markdown(*found.tables())])
    return found


def _epoch_done(run: PublishedRun, epoch: int, loss: float) -> None:
    """Print how far a training is."""
    print(f"{run.name}: {epoch} of {run.epochs} epochs, loss {loss:.3f}", file=sys.stderr, flush=True)


def _told_trainings(count: int) -> str:
    """Return the sentence that says how many trainings a figure rests on."""
    if count == 1:
        return "One training of each."
    return f"{count} trainings of each; behind ± stands the standard deviation over them."


def _told_copies(copies: Sequence[str], tests: int) -> str:
    """Return the line that says which test sequences are copies."""
    if not copies:
        return "No test sequence is a copy of a training sequence."
    classes = ", ".join(sorted(set(copies)))
    return (
        f"{len(copies)} of {tests} test sequences are copies of training sequences, frame by frame: of {classes}. "
        "One column leaves them out."
    )


def _for_json(row: PublishedRow) -> dict[str, Any]:
    """Return a row with its arrays as lists."""
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in vars(row).items()}


def _spread(values: FloatArray) -> str:
    """Return the mean over trainings, and their standard deviation if there are several."""
    return f"{values.mean():.1f}" + (f" ± {values.std(ddof=1):.1f}" if len(values) > 1 else "")
