"""What a folder of weights gives a watcher, without the data of their training: recogniser, planner and belief."""

from dataclasses import replace
from pathlib import Path

from ehar.conditions import Conditions
from ehar.errors import ModelError, UsageError
from ehar.files import read_json
from ehar.flight.vehicle import Vehicle
from ehar.planner import Planner
from ehar.world import World, load_world
from eval.scores.resampling.training_seeds import split_record_name
from planners.agents.agent import Agent
from planners.agents.storage import open_stream_agent
from planners.place.storage import FixedPlace, fixed_place_path, open_fixed_place
from planners.registry import resolve_planner
from planners.value.belief.streams import StreamBeliefModel
from planners.value.model import GainModel, open_gain_model, used_gain_model
from recognition.storage import open_recogniser, recogniser_path
from recognition.streaming import StreamingRecogniser
from recognition.weight_files import check_world

_UNTOLD = "nobody tells a live loop where they are"


def conditions_of(models: str | Path, sensor: str, views: str, vehicle: str | Path | Vehicle) -> Conditions:
    """Return the conditions of weights: the folder, what they were trained through and on, and what flies."""
    return Conditions(data="streams.npz", models=models, sensor=sensor, views=views, track=vehicle)


def live_recogniser(conditions: Conditions) -> StreamingRecogniser:
    """Return the recogniser of a folder of weights.

    Raises:
        ModelError: it is missing or malformed, or of a world with obstacles.
    """
    recogniser = open_recogniser(recogniser_path(Path(conditions.models or ""), conditions), conditions)
    assert isinstance(recogniser, StreamingRecogniser)  # the form of these conditions
    if recogniser.spec.world.obstacles:
        raise ModelError(
            f"{conditions.models}: weights of the world {recogniser.spec.world.name}, which has obstacles: {_UNTOLD}; "
            "expected weights of an open world"
        )
    return recogniser


def live_world(world: str | Path | World, trained: World, conditions: Conditions | None) -> World:
    """Return a world that is that of the weights but for its localisation.

    Raises:
        UsageError: there is no such world, or it has obstacles.
        ModelError: the weights were trained in another one.
    """
    asked = load_world(world)
    if asked.obstacles:
        raise UsageError(f"world {asked.name}, which has obstacles: {_UNTOLD}; expected an open one")
    check_world(Path("models" if conditions is None else conditions.models or ""), trained, Conditions(world=asked))
    return asked


def live_planner(spec: str | Planner, recogniser: StreamingRecogniser, conditions: Conditions | None) -> Planner:
    """Return a planner that needs no truth, with its weights.

    Args:
        spec: name or object of the planner, or your own: file.py:Class.
        recogniser: the recogniser that it will work with.
        conditions: where its weights are; None where there is no folder.

    Raises:
        ModelError: its weights are missing, or belong to another recogniser or to clips.
        UsageError: the planner is unknown, or nobody can tell it live what it needs.
    """

    def load_model() -> GainModel:
        told = _world_of(recogniser, conditions, spec)
        path, joints = used_gain_model(Path(told.models or ""), told), len(recogniser.spec.skeleton.joint_names)
        return open_gain_model(path, told, joints, recogniser.sha256)

    def load_place() -> FixedPlace:
        told = _world_of(recogniser, conditions, spec)
        return open_fixed_place(fixed_place_path(Path(told.models or ""), told), told, recogniser.sha256)

    def load_agent(name: str) -> Agent:
        told, (stage, seed) = _world_of(recogniser, conditions, spec), split_record_name(name)
        folder = Path(told.models or "")
        agent = open_stream_agent(folder, told, stage, recogniser_sha256=recogniser.sha256, seed=seed)
        agent.name = name
        return agent

    planner, _ = resolve_planner(spec, load_model, load_agent, load_place)
    if planner.privileged:
        raise UsageError(f"planner {planner.name!r}: expected one that needs no truth: nobody knows it live")
    return planner


def _world_of(recogniser: StreamingRecogniser, conditions: Conditions | None, spec: str | Planner) -> Conditions:
    """Return the conditions of a planner's weights, in the recogniser's world."""
    if conditions is None:
        raise UsageError(f"planner {spec!r}: expected models to be a folder with its weights, got a recogniser")
    return replace(conditions, world=recogniser.spec.world)


def live_belief(belief: str | Path | StreamBeliefModel | None, classes: int) -> StreamBeliefModel:
    """Return the belief over K activities and none, `classes` in all.

    Raises:
        ModelError: it is missing, malformed, or over other activities.
    """
    if belief is None:
        return StreamBeliefModel.believing((1 / classes,) * classes)
    if isinstance(belief, StreamBeliefModel):
        model, where = belief, "belief"
    else:
        what = "a belief, as `ehar study belief` of streams writes it"
        model, where = (
            read_json(Path(belief), StreamBeliefModel, what, optional=("learned",), wrong=ModelError),
            str(belief),
        )
    if model.classes + 1 != classes:
        raise ModelError(f"{where}: expected a belief over {classes - 1} activities, got one over {model.classes}")
    return model
