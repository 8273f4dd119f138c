"""Training of gain fields, end to end: it stops and goes on, workers decide nothing, what can't be is refused."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.data.motion_data import MotionData
from ehar.data.motion_file import load_motion, save_motion
from ehar.data.recordings import UNKNOWN_SUBJECT
from ehar.data.scenario import split_parts
from ehar.errors import DataError, EharError, ModelError, UsageError
from ehar.motion import GridMotion
from planners.value import collection as gain_collection
from planners.value import fit as gain_fit
from planners.value import training as gain_training
from planners.value.belief.clips import BeliefModel
from planners.value.belief.clips_fit import fit_belief
from planners.value.body_filter import trunk_pairs
from planners.value.collection import Collection, CollectionTask, collect_batch
from planners.value.config import GainTrainingConfig
from planners.value.fit import VARIANTS, Fit, Scores, fit_field
from planners.value.model import GainModel, gain_model_path, load_gain_model
from planners.value.training import _performers, train_gain_field
from recognition.storage import load_recogniser
from tests.helpers.fakes import tiny_data
from tests.helpers.random_networks import save_random_world
from tests.helpers.settings import changed, tiny_conditions
from tests.helpers.small_trainings import searching

LENGTH = 8
LED = [0, 0, 1, 2]  # batches of the second round, the first of them of unseen people


@pytest.fixture(autouse=True)
def little_of_everything(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gain_collection, "EPISODES", 6)
    monkeypatch.setattr(gain_fit, "PENALTIES", (1.0,))
    monkeypatch.setattr(gain_fit, "CONSTANT_SHARES", (0.1,))
    monkeypatch.setattr(gain_fit, "EMBEDDING_DIRECTIONS", 2)
    monkeypatch.setattr(gain_fit, "FOLDS", 2)
    monkeypatch.setattr(gain_training, "UNSEEN_BATCHES", 1)


@pytest.fixture
def config(tmp_path: Path) -> GainTrainingConfig:
    """Return 3 batches of tiny data, with a recogniser that has learned nothing."""
    save_random_world(tmp_path, LENGTH)
    return GainTrainingConfig(conditions=tiny_conditions(tmp_path, length=LENGTH), batches=3, workers=1)


def silent(what: str, done: int, whole: int) -> None:
    """Hear nothing."""


def weights_path(config: GainTrainingConfig) -> Path:
    directory = config.out or config.conditions.directory
    assert directory is not None
    return gain_model_path(directory, config.conditions)


def written(config: GainTrainingConfig) -> tuple[bytes, Any]:
    """Return the weights, and the description without where it was written to."""
    path = weights_path(config)
    description = json.loads(path.with_suffix(".json").read_text())
    del description["training"]["out"]
    return path.read_bytes(), description


def loaded(config: GainTrainingConfig) -> GainModel:
    data = motion(config)
    recogniser = load_recogniser(config.conditions, data)
    return load_gain_model(replace(config.conditions, models=weights_path(config).parent), data, recogniser.sha256)


def motion(config: GainTrainingConfig) -> MotionData:
    return load_motion(Path(str(config.conditions.data)))


def refusal(error: type[EharError], config: GainTrainingConfig, **changes: Any) -> str:
    """Return the one line that training with other options ends in."""
    with pytest.raises(error) as caught:
        train_gain_field(changed(config, **changes), searching, silent)
    assert "\n" not in str(caught.value)
    return str(caught.value)


class Stopped(Exception):
    """Ctrl-C."""


def stop_after(batches: int) -> Callable[[str, int, int], None]:
    def report(what: str, done: int, whole: int) -> None:
        if done == batches:
            raise Stopped

    return report


def watch(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return the list that the batches which are run from now on are added to."""
    run: list[int] = []

    def watched(task: CollectionTask, index: int) -> Collection:
        run.append(index)
        return collect_batch(task, index)

    monkeypatch.setattr(gain_collection, "collect_batch", watched)
    return run


def test_a_model_is_trained_saved_and_fits_its_recogniser(config: GainTrainingConfig) -> None:
    reports: list[tuple[str, int, int]] = []
    training = train_gain_field(config, searching, lambda *report: reports.append(report))
    assert training.path == weights_path(config)
    assert list(training.fits) == list(VARIANTS)
    model, data = loaded(config), motion(config)
    for name, fit in training.fits.items():
        assert model.fields[name].parts == VARIANTS[name]
        assert model.fields[name].spread == fit.field.spread
        assert fit.scores.best_gain >= fit.scores.chosen_gain
    assert model.pairs.tolist() == trunk_pairs(data, split_parts(data).policy).tolist()
    assert reports == [
        *(("validation rollouts", done, 1) for done in range(2)),
        *(("rollouts", done, 1) for done in range(2)),
        *(("rollouts", done, 3) for done in range(1, 4)),
        *(("led validation rollouts", done, 1) for done in range(2)),
        *(("led rollouts", done, 3) for done in range(4)),
        *(("regressions", done, 4) for done in range(5)),
    ]
    history = written(config)[1]["training"]
    assert history["length"] == LENGTH
    assert history["data_sha256"] == data.sha256
    assert history["cross_validation"]["full"]["explained"] == training.fits["full"].scores.explained
    assert history["stopped"] == "cut short at 3 batches: too few to tell what more bring"
    assert history["unseen_people"]["3"] == training.unseen[3]._asdict()
    assert "workers" not in history


def test_a_stopped_run_goes_on_where_it_was(
    config: GainTrainingConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    through = replace(config, out=tmp_path / "through")
    stop_and_go = replace(config, out=tmp_path / "stopped")
    train_gain_field(through, searching, silent)
    with pytest.raises(Stopped):
        train_gain_field(stop_and_go, searching, stop_after(2))
    assert not weights_path(stop_and_go).exists()
    run = watch(monkeypatch)
    train_gain_field(stop_and_go, searching, silent)
    assert run == [2, *LED]
    assert written(stop_and_go) == written(through)


def test_more_batches_are_added_to_those_there_are(
    config: GainTrainingConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    train_gain_field(replace(config, batches=1), searching, silent)
    run = watch(monkeypatch)
    train_gain_field(config, searching, silent)
    assert run == [1, 2, *LED]  # another field leads other rollouts
    through = replace(config, out=tmp_path / "through")
    train_gain_field(through, searching, silent)
    assert written(through) == written(config)


@pytest.mark.parametrize("content", [b"", b"nonsense", None])
def test_a_batch_that_is_not_whole_is_run_again(
    config: GainTrainingConfig, monkeypatch: pytest.MonkeyPatch, content: bytes | None
) -> None:
    train_gain_field(config, searching, silent)
    before = written(config)
    kept = list(weights_path(config).parent.glob("*-rollouts-*/1.safetensors"))
    for piece in kept:
        piece.write_bytes(piece.read_bytes()[:-40] if content is None else content)
    run = watch(monkeypatch)
    train_gain_field(config, searching, silent)
    assert len(kept) == 2
    assert run == [1, 1]  # one that wanders and one that is led
    assert written(config) == before


@pytest.mark.parametrize("changes", [{"seed": 1}, {"length": 7}, {"data": "other"}])
def test_batches_of_other_options_or_data_are_not_used(
    config: GainTrainingConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changes: dict[str, Any]
) -> None:
    train_gain_field(config, searching, silent)
    if "data" in changes:
        data = motion(config)
        changes = {"data": str(tmp_path / "other.npz")}
        save_motion(Path(changes["data"]), replace(data, positions=data.positions * 1.01))
    run = watch(monkeypatch)
    train_gain_field(changed(config, **changes), searching, silent)
    assert run == [0, 0, 1, 2, *LED]  # the first one is of unseen people


def test_the_seed_decides(config: GainTrainingConfig, tmp_path: Path) -> None:
    for seed in (0, 1):
        train_gain_field(changed(config, seed=seed, out=tmp_path / str(seed)), searching, silent)
    first, second = (written(replace(config, out=tmp_path / str(seed)))[0] for seed in (0, 1))
    assert first != second


def test_fields_learn_from_the_policy_part_and_the_belief_from_validation_as_well(
    config: GainTrainingConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    run: list[set[int]] = []
    believed: list[set[int]] = []

    def watched(task: CollectionTask, index: int) -> Collection:
        collection = collect_batch(task, index)
        run.append(set(collection.sequences.tolist()))
        return collection

    def believing(*rollouts: Any, **told: Any) -> BeliefModel:
        believed.append(set(rollouts[3].tolist()))
        return fit_belief(*rollouts, **told)

    monkeypatch.setattr(gain_collection, "collect_batch", watched)
    monkeypatch.setattr(gain_training, "fit_belief", believing)
    train_gain_field(config, searching, silent)
    parts = split_parts(motion(config))
    assert believed == [run[0] | run[1]]
    assert run[0] | run[4] <= set(parts.validation.tolist())
    assert set.union(*run[1:4], *run[5:]) <= set(parts.policy.tolist())


def test_where_nobody_is_left_for_validation_other_rollouts_score_a_field(
    config: GainTrainingConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    run: list[tuple[CollectionTask, int]] = []

    def watched(task: CollectionTask, index: int) -> Collection:
        run.append((task, index))
        return collect_batch(task, index)

    parts = replace(split_parts(motion(config)), validation=np.empty(0, dtype=np.int64))
    monkeypatch.setattr(gain_training, "split_parts", lambda data: parts)
    monkeypatch.setattr(gain_collection, "collect_batch", watched)
    training = train_gain_field(config, searching, silent)
    (of_score, first), (of_fit, other) = run[0], run[1]
    assert first == other == 0
    np.testing.assert_array_equal(of_score.sequences, of_fit.sequences)
    scored, fitted = collect_batch(of_score, 0), collect_batch(of_fit, 0)
    assert (scored.viewpoints[:, 0] != fitted.viewpoints[:, 0]).any()
    assert training.scored_on == "other rollouts of the same people"
    history = json.loads(weights_path(config).with_suffix(".json").read_text())["training"]
    assert history["scored_on"] == training.scored_on


def scripted(monkeypatch: pytest.MonkeyPatch, chosen: list[float]) -> None:
    """Let the field pick paths that gain this much on unseen people, with 1, 2, 4, ... batches."""
    left = iter(chosen)
    monkeypatch.setattr(gain_training, "FIRST_BATCHES", 1)
    monkeypatch.setattr(gain_training, "score_field", lambda *given: Scores(0.0, next(left, 0.0), 0.1))


def test_rollouts_stop_when_twice_as_many_gain_nothing(
    config: GainTrainingConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    scripted(monkeypatch, [0.01, 0.02, 0.0205])
    run = watch(monkeypatch)
    training = train_gain_field(replace(config, batches=64), searching, silent)
    assert run[:5] == [0, 0, 1, 2, 3]
    assert not training.cut_short
    assert training.reason == "it had learned: 4 batches instead of 2 gained 0.05 points on validation"


def test_rollouts_that_still_gain_are_cut_short_by_their_limit(
    config: GainTrainingConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    scripted(monkeypatch, [0.01, 0.02, 0.03])
    training = train_gain_field(config, searching, silent)
    assert training.cut_short
    assert training.reason == "cut short at 3 batches: 3 batches instead of 2 gained 1.00 points on validation"


@pytest.mark.parametrize("is_better", [True, False])
def test_the_second_round_is_kept_if_its_field_does_better_where_it_leads(
    config: GainTrainingConfig, monkeypatch: pytest.MonkeyPatch, is_better: bool
) -> None:
    scripted(monkeypatch, [0.01, 0.02, 0.03, 0.04, 0.05 if is_better else 0.03])
    fitted: list[int] = []

    def watched(collection: Collection, *given: Any) -> Fit:
        fitted.append(len(collection.labels))
        return fit_field(collection, *given)

    monkeypatch.setattr(gain_training, "fit_field", watched)
    training = train_gain_field(config, searching, silent)
    before, after = training.second_round
    assert (before.chosen_gain, after.chosen_gain) == (0.04, 0.05 if is_better else 0.03)
    # Three times more and more of the first round, once both rounds, and then the fields for ablations.
    assert fitted == [6, 12, 18, 36, *[36 if is_better else 18] * 3]
    assert written(config)[1]["training"]["second_round"]["kept"] == is_better


def test_a_field_that_is_learned_in_flight_is_that_of_its_vehicle(config: GainTrainingConfig) -> None:
    """It lies beside that of the grid, which vehicles without a field of their own go on using."""
    train_gain_field(config, searching, silent)
    flying = changed(config, track="tracking-drone")
    train_gain_field(flying, searching, silent)
    assert weights_path(flying).name == "gain-field-perfect-moving-tracking-drone.safetensors"
    (_, of_grid), (_, of_vehicle) = written(config), written(flying)
    assert (of_vehicle["training"]["track"], "track" in of_grid["training"]) == ("tracking-drone", False)
    assert (of_vehicle["vehicle"]["name"], of_grid["vehicle"]) == ("tracking-drone", None)
    assert of_grid["training"]["unseen_people"] != of_vehicle["training"]["unseen_people"]
    used = [loaded(changed(config, track=track)).sha256 for track in ("ideal", "px4-auto", "tracking-drone")]
    assert used[0] == used[1] != used[2]


def test_a_field_is_not_learned_in_a_motion_of_your_own(config: GainTrainingConfig) -> None:
    """Such a motion says nothing of what it could do from where it is."""
    refused = refusal(UsageError, config, track=GridMotion())
    assert refused.startswith("train gain-field: expected ideal or a vehicle, got your own motion")


def test_folds_differ_in_people_where_they_are_known() -> None:
    data = tiny_data(sequences=6)
    people = np.array([4, 4, 7, 7, 7, 9])[:, None]
    found = _performers(replace(data, subjects=people), np.array([0, 5, 1, 3]))
    assert found.tolist() == [0, 2, 0, 1]
    for subjects in (np.full((6, 1), UNKNOWN_SUBJECT), np.full((6, 1), 3)):
        assert _performers(replace(data, subjects=subjects), np.array([0, 5, 1])).tolist() == [0, 5, 1]


@pytest.mark.slow
def test_workers_decide_nothing(config: GainTrainingConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gain_collection, "EPISODES", 32)  # as in the workers, which import the module anew
    runs = [replace(config, workers=workers, out=tmp_path / str(workers)) for workers in (1, 2)]
    for run in runs:
        train_gain_field(run, searching, silent)
    assert written(runs[0]) == written(runs[1])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"batches": 0}, "batches: expected at least 1, got 0"),
        ({"workers": -1}, "workers: expected at least 1, got -1"),
        ({"length": 2}, "length: expected at least 3, got 2"),
        ({"length": -8}, "length: expected a whole number of at least 1, got -8"),
        ({"seed": -1}, "seed: expected a whole number of at least 0, got -1"),
        ({"models": None}, "train gain-field: expected --models DIR, or --out DIR"),
        ({"sensor": "radar"}, "unknown sensor 'radar'"),
        ({"views": "spiral"}, "unknown views 'spiral'"),
        ({"data": "trio"}, "unknown data 'trio'"),
        ({"fps": 0.0}, "fps: got 0.0"),
        ({"onset": "known"}, "onset: expected unknown in a training, got known"),
    ],
)
def test_options_that_make_no_sense(config: GainTrainingConfig, changes: dict[str, Any], message: str) -> None:
    assert message in refusal(UsageError, config, **changes)


def test_the_shortest_episodes(config: GainTrainingConfig) -> None:
    training = train_gain_field(changed(config, length=3), searching, silent)
    assert all(abs(fit.scores.explained) < 2 for fit in training.fits.values())


def test_a_recogniser_that_is_not_there(config: GainTrainingConfig) -> None:
    assert "estimator-moving" in refusal(ModelError, config, sensor="estimator")
    assert "--views paper" in refusal(ModelError, config, views="paper")


def test_episodes_longer_than_any_sequence(config: GainTrainingConfig) -> None:
    message = refusal(DataError, config, length=21)
    assert message == "tiny: expected at least 2 policy sequences of at least 21 frames, got 0"


def test_a_field_cannot_be_judged_by_the_one_sequence_it_is_fitted_on(
    config: GainTrainingConfig, tmp_path: Path
) -> None:
    data = tiny_data(sequences=24)
    policy = split_parts(data).policy
    lengths = np.where(np.isin(np.arange(24), policy[1:]), LENGTH - 1, 20)
    pieces = [data.sequence(i)[: lengths[i]] for i in range(24)]
    short = replace(data, positions=np.concatenate(pieces), offsets=np.cumsum([0, *lengths]))
    save_motion(tmp_path / "one.npz", short)
    message = refusal(DataError, config, data=str(tmp_path / "one.npz"))
    assert message.endswith("expected at least 2 policy sequences of at least 8 frames, got 1")
