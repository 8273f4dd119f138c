"""Counts the floating-point operations of a computation."""

from collections.abc import Callable

from torch.utils.flop_counter import FlopCounterMode


def count_flops(function: Callable[[], object]) -> int:
    """Run the function once and return the floating-point operations of its convolutions and matrix products.

    A multiplication and an addition are two operations. Element-wise operations, normalisation and pooling are not
    counted. (torch cannot count a module that is handed a bare parameter as an argument while gradients are off.)
    """
    with FlopCounterMode(display=False) as counter:
        function()
    return int(counter.get_total_flops())
