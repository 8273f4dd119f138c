"""Trained networks behind the recogniser contract: arrays in, calibrated probabilities out, frame by frame."""

import hashlib
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor
from torch.nn import Module

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.data.skeleton_tree import parents
from ehar.recogniser import Recognition
from ehar.sensors.sensor import Sensed
from recognition.calibration import Temperature
from recognition.freed_memory import keep_freed_memory
from recognition.networks.causal import CausalCTRGCN, StreamingState
from recognition.networks.ctrgcn import CTRGCN
from recognition.networks.features import features, with_view
from recognition.networks.spec import NetworkSpec
from recognition.networks.stepper import CausalStepper

FRAMES_AT_ONCE = 256  # frames that the published network takes in one call on a CPU: 2 MB fit into its cache


class _Recogniser:
    """The part that both forms share: features from arrays, and calibrated log-probabilities."""

    data_sha256: str | None = None  # hash of the data that it was trained on; None if its files do not say
    sensor_sha256: str | None = None  # hash of your own sensor in its training; None for a sensor of ehar
    in_the_way: bool = False  # whether things were in the way in its training, in a world that has none

    def __init__(self, network: Module, spec: NetworkSpec, temperature: Temperature, sha256: str, device: str) -> None:
        self.spec = spec
        self.class_names = spec.class_names
        self.temperature = temperature
        self.sha256 = sha256
        self.device = torch.device(device)
        self._parents = torch.from_numpy(parents(spec.skeleton)).to(self.device)
        self._camera = spec.world.camera
        self._weights = network.to(self.device).eval()

    def fingerprint(self) -> bytes:
        """Return a hash of all weights and of the temperature, as they are now."""
        digest = hashlib.blake2b(repr(self.temperature).encode())
        for tensor in self._weights.state_dict().values():
            digest.update(tensor.cpu().contiguous().numpy().tobytes())
        return digest.digest()

    def _features(self, sensed: Sensed, viewpoint: FloatArray) -> Tensor:
        """Return features (..., P, J, C) on the device."""
        to = self._to_device
        return features(to(sensed.joints_2d), to(sensed.confidence), to(viewpoint[..., 0]), self._parents, self._camera)

    def _to_device(self, array: FloatArray) -> Tensor:
        # A copy: torch warns of arrays that are read-only, as those are that a planner imagines with.
        return torch.from_numpy(np.array(array, dtype=np.float32, order="C")).to(self.device)

    def _recognition(self, logits: Tensor, embedding: Tensor, count: IntArray) -> Recognition:
        """Return calibrated arrays from logits (B, F, K) and embeddings (B, F, D) after `count` (B,) frames."""
        temperature = self._to_device(self.temperature.at(count / self.spec.length))
        log_probs = torch.log_softmax(logits / temperature[:, None, None], dim=-1)
        return Recognition(log_probs.cpu().numpy(), embedding.cpu().numpy())


@dataclass(frozen=True)
class StreamingRecogniserState:
    """The streaming network's state behind arrays; see `ehar.recogniser.RecogniserState`."""

    network: StreamingState

    def fork(self, forks: int) -> "StreamingRecogniserState":
        """Return a state with F alternatives of each episode; nothing is copied."""
        return StreamingRecogniserState(self.network.fork(forks))

    def select(self, choice: IntArray) -> "StreamingRecogniserState":
        """Return the unforked state of alternative `choice` (B,) of each episode."""
        return StreamingRecogniserState(self.network.select(torch.from_numpy(np.asarray(choice, dtype=np.int64))))

    def reset(self, mask: BoolArray) -> "StreamingRecogniserState":
        """Return a state in which the episodes of `mask` (B,) have seen nothing yet."""
        rows = torch.from_numpy(np.asarray(mask, dtype=bool))
        return StreamingRecogniserState(self.network.reset(rows))


class StreamingRecogniser(_Recogniser):
    """The causal network, which takes one frame at a time at the same cost.

    Args:
        network: the trained network.
        spec: the data and size that it was built for.
        temperature: the temperature, fitted on validation data.
        sha256: hash of weights and temperature, recorded beside results.
        device: a torch device.

    Attributes:
        memory: how long a frame counts for where evidence fades, the mean over features [s]; None where it does not.
    """

    def __init__(
        self, *, network: CausalCTRGCN, spec: NetworkSpec, temperature: Temperature, sha256: str, device: str = "cpu"
    ) -> None:
        """Put the network in evaluation mode on the device."""
        self._stepper = CausalStepper(network.eval())
        fading = network.fading
        self.memory = None if fading is None else float(fading.log_memory.detach().exp().mean()) / spec.fps
        super().__init__(self._stepper, spec, temperature, sha256, device)
        self.embedding_size = network.embedding_size

    def start(self, episodes: int) -> StreamingRecogniserState:
        """Return the state of B episodes that have seen nothing."""
        keep_freed_memory()  # here, as it counts for a process: a recogniser is made in one and runs in others
        with torch.inference_mode():
            return StreamingRecogniserState(self._stepper.start(episodes, self.spec.persons))

    def step(
        self, state: StreamingRecogniserState, sensed: Sensed, viewpoint: FloatArray
    ) -> tuple[Recognition, StreamingRecogniserState]:
        """See one more frame; shapes as in `ehar.recogniser.Recogniser.step`."""
        with torch.inference_mode():
            forked = viewpoint.ndim == 3
            seen = with_view(self._features(sensed, viewpoint), self._to_device(viewpoint))
            logits, embedding, after = self._stepper.step(seen if forked else seen[:, None], state.network)
            recognition = self._recognition(logits, embedding, after.count)
        if not forked:
            recognition = Recognition(*(array[:, 0] for array in recognition))
        return recognition, StreamingRecogniserState(after)


@dataclass(frozen=True)
class PrefixState:
    """All frames seen so far: the published network has no other memory."""

    frames: tuple[Tensor, ...]  # each (B, F', P, J, C); what is before `begin` is not read
    begin: IntArray  # (B,) the first frame of each episode
    forks: int = 1

    def fork(self, forks: int) -> "PrefixState":
        """Return a state with F alternatives of each episode; nothing is copied."""
        return replace(self, forks=forks)

    def select(self, choice: IntArray) -> "PrefixState":
        """Return the unforked state of alternative `choice` (B,) of each episode."""
        rows = torch.arange(len(choice))
        index = torch.from_numpy(np.asarray(choice, dtype=np.int64))
        frames = tuple(f if f.shape[1] == 1 else f[rows, index][:, None] for f in self.frames)
        return replace(self, frames=frames, forks=1)

    def reset(self, mask: BoolArray) -> "PrefixState":
        """Return a state in which the episodes of `mask` (B,) have seen nothing yet."""
        return replace(self, begin=np.where(mask, len(self.frames), self.begin))


class PrefixRecogniser(_Recogniser):
    """The published network, run on each prefix anew. It is the yardstick; its cost grows with the frame.

    Args:
        network: the trained network.
        spec: the data and size that it was built for.
        temperature: the temperature, fitted on validation data.
        sha256: hash of weights and temperature, recorded beside results.
        device: a torch device.
    """

    def __init__(
        self, *, network: CTRGCN, spec: NetworkSpec, temperature: Temperature, sha256: str, device: str = "cpu"
    ) -> None:
        """Put the network in evaluation mode on the device."""
        super().__init__(network, spec, temperature, sha256, device)
        self._network = network
        self.embedding_size = spec.widths[-1]

    def start(self, episodes: int) -> PrefixState:
        """Return the state of B episodes that have seen nothing."""
        return PrefixState((), np.zeros(episodes, dtype=np.int64))

    def step(self, state: PrefixState, sensed: Sensed, viewpoint: FloatArray) -> tuple[Recognition, PrefixState]:
        """See one more frame; shapes as in `ehar.recogniser.Recogniser.step`."""
        with torch.inference_mode():
            forked = viewpoint.ndim == 3
            seen = self._features(sensed, viewpoint)
            after = replace(state, frames=(*state.frames, seen if forked else seen[:, None]))
            prefix = torch.stack([frame.expand(-1, state.forks, -1, -1, -1) for frame in after.frames], dim=2)
            count = len(after.frames) - state.begin
            logits = prefix.new_empty(*prefix.shape[:2], len(self.class_names))
            embedding = prefix.new_empty(*prefix.shape[:2], self.embedding_size)
            for frames in np.unique(count):  # episodes that began together have prefixes of the same length
                rows = torch.from_numpy(np.flatnonzero(count == frames))
                embedded = self._embed(prefix[rows, :, -int(frames) :].flatten(0, 1))
                embedding[rows] = embedded.view(len(rows), state.forks, -1)
                logits[rows] = self._network.fc(embedded).view(len(rows), state.forks, -1)
            recognition = self._recognition(logits, embedding, count)
        if not forked:
            recognition = Recognition(*(array[:, 0] for array in recognition))
        return recognition, after

    def _embed(self, clips: Tensor) -> Tensor:
        """Return the embeddings (N, D) of clips (N, T, P, J, C), in pieces on a CPU: whole batches take longer."""
        x = clips.permute(0, 4, 1, 3, 2)
        if self.device.type != "cpu":
            # Unless told otherwise a GPU rounds to 10 bits what it convolves: probabilities would move by 5e-4.
            with torch.backends.cudnn.flags(enabled=True, allow_tf32=False):
                return self._network.embed(x)
        pieces = torch.split(x, max(1, FRAMES_AT_ONCE // clips.shape[1]))
        return torch.cat([self._network.embed(piece) for piece in pieces])
