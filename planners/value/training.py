"""Trains gain fields and belief for one recogniser: branching rollouts on the policy part, then regressions."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load_file, save

from ehar.arrays import IntArray
from ehar.data.motion_data import MotionData
from ehar.data.recordings import UNKNOWN_SUBJECT, Recordings
from ehar.data.scenario import people_together, split_parts, strangers
from ehar.data.streams.data import NO_ACTIVITY, StreamData
from ehar.errors import DataError, UsageError
from ehar.files import check_folder, write_bytes
from ehar.planner import Planner
from ehar.processes import Engine, Processes
from ehar.track import IDEAL
from ehar.world import PAPER
from planners.value.belief.clips import BeliefModel
from planners.value.belief.clips_fit import fit_belief
from planners.value.belief.streams import StreamBeliefModel
from planners.value.belief.streams_fit import fit_evidence, learn_chain
from planners.value.body_filter import trunk_pairs
from planners.value.collection import Collection, CollectionTask, join, run_batches
from planners.value.config import GainTrainingConfig
from planners.value.field import GainField
from planners.value.fit import (
    STREAM_VARIANTS,
    VARIANTS,
    Fit,
    Scores,
    fit_field,
    fork_situations,
    score_field,
    stream_situations,
)
from planners.value.model import FULL, GainModel, gain_model_path, load_gain_model, save_gain_model
from planners.value.situation import (
    FLIGHT_LOOKAHEAD,
    FLIGHT_WINDOW,
    STREAM_LOOKAHEAD,
    STREAM_WINDOW,
    USUAL_MEMORY,
    Situation,
)
from planners.value.view_basis import DistanceRange
from recognition.setting import load_setting, refuse_loss, refuse_told_onsets, with_length

LEAST_LENGTH = 3  # frames of an episode: views along a path spread only if there are two to come
ROLLOUTS = 5  # counts what decides rollouts beside their key, so that none of before a change are read
OTHER_SEED = 1_000_003  # added to the seed of rollouts of the same people that no field is fitted on
FIRST_BATCHES = 12  # of rollouts; then twice as many, and so on
UNSEEN_BATCHES = 6  # on the validation part: they tell when more rollouts gain nothing, and fit the belief with as many
WORTH = 0.001  # rollouts go on while twice as many gain at least this probability on the validation part


@dataclass(frozen=True)
class GainTraining:
    """The result of a training.

    Args:
        path: the weights.
        fits: the fields, with their scores in cross-validation.
        unseen: the scores of the full field on other rollouts, by the number of batches.
        scored_on: whose rollouts these are.
        second_round: the scores there, at forks of cameras of which six in ten follow the planner, and the others
            stay: of the field before the second round, and of that after it.
        cut_short: whether more rollouts would have been worth it, or nobody knows.
    """

    path: Path
    fits: dict[str, Fit]
    unseen: dict[int, Scores]
    scored_on: str
    second_round: tuple[Scores, Scores]
    cut_short: bool

    @property
    def reason(self) -> str:
        """Why it stopped, in words."""
        batches = list(self.unseen)
        gained = ""
        if len(batches) > 1:
            gain = self.unseen[batches[-1]].chosen_gain - self.unseen[batches[-2]].chosen_gain
            gained = f"{batches[-1]} batches instead of {batches[-2]} gained {100 * gain:.2f} points"
            gained += f" on {self.scored_on}"
        if not self.cut_short:
            return f"it had learned: {gained}"
        return f"cut short at {batches[-1]} batches: {gained or 'too few to tell what more bring'}"


def train_gain_field(
    config: GainTrainingConfig,
    lead: Callable[[GainModel], Planner],
    report: Callable[[str, int, int], None],
    note: Callable[[str], None] = lambda _: None,
    engine: Engine | None = None,
) -> GainTraining:
    """Train and save; batches of rollouts that a stopped run has finished are not run again.

    In the first round cameras wander or stay, until twice the rollouts gain nothing. In the second round six in
    ten follow a planner that has the first round's field, and the others stay. So the field also knows the places that
    such a planner gets to. The second round is kept if its field does better on such rollouts of the validation part.

    In streams episodes are windows of 8 s, or as long as the conditions say, and paths are as long as planners look
    ahead. With a vehicle, it flies the paths, windows have 9 s, and the second round is flown too.

    Args:
        config: the settings of the training.
        lead: makes the planner that leads the second round from a model.
        report: called with progress: the name of the task, the amount done, and the total.
        note: called with a line if the recogniser was trained at another length, or with another localisation.
        engine: runs the rollouts; None means worker processes, as many as `config` says.

    Raises:
        EharError: data or recogniser are missing or do not fit, or a number is too small.
    """
    conditions = config.conditions
    for name, value, least in (
        ("batches", config.batches, 1),
        ("workers", config.workers, 1),
        ("length", conditions.frames, LEAST_LENGTH),
    ):
        if value < least:
            raise UsageError(f"{name}: expected at least {least}, got {value}")
    refuse_told_onsets(conditions)
    directory = config.out or conditions.directory
    if directory is None:
        raise UsageError("train gain-field: expected --models DIR, or --out DIR where the shipped recogniser is used")
    check_folder(directory)
    setting = load_setting(conditions, device=config.device)
    for line in setting.notes:
        note(f"warning: {line}")
    if setting.runner.track.own is not None:
        raise UsageError(
            f"train gain-field: expected {IDEAL} or a vehicle, got your own motion {setting.runner.track.named}"
        )
    data, policy = setting.recordings, split_parts(setting.recordings).policy
    flown = setting.runner.track.vehicle is not None
    length = with_length(conditions, data, FLIGHT_WINDOW if flown else STREAM_WINDOW).frames
    lookahead = FLIGHT_LOOKAHEAD if flown else STREAM_LOOKAHEAD
    sequences = policy[data.lengths[policy] >= length]
    if len(sequences) < 2:  # a field is judged on sequences that it was not fitted on
        raise DataError(
            f"{data.name}: expected at least 2 policy sequences of at least {length} frames, got {len(sequences)}"
        )
    task = CollectionTask(
        runner=setting.runner,
        sequences=sequences,
        length=length,
        pairs=trunk_pairs(data, sequences),
        seed=conditions.seed,
        memory=getattr(setting.runner.recogniser, "memory", None) or USUAL_MEMORY,
    )
    path = gain_model_path(directory, conditions)
    refuse_loss(path, setting, load_gain_model)
    key = f"{ROLLOUTS} {data.sha256} {setting.recogniser_sha256} {length} {conditions.seed}"
    key += "" if setting.sensor_sha256 is None else f" {setting.sensor_sha256}"
    world = setting.world
    key += "" if world.agrees_with(PAPER) else f" {world.to_json()}"
    key += "" if not flown else f" {setting.runner.track.vehicle}"
    rollouts = _Rollouts(config, path, key, report, engine or Processes(config.workers))
    unseen_task, scored_on = _unseen(task)
    unseen = rollouts.run(unseen_task, rollouts.few, "validation rollouts", "unseen")
    heard = join([rollouts.run(task, rollouts.few, "rollouts", ""), unseen])
    belief = _fitted_belief(data, policy, heard, DistanceRange.of(world.workspace))
    variants = VARIANTS if isinstance(belief, BeliefModel) else STREAM_VARIANTS

    def situated(collection: Collection) -> Situation:
        if isinstance(belief, BeliefModel):
            return fork_situations(collection, belief)
        return stream_situations(collection, belief, fps=data.fps, memory=task.memory, lookahead=lookahead)

    def fit(collection: Collection, parts: tuple[str, ...]) -> Fit:
        return fit_field(collection, situated(collection), parts, _performers(data, collection.sequences))

    def model_of(fields: dict[str, GainField]) -> GainModel:
        return GainModel(fields, belief, task.pairs, memory=task.memory, lookahead=lookahead)

    scores: dict[int, Scores] = {}
    while not _has_learned(scores) and config.batches not in scores:
        batches = min(FIRST_BATCHES * 2 ** len(scores), config.batches)
        collection = rollouts.run(task, batches, "rollouts", "")
        full = fit(collection, variants[FULL])
        scores[batches] = score_field(full.field, unseen, situated(unseen))

    leader = lead(model_of({FULL: full.field}))
    led_by = f"led by {hashlib.sha256(full.field.absolute.tobytes() + full.field.relative.tobytes()).hexdigest()}"
    led_unseen = rollouts.run(
        replace(unseen_task, lead=leader), rollouts.few, "led validation rollouts", f"{led_by} unseen"
    )
    both = join([collection, rollouts.run(replace(task, lead=leader), batches, "led rollouts", led_by)])
    second = fit(both, variants[FULL])
    before, after = (score_field(each.field, led_unseen, situated(led_unseen)) for each in (full, second))
    if after.chosen_gain > before.chosen_gain:
        collection, full = both, second
    fits: dict[str, Fit] = {}
    for name, parts in variants.items():
        report("regressions", len(fits), len(variants))
        fits[name] = full if name == FULL else fit(collection, parts)
    report("regressions", len(variants), len(variants))
    trained = GainTraining(path, fits, scores, scored_on, (before, after), not _has_learned(scores))
    model = model_of({name: fit.field for name, fit in fits.items()})
    told = setting.conditions
    history: dict[str, Any] = {
        **{name: getattr(told, name) for name in ("data", "models")},
        "out": None if config.out is None else str(config.out),
        **{name: getattr(told, name) for name in ("sensor", "views")},
        "length": length,
        "fps": told.fps,
        "batches": batches,
        "stopped": trained.reason,
        "cut_short": trained.cut_short,
        "seed": told.seed,
        "data_sha256": data.sha256,
        "cross_validation": {name: {"penalties": fit.penalties, **fit.scores._asdict()} for name, fit in fits.items()},
        "scored_on": scored_on,
        "unseen_people": {str(count): found._asdict() for count, found in scores.items()},
        "second_round": {"before": before._asdict(), "after": after._asdict(), "kept": collection is both},
    }
    own = {
        "track": told.track if flown else None,
        "recogniser": told.recogniser,
        "sensor_sha256": setting.sensor_sha256,
    }
    history |= {name: value for name, value in own.items() if value is not None}
    save_gain_model(
        path,
        model,
        recogniser_sha256=setting.recogniser_sha256,
        history=history,
        world=world,
        vehicle=setting.runner.track.vehicle,
    )
    return trained


def _unseen(task: CollectionTask) -> tuple[CollectionTask, str]:
    """Return a task of rollouts that no field is fitted on, and whose they are.

    They are of the sequences of the validation part that are long enough. If there are none, other rollouts of the
    policy part are all that is left.
    """
    data = task.runner.data
    assert isinstance(data, MotionData | StreamData)
    validation = split_parts(data).validation
    long_enough = validation[data.lengths[validation] >= task.length]
    if len(long_enough):
        return replace(task, sequences=long_enough), "validation"
    return replace(task, seed=task.seed + OTHER_SEED), "other rollouts of the same people"


def _fitted_belief(
    data: MotionData | StreamData, policy: IntArray, heard: Collection, span: DistanceRange
) -> BeliefModel | StreamBeliefModel:
    """Return the belief that explains rollouts best; in streams durations and order are those of the policy part.

    It learns from rollouts on people whom the recogniser does not know: the recogniser is surer of those it knows.
    """
    rows = np.isin(heard.sequences, strangers(data, heard.sequences))
    log_probs, viewpoints, labels, sequences = (
        getattr(heard, name)[rows] for name in ("log_probs", "viewpoints", "labels", "sequences")
    )
    if isinstance(data, MotionData):
        return fit_belief(log_probs, viewpoints, labels, sequences, span=span)
    labels = np.where(labels == len(data.class_names), NO_ACTIVITY, labels)
    chain = learn_chain(data, policy, split_parts(data).recogniser)
    return fit_evidence(chain, log_probs, viewpoints, labels, fps=data.fps, span=span)


def _performers(data: Recordings, sequences: IntArray) -> IntArray:
    """Return who performs in each sequence, as numbers (E,); the sequences, if they are unknown or all the same.

    Couples who share a person are one group, if that leaves several (`people_together`).
    """
    people = np.sort(data.subjects[sequences], axis=1)
    if (people == UNKNOWN_SUBJECT).any():
        return sequences
    groups = people_together(people)
    return groups if np.ptp(groups) else sequences


def _has_learned(scores: Mapping[int, Scores]) -> bool:
    """Return whether the last doubling of the rollouts gained too little to go on."""
    chosen = [found.chosen_gain for found in scores.values()]
    return len(chosen) > 1 and chosen[-1] - chosen[-2] < WORTH


@dataclass(frozen=True)
class _Rollouts:
    """Runs rollouts, and keeps each batch in a folder, from which a resumed run reads it.

    Args:
        config: the settings of the training.
        path: the weights, beside which the folders lie.
        key: everything that decides the rollouts but their kind.
        report: is told of progress.
        engine: runs them.
    """

    config: GainTrainingConfig
    path: Path
    key: str
    report: Callable[[str, int, int], None]
    engine: Engine

    @property
    def few(self) -> int:
        """The number of batches on the validation part."""
        return min(UNSEEN_BATCHES, self.config.batches)

    def run(self, task: CollectionTask, batches: int, what: str, kind: str) -> Collection:
        """Return some batches of branching rollouts.

        Args:
            task: the task.
            batches: their number.
            what: the rollouts in words, for the report.
            kind: what tells them from other rollouts of the same training.
        """
        digest = hashlib.sha256(f"{self.key} {kind}".strip().encode()).hexdigest()
        folder = self.path.with_name(f"{self.path.stem}-rollouts-{digest[:8]}")
        pieces: dict[int, Collection] = {}
        for batch in range(batches):
            piece = _read(folder / f"{batch}.safetensors")
            if piece is not None:
                pieces[batch] = piece
        missing = [batch for batch in range(batches) if batch not in pieces]
        self.report(what, len(pieces), batches)
        for batch, piece in run_batches(task, missing, engine=self.engine):
            pieces[batch] = piece
            tensors = {name.name: np.ascontiguousarray(getattr(piece, name.name)) for name in fields(Collection)}
            write_bytes(folder / f"{batch}.safetensors", save(tensors))
            self.report(what, len(pieces), batches)
        return join([pieces[batch] for batch in range(batches)])


def _read(path: Path) -> Collection | None:
    """Return a batch that was kept; None if it is missing or not whole."""
    try:
        return Collection(**load_file(path))
    except (OSError, SafetensorError, TypeError):
        return None
