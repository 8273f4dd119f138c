"""The sizes of a network; there is no torch in this module, so the command line can show them at once."""

from typing import Literal

Size = Literal["small", "half", "published"]

SMALL_WIDTHS = (32, 32, 48, 64)
PUBLISHED_WIDTHS = (64, 64, 64, 64, 128, 128, 128, 256, 256, 256)  # Sec. 3.4 of CTR-GCN: ten blocks
PUBLISHED_STRIDES = (1, 1, 1, 1, 2, 1, 1, 2, 1, 1)  # Sec. 3.4: time is halved at the 5th and the 8th block
HALF_WIDTHS = tuple(width // 2 for width in PUBLISHED_WIDTHS)  # for CPUs: a quarter of the multiplications
WIDTHS: dict[Size, tuple[int, ...]] = {"small": SMALL_WIDTHS, "half": HALF_WIDTHS, "published": PUBLISHED_WIDTHS}
STRIDES: dict[Size, tuple[int, ...]] = {  # of the published form; the causal form has none
    "small": (1,) * len(SMALL_WIDTHS),
    "half": PUBLISHED_STRIDES,
    "published": PUBLISHED_STRIDES,
}
