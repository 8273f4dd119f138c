"""Which planners run: those that are named, or all that can; and the gain model that some of them need."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ehar.errors import ModelError, UsageError
from ehar.motion_data import MotionData
from ehar.planner import Planner
from planners.registry import check_spec, make_planner, needs_gain_model, planner_names

if TYPE_CHECKING:
    from planners.gain_model import GainModel

READOUTS = ("recogniser", "belief")


@dataclass(frozen=True, eq=False)
class GainModelPlace:
    """Where a gain model lies, and what it has to fit.

    Args:
        models: folder of weights; None takes those that ship with ehar.
        data: what planners are compared on.
        sensor: that they see through.
        views: the recogniser's.
        form: the recogniser's.
        recogniser_sha256: that the model was trained for.
    """

    models: Path | None
    data: MotionData
    sensor: str
    views: str
    form: str
    recogniser_sha256: str

    def load(self) -> "GainModel":
        """Return the model.

        Raises:
            ModelError: there is none, or it belongs to another recogniser.
        """
        from planners.gain_model import load_gain_model  # brings torch

        return load_gain_model(
            self.models,
            self.data,
            sensor=self.sensor,
            views=self.views,
            recogniser_sha256=self.recogniser_sha256,
        )

    def reason_for_none(self) -> str | None:
        """Return why there can be no model here, and what to do about it; None where there is one."""
        from planners.gain_model import SHIPPED, gain_model_path

        if self.form != "causal":
            return f"gain fields are trained for the causal recogniser, and this is {self.form}"
        path = gain_model_path(self.models or SHIPPED / self.data.name, sensor=self.sensor, views=self.views)
        if path.is_file():
            return None
        try:
            self.load()
        except ModelError as error:
            return str(error)
        return None


def check_planners(planners: Sequence[str | Planner] | None) -> None:
    """Raise a UsageError if a name is unknown or an instance is no planner; nothing is loaded for that."""
    for planner in planners or ():
        if isinstance(planner, str):
            check_spec(planner)
            continue
        missing = [name for name in ("name", "privileged", "reset", "act") if not hasattr(planner, name)]
        if missing:
            raise UsageError(
                f"planners: expected names or instances of ehar.planner.Planner, "
                f"got {planner!r} without {', '.join(missing)}"
            )


def choose_planners(
    planners: Sequence[str | Planner] | None, place: GainModelPlace, *, readout: str, note: Callable[[str], None]
) -> tuple[list[Planner], "GainModel | None"]:
    """Return the planners that run and, where one of them or the readout needs it, the gain model.

    Args:
        planners: names and instances, all of which have to run; None is all of ours that can.
        place: of the gain model.
        readout: one of `READOUTS`.
        note: told who is left out where `planners` is None.

    Raises:
        UsageError: a planner cannot be made, or two share a name.
        ModelError: a planner that was named, or the readout, needs a gain model and there is none; or there is
            one that belongs to another recogniser.
    """
    specs = list(planner_names() if planners is None else planners)
    valuing = [spec for spec in specs if isinstance(spec, str) and needs_gain_model(spec)]
    if planners is None and readout != "belief":
        reason = place.reason_for_none()
        if reason is not None:
            note(f"left out: {', '.join(valuing)}, which need a gain field: {reason}")
            specs, valuing = [spec for spec in specs if spec not in valuing], []
    model = place.load() if valuing or readout == "belief" else None
    return make_planners(specs, model), model


def make_planners(specs: Sequence[str | Planner], model: "GainModel | None" = None) -> list[Planner]:
    """Return planners, made where they were named.

    Raises:
        UsageError: one cannot be made, there are none, or two share a name.
    """
    load_model = None if model is None else lambda: model
    chosen = [make_planner(spec, load_model) if isinstance(spec, str) else spec for spec in specs]
    names = [planner.name for planner in chosen]
    twice = sorted({name for name in names if names.count(name) > 1})
    if not names or twice:
        raise UsageError(f"planners: expected each once, got {twice[0]!r} twice" if twice else "planners: got none")
    return chosen
