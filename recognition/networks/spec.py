"""The choice of a network: causal or published form; small, half or published size."""

from dataclasses import dataclass
from typing import Annotated

import torch
from annotated_types import Ge

from ehar.conditions import Form
from ehar.data.recordings import Recordings
from ehar.data.skeleton import Skeleton
from ehar.data.streams.data import StreamData
from ehar.errors import UsageError
from ehar.world import PAPER, World
from recognition.networks.causal import CausalCTRGCN
from recognition.networks.ctrgcn import CTRGCN
from recognition.networks.features import channel_count
from recognition.networks.graph import partition
from recognition.networks.sizes import STRIDES, WIDTHS, Size

Network = CausalCTRGCN | CTRGCN

DROPOUT = 0.3


@dataclass(frozen=True)
class NetworkSpec:
    """The data that a network is built for, and its size; saved beside its weights, and compared with other data.

    Args:
        form: "causal" streams; "ctrgcn" is the published network, evaluated on each prefix.
        size: "published" widths, "half" of them, or "small": four blocks for 2 CPU cores.
        class_names: names of the K classes.
        skeleton: skeleton of one person.
        persons: number P of persons.
        fps: frame rate of the training motion.
        length: number L of frames of a training clip.
        world: the world of the training.
        fading: whether evidence fades, as it does for streams; their last class is no activity.
    """

    form: Form
    size: Size
    class_names: tuple[str, ...]
    skeleton: Skeleton
    persons: int
    fps: float
    length: Annotated[int, Ge(1)]
    world: World = PAPER
    fading: bool = False

    @classmethod
    def of(cls, data: Recordings, *, form: Form, size: Size, length: int, world: World = PAPER) -> "NetworkSpec":
        """Return the spec that fits some data.

        Raises:
            UsageError: the data are streams, and the form is the published one.
        """
        fading = isinstance(data, StreamData)
        if fading and form != "causal":
            raise UsageError(f"form: expected causal for {data.name}, which holds streams, got {form}")
        return cls(form, size, data.recognised_names, data.skeleton, data.persons, data.fps, length, world, fading)

    @property
    def widths(self) -> tuple[int, ...]:
        """Output channels of each block."""
        return WIDTHS[self.size]

    def build(self, seed: int = 0) -> Network:
        """Return a freshly initialised network; torch's global generator is left as it was."""
        return build_network(
            self.form,
            self.size,
            classes=len(self.class_names),
            channels=channel_count(self.persons, view=self.form == "causal"),
            skeleton=self.skeleton,
            persons=self.persons,
            dropout=DROPOUT,
            seed=seed,
            fading=self.fading,
        )


def build_network(
    form: Form,
    size: Size,
    *,
    classes: int,
    channels: int,
    skeleton: Skeleton,
    persons: int,
    dropout: float,
    seed: int,
    fading: bool = False,
) -> Network:
    """Return a freshly initialised network; torch's global generator is left as it was.

    Args:
        form: causal or published.
        size: widths of the network.
        classes: number K of classes.
        channels: number C of features of a joint.
        skeleton: skeleton of one person.
        persons: number P of persons.
        dropout: rate of dropout in the causal form; the published one has none.
        seed: decides the first weights.
        fading: whether evidence fades in the causal form.
    """
    topology = partition(skeleton)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        if form == "causal":
            return CausalCTRGCN(
                classes=classes,
                channels=channels,
                partition=torch.from_numpy(topology),
                widths=WIDTHS[size],
                dropout=dropout,
                fading=fading,
            )
        return CTRGCN(
            classes=classes,
            joints=len(skeleton.joint_names),
            persons=persons,
            in_channels=channels,
            adjacency=topology,
            widths=WIDTHS[size],
            strides=STRIDES[size],
            generator=torch.Generator().manual_seed(seed),
        )
