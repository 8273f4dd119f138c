"""Checks that the data, the weights and your own classes are those that the run had."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from ehar.conditions import Conditions
from ehar.data.motion_data import MotionData
from ehar.data.streams.data import StreamData
from ehar.errors import EharError, ModelError, UsageError
from ehar.files import shortened
from ehar.localisation import Localisation
from ehar.plugins.class_spec import parse_spec
from ehar.track import load_track
from ehar.world import load_world
from eval.records.config import CONFIG, RunConfig
from eval.running.choice import ModelPlace
from eval.verification.checks import FAILED, OK, UNCHECKED, Check
from planners.place.storage import FixedPlace
from planners.registry import is_learned, needs_fixed_place
from recognition.own_recogniser import resolve_recogniser
from recognition.setting import Setting, load_setting

if TYPE_CHECKING:
    from planners.value.model import GainModel

DECISIVE = ("data", "recogniser", "sensor", "motion")  # if one of them differs, every episode does


class Trained(NamedTuple):
    """How weights were trained; None where it is not known, or has no meaning."""

    length: int | None
    localisation: Localisation | None


class Inputs(NamedTuple):
    """The inputs of a run, as far as they are here and have the run's hashes.

    Args:
        checks: checks of data, recogniser, your own sensor and motion, gain model and agents.
        setting: data, recogniser, sensor and track; None if one of them is not here.
        data: the data; None if they are not here, or have another hash.
        place: place of gain models and agents; None without data, which they have to fit.
        trained: how the gain field, agents and a fixed place were trained, those that are here and the run's.
    """

    checks: tuple[Check, ...]
    setting: Setting | None = None
    data: MotionData | StreamData | None = None
    place: ModelPlace | None = None
    trained: Mapping[str, Trained] = MappingProxyType({})

    @property
    def reason_against(self) -> str | None:
        """The reason why the run's episodes cannot run here; None if they can."""
        if self.setting is not None and not any(
            check.name in DECISIVE and check.result == FAILED for check in self.checks
        ):
            return None
        return next(check.what for check in self.checks if check.result != OK)


def check_inputs(
    config: RunConfig, data: str | Path | None, models: str | Path | None, *, run_own_code: bool = False
) -> Inputs:
    """Load the inputs of a run, and compare their hashes with those of the run.

    Args:
        config: configuration of the run.
        data: present place of the data; None takes the recorded place.
        models: present place of the weights; None takes the recorded place.
        run_own_code: whether to load your own recogniser, sensor and motion; this runs their files or modules.

    Raises:
        EharError: `data` or `models` is given and cannot be read.
    """
    from ehar.data.any_source import load_recordings  # imported here: too slow for `ehar --help`

    told = config.conditions
    if config.made_of:
        each = ", ".join(config.made_of)
        return _unchecked((Check("data", UNCHECKED, f"a run of {config.parts} has the data and weights of {each}"),))
    source = told.data if data is None else data
    try:
        motion = load_recordings(str(source), fps=told.fps)
    except EharError as error:
        if data is not None:
            raise
        return _unchecked((Check("data", UNCHECKED, f"{error}; --data says where they lie now"),))
    checks: tuple[Check, ...] = (_compared("data", config.data_sha256, motion.sha256, str(source)),)
    if checks[0].result == FAILED:
        return _unchecked(checks)
    here = replace(told, data=motion, fps=None, models=told.models if models is None else models)
    place = ModelPlace(here, motion, config.form, config.recogniser_sha256, config.trained_elsewhere)
    own = None if told.recogniser is None else str(told.recogniser)
    brought = _own_sensor_and_motion(config, motion, run_own_code=run_own_code)
    reason = None if own is None else _why_not_loaded("recogniser", own, run_own_code=run_own_code)
    setting, sha256 = None, ""
    try:
        if reason is None and all(check.result != UNCHECKED for check in brought):
            flown = None if config.track_sha256 is not None else config.vehicle
            setting = load_setting(replace(here, track=flown or told.track))
            sha256 = setting.recogniser_sha256
        elif reason is None:
            sha256 = _recogniser_sha256(here, motion)
    except EharError as error:
        if own is not None:
            reason = str(error)
        elif models is not None or not isinstance(error, ModelError):
            raise
        else:
            reason = f"{error}; --models says where it lies now"
    if reason is not None:
        checks += (Check("recogniser", UNCHECKED, reason),)
    else:
        where = own or str(here.models or "the weights that ship with ehar")
        checks += (_compared("recogniser", config.recogniser_sha256, sha256, where),)
    of_planners, trained = _planner_weights(config, place)
    return Inputs((*checks, *brought, *of_planners), setting, motion, place, trained)


def _own_sensor_and_motion(config: RunConfig, data: MotionData | StreamData, *, run_own_code: bool) -> list[Check]:
    """Return checks that the files of your own sensor and motion are those of the run; none for ehar's own."""
    from ehar.sensors.registry import load_sensor  # imported here: too slow for `ehar --help`

    told, world = config.conditions, config.world
    brought: tuple[tuple[str, str, str | None, Callable[[], str | None]], ...] = (
        ("sensor", str(told.sensor), config.sensor_sha256, lambda: load_sensor(told.sensor, data, world).sha256),
        ("motion", str(told.track), config.track_sha256, lambda: load_track(told.track, world.workspace).sha256),
    )
    checks = []
    for name, spec, ran, load in brought:
        if ran is None:
            continue
        reason = _why_not_loaded(name, spec, run_own_code=run_own_code)
        try:
            found = None if reason is not None else load()
        except EharError as error:
            reason = str(error)
        checks.append(Check(name, UNCHECKED, reason) if reason else _compared(name, ran, str(found), spec))
    return checks


def _recogniser_sha256(conditions: Conditions, data: MotionData | StreamData) -> str:
    """Return the hash of the recogniser, without loading the rest of the setting."""
    from recognition.storage import load_recogniser  # brings torch

    if conditions.recogniser is not None:
        return resolve_recogniser(conditions.recogniser, data, load_world(conditions.world)).sha256
    return load_recogniser(conditions, data).sha256


def _why_not_loaded(name: str, own: str, *, run_own_code: bool) -> str | None:
    """Return why your own class is not loaded; None if it can be loaded."""
    spec = parse_spec(own)
    if spec is None or not spec.place:
        return f"{name} {own}: not replayable, as it was given as an object"
    return None if run_own_code else f"{own} runs with --rerun-episodes only"


def _unchecked(checks: tuple[Check, ...]) -> Inputs:
    """Return inputs without data; weights cannot be loaded without data."""
    return Inputs((*checks, Check("weights", UNCHECKED, "they can be loaded with the data only")))


def _compared(name: str, got: str, expected: str, where: str) -> Check:
    if got == expected:
        return Check(name, OK, f"{where}, sha256 {shortened(expected)}...")
    return Check(name, FAILED, f"{CONFIG}: {name}: got sha256 {got}, expected {expected}, which {where} has")


def _planner_weights(config: RunConfig, place: ModelPlace) -> tuple[list[Check], dict[str, Trained]]:
    """Return the checks of the gain model, of the fixed place and of the agents, and how they were trained."""
    checks: list[Check] = []
    found: dict[str, Trained] = {}

    def compare(name: str, ran: str, weights: "GainModel | FixedPlace", key: str) -> None:
        checks.append(_compared(name, ran, weights.sha256, str(place.models or "ehar")))
        if weights.sha256 == ran:
            found[key] = Trained(weights.length, weights.localisation)

    if config.gain_model_sha256 is not None:
        try:
            compare("gain model", config.gain_model_sha256, place.load_gain_model(), "gain field")
        except ModelError as error:
            checks.append(Check("gain model", UNCHECKED, str(error)))
    agents = []
    for planner in config.planners:
        if planner.weights_sha256 is None:
            continue
        if not needs_fixed_place(planner.name):
            agents.append(planner)
            continue
        try:
            compare("fixed place", planner.weights_sha256, place.load_fixed_place(), planner.name)
        except ModelError as error:
            checks.append(Check("fixed place", UNCHECKED, str(error)))
    absent = []
    for planner in agents:
        try:
            if not is_learned(planner.name):
                raise UsageError("no weights are known by this name")
            agent = place.load_agent(planner.name)
        except EharError as error:
            absent.append(f"{planner.name}: {error}")
            continue
        if agent.sha256 != planner.weights_sha256:
            got, expected = planner.weights_sha256, f"{agent.sha256}, as in {place.models}"
            difference = f"{CONFIG}: {planner.name}: weights_sha256: got {got}, expected {expected}"
            return [*checks, Check("agents", FAILED, difference)], found
        found[planner.name] = Trained(agent.length, agent.localisation)
    if agents:
        several = f"{len(agents)} training{'s' * (len(agents) != 1)}"
        what = f"{len(absent)} of {len(agents)}: {absent[0]}" if absent else several
        checks.append(Check("agents", UNCHECKED if absent else OK, what))
    return checks, found
