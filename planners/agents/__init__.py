"""Learned agents: they imitate an oracle, or learn from reward."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from planners.agents.agent import Agent as Agent
    from planners.agents.config import AgentTrainingConfig as AgentTrainingConfig
    from planners.agents.network import AgentNetwork as AgentNetwork
    from planners.agents.training import train_agents as train_agents
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "Agent": "planners.agents.agent",
            "AgentNetwork": "planners.agents.network",
            "AgentTrainingConfig": "planners.agents.config",
            "train_agents": "planners.agents.training",
        },
    )
