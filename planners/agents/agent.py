"""The learned agent as a planner: one frame in, one of the 7 moves out."""

import numpy as np
import torch

from ehar.arrays import FloatArray, IntArray
from ehar.errors import UsageError
from ehar.localisation import Localisation
from ehar.planner import Context, Observation, Planner
from planners.agents.inputs import AgentInputs, Inputs, seen_by_agent
from planners.agents.network import AgentNetwork
from planners.heading import move_target


class Agent(Planner):
    """The paper's agent (Sec. 4): the most probable move of a learned policy.

    On every track, the agent heads in the direction of a grid move. A vehicle does not make such a move within a
    frame, so its target is a second away.

    Args:
        name: name of the agent: il, ppo, il-ppo, ...
        network: the trained network.
        sha256: hash of its files, recorded beside results.
        length: number of frames of the clips that it was trained on; None in streams, or if that is not recorded.
        localisation: the localisation that it was trained with; None in clips, which have none.
    """

    privileged = False

    def __init__(
        self,
        *,
        name: str,
        network: AgentNetwork,
        sha256: str = "",
        length: int | None = None,
        localisation: Localisation | None = None,
    ) -> None:
        """Put the network in evaluation mode."""
        self.name = name
        self.network = network.eval()
        self.sha256 = sha256
        self.length = length
        self.localisation = localisation

    def reset(self, context: Context) -> None:
        """Forget what was seen.

        Raises:
            UsageError: the agent is for clips and these are streams, or the other way round.
        """
        if self.network.spec.streams != (context.length is None):
            kinds = ("clips", "streams") if context.length is None else ("streams", "clips")
            raise UsageError(f"planner {self.name!r}: got an agent of {kinds[0]}, expected one of {kinds[1]}")
        self._context = context
        self._inputs = AgentInputs.of(context)
        self.state: FloatArray = np.empty((context.episodes, 0), dtype=np.float32)  # s_t, (B, S)

    def act(self, observation: Observation) -> FloatArray:
        """Return the targets (B, 3) of the most probable moves."""
        sizes = self.network.spec.sizes
        shown = seen_by_agent(observation, self._context, flown=sizes.flown, distances=sizes.distances)
        inputs = self._inputs.see(shown)
        moves, self.state = decide(self.network, inputs)
        return move_target(self._context, observation.viewpoint, moves)


def decide(network: AgentNetwork, inputs: Inputs) -> tuple[IntArray, FloatArray]:
    """Return the most probable moves (B,) and the states (B, S) for inputs (B, size)."""
    with torch.inference_mode():
        state = network.state({name: torch.from_numpy(values) for name, values in inputs.items()})
        moves = network.logits(state).argmax(dim=1)
    return moves.numpy(), state.numpy()
