"""Takes parts of a network's input away, for trials of what they are worth."""

import torch
from torch import Tensor

from recognition.networks.features import (
    BONE_CHANNELS,
    JOINT_CHANNELS,
    PARTNER_CHANNELS,
    VIEW_CHANNELS,
    channel_count,
)
from recognition.trials.changes import Change

_JOINTS, _JOINT_SURE = slice(0, JOINT_CHANNELS - 1), JOINT_CHANNELS - 1
_BONES = slice(JOINT_CHANNELS, JOINT_CHANNELS + BONE_CHANNELS - 1)
_BONE_SURE = JOINT_CHANNELS + BONE_CHANNELS - 1
_PARTNER = slice(JOINT_CHANNELS + BONE_CHANNELS, JOINT_CHANNELS + BONE_CHANNELS + PARTNER_CHANNELS)


def changed_input(seen: Tensor, change: Change) -> Tensor:
    """Return features (B, L, P, J, C) as a trial's network sees them: what it is not told is 0.

    Args:
        seen: (B, L, P, J, C), with the view's behind those of the joints.
        change: the trial.
    """
    persons, channels = seen.shape[2], seen.shape[4]
    if channels != channel_count(persons, view=True):
        raise ValueError(f"expected {channel_count(persons, view=True)} features of a joint, got {channels}")
    seen = seen.clone()
    if not change.view:
        seen[..., -VIEW_CHANNELS:] = 0
    if change.stream == "joint":
        seen[..., JOINT_CHANNELS : JOINT_CHANNELS + BONE_CHANNELS] = 0
    elif change.stream == "bone":
        seen[..., :JOINT_CHANNELS] = 0
    elif change.stream == "motion":
        seen[..., _JOINTS] = _way(seen[..., _JOINTS], seen[..., _JOINT_SURE])
        seen[..., _BONES] = _way(seen[..., _BONES], seen[..., _BONE_SURE])
        if persons > 1:
            seen[..., _PARTNER] = _way(seen[..., _PARTNER], seen[..., _JOINT_SURE])
    return seen


def _way(places: Tensor, sure: Tensor) -> Tensor:
    """Return the way (B, L, P, J, c) from frame to frame; 0 where a joint is missing in either, and at first."""
    both = (sure[:, 1:] > 0) & (sure[:, :-1] > 0)
    moved = (places[:, 1:] - places[:, :-1]) * both[..., None]
    return torch.cat([torch.zeros_like(places[:, :1]), moved], dim=1)
