"""The agent's network (Fig. 4): encoders f^A, f^V and f^P, the state encoder f^S over them, an actor and a critic."""

from collections.abc import Mapping
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from ehar.errors import ModelError
from ehar.viewpoint import MOVES
from planners.agents.inputs import ENCODED, LEFT_OUT, RECOGNITION, InputSizes, recognition_parts

WIDTH = 96  # a guess: width of each encoder, which the paper leaves to a supplement that is not public
STATE = 128  # a guess: S, the size of the state s_t
CRITIC = 64  # a guess: width of the critic's one hidden layer


@dataclass(frozen=True)
class AgentSpec:
    """The inputs that a network is built for.

    Args:
        sizes: sizes of the inputs.
        without: what is left out (Table 3): encoders, or parts of what f^A takes.
        hindsight: number of extra inputs of the critic in training; they play no part in acting.
        streams: whether the agent watches streams, where f^A takes no time.

    Raises:
        ModelError: a size is not positive, hindsight is negative, something left out is unknown, or nothing is left.
    """

    sizes: InputSizes
    without: tuple[str, ...] = ()
    hindsight: int = 0
    streams: bool = False

    def __post_init__(self) -> None:
        """Check sizes and encoders."""
        if min(vars(self.sizes).values()) < 1 or self.hindsight < 0:
            raise ModelError(f"agent: expected sizes of at least 1, got {self.sizes}, hindsight {self.hindsight}")
        if not set(self.without) <= set(LEFT_OUT) or not self.encoded or set(LEFT_OUT) - {*ENCODED} <= {*self.without}:
            raise ModelError(f"agent: without: expected some of {', '.join(LEFT_OUT)} but not all, got {self.without}")

    @property
    def encoded(self) -> tuple[str, ...]:
        """The inputs that the network takes."""
        return tuple(name for name in ENCODED if name not in self.without)

    def columns(self, classes: int) -> tuple[slice, ...]:
        """Return the columns of f^A's inputs that it takes, for K classes, in streams with no activity.

        Raises:
            ModelError: a part is left out of inputs that are too few for K classes.
        """
        size = self.sizes.recognition
        parts = recognition_parts(size, classes, streams=self.streams)
        if not set(self.without) & set(parts):
            return (slice(0, size),)
        if not 1 <= classes <= size - 2:
            raise ModelError(f"agent: without {self.without}: expected 1 to {size - 2} classes, got {classes}")
        return tuple(part for name, part in parts.items() if name not in self.without)


class AgentNetwork(nn.Module):
    """A policy over the 7 moves, and a value, from the inputs of `AgentInputs`.

    Args:
        spec: the inputs that it is built for.
        classes: K; needed only if a part of f^A's inputs is left out.
        seed: seed of the initial weights.
    """

    def __init__(self, spec: AgentSpec, *, classes: int = 0, seed: int = 0) -> None:
        """Create the network; its first policy is nearly uniform."""
        super().__init__()
        self.spec = spec
        self._columns = spec.columns(classes)
        sizes = vars(spec.sizes) | {RECOGNITION: sum(part.stop - part.start for part in self._columns)}
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.encoders = nn.ModuleDict({name: _encoder(sizes[name], name == RECOGNITION) for name in spec.encoded})
            self.state_encoder = nn.Sequential(nn.Linear(WIDTH * len(spec.encoded), STATE), nn.ReLU())
            self.actor = nn.Linear(STATE, len(MOVES))
            self.critic = nn.Sequential(nn.Linear(STATE + spec.hindsight, CRITIC), nn.ReLU(), nn.Linear(CRITIC, 1))
            with torch.no_grad():
                self.actor.weight.mul_(0.01)
                self.actor.bias.zero_()

    def state(self, inputs: Mapping[str, Tensor]) -> Tensor:
        """Return s_t (B, S) for inputs (B, size)."""
        encoded = [self.encoders[name](self._taken(name, inputs[name])) for name in self.spec.encoded]
        state: Tensor = self.state_encoder(torch.cat(encoded, dim=1))
        return state

    def _taken(self, name: str, values: Tensor) -> Tensor:
        """Return the inputs of an encoder without the parts that are left out."""
        return torch.cat([values[:, part] for part in self._columns], dim=1) if name == RECOGNITION else values

    def logits(self, state: Tensor) -> Tensor:
        """Return the unnormalised log-probabilities (B, 7) of the moves."""
        logits: Tensor = self.actor(state)
        return logits

    def value(self, state: Tensor, hindsight: Tensor | None = None) -> Tensor:
        """Return the value (B,) of states (B, S), with hindsight (B, hindsight) if the spec has it."""
        seen = state if hindsight is None else torch.cat([state, hindsight], dim=1)
        value: Tensor = self.critic(seen)[:, 0]
        return value


def _encoder(inputs: int, normalised: bool) -> nn.Sequential:
    """Return an encoder to `WIDTH` numbers; embeddings, whose scale differs between recognisers, are normalised."""
    layers: list[nn.Module] = [nn.LayerNorm(inputs)] if normalised else []
    return nn.Sequential(*layers, nn.Linear(inputs, WIDTH), nn.ReLU(), nn.Linear(WIDTH, WIDTH), nn.ReLU())
