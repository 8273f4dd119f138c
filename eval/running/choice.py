"""Chooses the planners of a run, named ones or all that can run, and loads the weights that they need."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ehar.conditions import Conditions
from ehar.data.recordings import Recordings
from ehar.errors import ModelError, UsageError
from ehar.localisation import Localisation
from ehar.planner import Planner
from eval.scores.resampling.training_seeds import SHARED, group_planners, is_shared, record_name, split_record_name
from planners.own_planner import Origin, check_planner_contract
from planners.place.storage import FixedPlace, fixed_place_path, load_fixed_place
from planners.registry import (
    check_spec,
    is_learned,
    needs_fixed_place,
    needs_gain_model,
    planner_names,
    resolve_planner,
)
from planners.shipped import weights_folder
from recognition.setting import Setting

if TYPE_CHECKING:
    from planners.agents.agent import Agent
    from planners.value.model import GainModel

READOUTS = ("recogniser", "belief")
_CAUSAL_FIELDS = "gain fields are trained for the causal recogniser"
_CAUSAL_PLACES = "fixed places are fitted for the causal recogniser"


@dataclass(frozen=True, eq=False)
class ModelPlace:
    """The place of gain models and agents, and the conditions, data and recogniser that they have to fit.

    Args:
        conditions: conditions of the run.
        data: data of the run.
        form: form of the recogniser; for your own, its title.
        recogniser_sha256: hash of the recogniser that they were trained for.
        trained_elsewhere: whether the recogniser was trained on other data, of which readers are warned. What was
            trained for it may be of other data too.
    """

    conditions: Conditions
    data: Recordings
    form: str
    recogniser_sha256: str
    trained_elsewhere: bool = False

    @staticmethod
    def of(setting: Setting) -> "ModelPlace":
        """Return the place of the models for a setting."""
        return ModelPlace(
            setting.conditions, setting.recordings, setting.form, setting.recogniser_sha256, setting.trained_elsewhere
        )

    @property
    def models(self) -> Path | None:
        """The folder of weights; None takes those that ship with ehar."""
        return self.conditions.directory

    def load_gain_model(self) -> "GainModel":
        """Return the gain model.

        Raises:
            ModelError: there is none, or it belongs to another recogniser or other data.
        """
        from planners.value.model import load_gain_model, used_gain_model  # brings torch

        if self.conditions.form != "causal":
            raise ModelError(f"{_CAUSAL_FIELDS}, and this is {self.form}")
        if self._untrained:
            raise ModelError(self._no_gain_field)
        model = load_gain_model(self.conditions, self.data, self.recogniser_sha256)
        self._check_data(
            used_gain_model(self._folder, self.conditions), model.data_sha256, "train the gain field again"
        )
        return model

    def load_fixed_place(self) -> FixedPlace:
        """Return the place of `fixed-best`.

        Raises:
            ModelError: there is none, or it belongs to another recogniser or other data.
        """
        if self.conditions.form != "causal":
            raise ModelError(f"{_CAUSAL_PLACES}, and this is {self.form}")
        if self._untrained:
            what = f"that of {self._training('fixed-best')}"
            raise ModelError(f"no fixed place was fitted for this recogniser: expected {what}")
        place = load_fixed_place(self.conditions, self.data, self.recogniser_sha256)
        self._check_data(fixed_place_path(self._folder, self.conditions), place.data_sha256, "fit it again")
        return place

    def load_agent(self, spec: str) -> "Agent":
        """Return one training of a learned planner, `il-ppo/0`; of `il-ppo` alone the first, by that name.

        Raises:
            ModelError: there is none, it belongs to another data set or recogniser, or none could be trained.
        """
        from planners.agents.storage import load_agent  # brings torch

        if self._untrained:
            raise ModelError(f"planner {spec!r}: {self._no_agent}")
        name, seed = split_record_name(spec)
        if seed is None:
            seed = next(iter(self.seeds(name)), 0)
        agent = load_agent(self.conditions, self.data, name, recogniser_sha256=self.recogniser_sha256, seed=seed)
        agent.name = spec
        return agent

    def seeds(self, name: str) -> tuple[int, ...]:
        """Return with which seeds a learned planner was trained here."""
        from planners.agents.storage import agent_seeds  # brings torch

        return () if self._untrained else agent_seeds(self.conditions, self.data, name)

    def expanded(self, spec: str) -> tuple[str, ...]:
        """Return the trainings of a learned planner that is named without one, or at least the first."""
        name, seed = split_record_name(spec)
        return (spec,) if seed is not None else tuple(record_name(name, seed) for seed in self.seeds(name) or (0,))

    def reason_for_no_gain_model(self) -> str | None:
        """Return why there can be no gain model here, and what to do about it; None where there is one."""
        from planners.value.model import used_gain_model  # imported here: torch takes seconds

        if self.conditions.form != "causal":
            return f"{_CAUSAL_FIELDS}, and this is {self.form}"
        path = used_gain_model(self._folder, self.conditions)
        if self.conditions.recogniser is None and path.is_file():
            return None  # if it is another recogniser's, that is an error
        try:
            self.load_gain_model()
        except ModelError as error:
            return str(error)
        return None

    def reason_for_no_fixed_place(self) -> str | None:
        """Return why there can be no place for `fixed-best` here, and what to do about it; None where there is one."""
        path = fixed_place_path(self._folder, self.conditions)
        if self.conditions.form == "causal" and self.conditions.recogniser is None and path.is_file():
            return None  # if it is another recogniser's, that is an error
        try:
            self.load_fixed_place()
        except ModelError as error:
            return str(error)
        return None

    def reason_for_no_agent(self, name: str) -> str | None:
        """Return why a learned planner cannot run here, and what to do about it; None where it can."""
        seeds = self.seeds(name)
        if not seeds:
            return self._no_agent
        if self.conditions.recogniser is not None:  # beside which agents for another recogniser may lie
            try:
                self.load_agent(record_name(name, seeds[0]))
            except ModelError as error:
                return str(error)
        return None

    @property
    def _folder(self) -> Path:
        """The folder of weights; of those that ship, the one of the data."""
        return weights_folder(self.conditions, self.data)

    def _check_data(self, path: Path, trained: str | None, again: str) -> None:
        """Raise a ModelError if weights were trained on other data, such as another fold, and nothing else says so."""
        from recognition.weight_files import check_trained_for  # brings torch

        if trained is not None and not self.trained_elsewhere:
            check_trained_for(path, "data set, or fold of it", trained, self.data.sha256, again)

    @property
    def _untrained(self) -> bool:
        """Whether nothing can have been trained, as your own recogniser comes without a folder of weights."""
        return self.conditions.recogniser is not None and self.models is None

    @property
    def _no_gain_field(self) -> str:
        return f"no gain field was trained for this recogniser: expected that of {self._training('gain-field')}"

    @property
    def _no_agent(self) -> str:
        return f"no agent was trained for this recogniser: expected those of {self._training('agent')}"

    def _training(self, what: str) -> str:
        """Return the command that trains something here."""
        return f"`ehar train {what} {self.conditions.options} {self.conditions.models_option}`"


def listed(planners: str | Planner | Sequence[str | Planner] | None) -> Sequence[str | Planner] | None:
    """Return planners as a list; a single planner needs no list, and None means all of ours.

    Raises:
        UsageError: a name is unknown, or an object is not a planner; this check loads nothing.
    """
    if planners is None:
        return None
    several = planners if isinstance(planners, Sequence) and not isinstance(planners, str) else [planners]
    for planner in several:
        if isinstance(planner, str):
            check_spec(planner)
        else:
            check_planner_contract(planner, f"planner {planner!r}")
    return several


class Choice(NamedTuple):
    """The planners that run.

    Args:
        planners: the planners, with different names.
        origins: origins of planners that are not ours, by name.
        model: the gain model, if a planner or the readout needs it.
    """

    planners: list[Planner]
    origins: dict[str, Origin]
    model: "GainModel | None" = None

    @property
    def lengths(self) -> dict[str, int | None]:
        """The number of frames of an episode in the training of the gain field, of each agent and of a fixed place."""
        trained = {
            planner.name: getattr(planner, "length", None)
            for planner in self.planners
            if is_learned(planner.name) or needs_fixed_place(planner.name)
        }
        return trained if self.model is None else {"gain field": self.model.length, **trained}

    @property
    def localisations(self) -> dict[str, Localisation | None]:
        """The localisation in the training of the gain field, of each agent and of a fixed place; None in clips."""
        trained = {planner.name: getattr(planner, "localisation", None) for planner in self.planners}
        return trained if self.model is None else {"gain field": self.model.localisation, **trained}


def choose_planners(
    planners: Sequence[str | Planner] | None, place: ModelPlace, *, readout: str, note: Callable[[str], None]
) -> Choice:
    """Return the planners that run, and the gain model if one of them or the readout needs it.

    Args:
        planners: names and instances, which all have to run; None means all of ours that can.
        place: place of gain models and agents.
        readout: one of `READOUTS`.
        note: is told which planners are left out if `planners` is None.

    Raises:
        UsageError: a planner cannot be made, or two share a name.
        ModelError: a named planner or the readout needs a model that is missing, or that belongs to another recogniser.
        DataError: a planner is named both with and without a training seed.
    """
    load_model = cache(place.load_gain_model)
    if readout == "belief":
        load_model()
    specs = list(_those_that_can(place, note) if planners is None else planners)
    chosen = make_planners(specs, load_model, place)
    return chosen._replace(model=load_model() if load_model.cache_info().currsize else None)


def _those_that_can(place: ModelPlace, note: Callable[[str], None]) -> list[str]:
    """Return the names of our planners that can run here, and note why the others cannot."""
    missing: dict[str, list[str]] = {}  # what is missing, and the planners that need it
    can: list[str] = []
    for name in planner_names():
        reason = None
        if needs_gain_model(name):
            reason = place.reason_for_no_gain_model()
        elif needs_fixed_place(name):
            reason = place.reason_for_no_fixed_place()
        elif is_learned(name):
            reason = place.reason_for_no_agent(name)
        if reason is None:
            can.append(name)
        else:
            missing.setdefault(reason, []).append(name)
    for reason, names in missing.items():
        note(f"left out: {', '.join(names)}: {reason}")
    return can


def make_planners(
    specs: Sequence[str | Planner],
    load_model: "Callable[[], GainModel] | None" = None,
    place: ModelPlace | None = None,
) -> Choice:
    """Return planners, made from their names where needed; a learned planner gives each of its trainings in `place`.

    Raises:
        UsageError: one cannot be made, there are none, two share a name, or a name ends as those of runs of several
            trainings do.
        ModelError: an agent or a fixed place is missing, or belongs to another data set or recogniser.
        DataError: a planner is named both with and without a training seed.
    """
    if place is not None:
        specs = [one for spec in specs for one in (place.expanded(str(spec)) if _learned(spec) else (spec,))]
    load_agent, load_place = (None, None) if place is None else (place.load_agent, place.load_fixed_place)
    made = [resolve_planner(spec, load_model, load_agent, load_place) for spec in specs]
    names = [planner.name for planner, _ in made]
    twice = sorted({name for name in names if names.count(name) > 1})
    if not names or twice:
        raise UsageError(f"planners: expected each once, got {twice[0]!r} twice" if twice else "planners: got none")
    for name in filter(is_shared, names):
        raise UsageError(
            f"planner {name!r}: expected a name that does not end in {SHARED} and a number, which stand for a training "
            "of what all planners share"
        )
    group_planners(names)  # raises an error now if no summary could be made later
    origins = {planner.name: origin for planner, origin in made if origin is not None}
    return Choice([planner for planner, _ in made], origins)


def _learned(spec: str | Planner) -> bool:
    return isinstance(spec, str) and is_learned(spec)
