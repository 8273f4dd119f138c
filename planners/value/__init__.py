"""The value of a view: the belief, the place of people, and the gain field over views."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from planners.value.belief import Belief as Belief
    from planners.value.belief import BeliefModel as BeliefModel
    from planners.value.body_filter import BodyFilter as BodyFilter
    from planners.value.config import GainTrainingConfig as GainTrainingConfig
    from planners.value.field import GainField as GainField
    from planners.value.model import GainModel as GainModel
    from planners.value.situation import Situation as Situation
    from planners.value.stream_belief import OneStreamBelief as OneStreamBelief
    from planners.value.stream_belief import StreamBelief as StreamBelief
    from planners.value.stream_belief import StreamBeliefModel as StreamBeliefModel
    from planners.value.view_value import ViewValue as ViewValue
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "Belief": "planners.value.belief",
            "BeliefModel": "planners.value.belief",
            "BodyFilter": "planners.value.body_filter",
            "OneStreamBelief": "planners.value.stream_belief",
            "StreamBelief": "planners.value.stream_belief",
            "StreamBeliefModel": "planners.value.stream_belief",
            "Situation": "planners.value.situation",
            "GainField": "planners.value.field",
            "GainModel": "planners.value.model",
            "ViewValue": "planners.value.view_value",
            "GainTrainingConfig": "planners.value.config",
        },
    )
