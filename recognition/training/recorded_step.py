"""A step of training that a GPU plays back: its kernels are recorded once, and from then on started together."""

import gc
from collections.abc import Callable

import torch
from torch import Tensor

FIRST_STEPS = 3  # that run as they are, as PyTorch asks for before a CUDA graph is recorded


class RecordedStep:
    """A step of one training on a stream of its own.

    A step on 16 clips starts thousands of small kernels, and to start them one by one takes longer than to run them. So
    the first steps run as they are, then one is recorded as a CUDA graph, and each later one is a single call. Nothing
    waits for its result, so the kernels of several trainings fill a GPU side by side.

    Args:
        step: takes tensors on the device, makes the step and returns its loss, a tensor without axes. It must not ask
            for a number.
        inputs: tensors of the shapes that all steps have.
        device: the GPU.
    """

    def __init__(self, step: Callable[..., Tensor], inputs: tuple[Tensor, ...], device: torch.device) -> None:
        """Record nothing yet."""
        self._step, self._device = step, device
        self._stream = torch.cuda.Stream(device)  # type: ignore[no-untyped-call]
        self._inputs = tuple(tensor.to(device, copy=True) for tensor in inputs)
        self._total = torch.zeros((), device=device)
        self._count = self._done = 0
        self._graph: torch.cuda.CUDAGraph | None = None
        self._loss = self._total

    def make(self, *inputs: Tensor) -> None:
        """Make a step on tensors of the device; it may run later."""
        self._count += 1
        self._done += 1
        # Until the inputs are there, and what changed the weights in between is done.
        self._stream.wait_stream(torch.cuda.current_stream(self._device))
        with torch.cuda.stream(self._stream):
            for held, given in zip(self._inputs, inputs, strict=True):
                held.copy_(given)
            if self._done <= FIRST_STEPS:
                self._total += self._step(*self._inputs)
                return
            if self._graph is None:
                gc.collect()  # now, as a graph that is deleted while another is recorded spoils it
                self._graph = torch.cuda.CUDAGraph()
                with torch.cuda.graph(self._graph, stream=self._stream):
                    self._loss = self._step(*self._inputs)
            self._graph.replay()
            self._total += self._loss

    def record_anew(self) -> None:
        """Forget what was recorded: a number that the step reads from Python, such as a learning rate, has changed."""
        self._graph = None

    def mean_loss(self) -> float:
        """Return the mean loss of the steps since the last call, once all of them are done."""
        self._stream.synchronize()
        mean = float(self._total) / max(1, self._count)
        self._total.zero_()
        torch.cuda.current_stream(self._device).synchronize()
        self._count = 0
        return mean
