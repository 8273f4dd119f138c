"""The value of a view: the belief, the place of people, and the gain field over views."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from planners.value.belief.clips import Belief as Belief
    from planners.value.belief.clips import BeliefModel as BeliefModel
    from planners.value.belief.filters import OneStreamBelief as OneStreamBelief
    from planners.value.belief.filters import StreamBelief as StreamBelief
    from planners.value.belief.streams import StreamBeliefModel as StreamBeliefModel
    from planners.value.body_filter import BodyFilter as BodyFilter
    from planners.value.config import GainTrainingConfig as GainTrainingConfig
    from planners.value.field import GainField as GainField
    from planners.value.model import GainModel as GainModel
    from planners.value.situation import Situation as Situation
    from planners.value.view_value import ViewValue as ViewValue
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "Belief": "planners.value.belief.clips",
            "BeliefModel": "planners.value.belief.clips",
            "BodyFilter": "planners.value.body_filter",
            "OneStreamBelief": "planners.value.belief.filters",
            "StreamBelief": "planners.value.belief.filters",
            "StreamBeliefModel": "planners.value.belief.streams",
            "Situation": "planners.value.situation",
            "GainField": "planners.value.field",
            "GainModel": "planners.value.model",
            "ViewValue": "planners.value.view_value",
            "GainTrainingConfig": "planners.value.config",
        },
    )
