"""What a trial's network sees: parts of its input are taken away, or the camera's turning is added."""

import numpy as np
import torch
from torch import Tensor

from ehar.arrays import FloatArray
from ehar.viewpoint import AZIMUTH, POLAR, wrap_difference
from recognition.networks.features import (
    BONE_CHANNELS,
    JOINT_CHANNELS,
    PARTNER_CHANNELS,
    VIEW_CHANNELS,
    channel_count,
)
from recognition.training.clips import Clips
from recognition.trials.changes import Change

TURN_CHANNELS = 2  # the changes of the camera's azimuth and polar angle
_JOINTS, _JOINT_SURE = slice(0, JOINT_CHANNELS - 1), JOINT_CHANNELS - 1
_BONES = slice(JOINT_CHANNELS, JOINT_CHANNELS + BONE_CHANNELS - 1)
_BONE_SURE = JOINT_CHANNELS + BONE_CHANNELS - 1
_PARTNER = slice(JOINT_CHANNELS + BONE_CHANNELS, JOINT_CHANNELS + BONE_CHANNELS + PARTNER_CHANNELS)


def channels_of(persons: int, change: Change) -> int:
    """Return the number C of features that a trial's network sees of a joint."""
    return channel_count(persons, view=True) + (TURN_CHANNELS if change.turning else 0)


def changed_input(clips: Clips, change: Change) -> Tensor:
    """Return features (B, L, P, J, C) as a trial's network sees them: what it is not told is 0.

    Args:
        clips: clips with the view's features behind those of joints.
        change: the trial.
    """
    seen = clips.features
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
    if change.turning:
        turns = torch.from_numpy(_turns(clips.viewpoints))[:, :, None, None]
        seen = torch.cat([seen, turns.expand(*seen.shape[:-1], TURN_CHANNELS)], dim=-1)
    return seen


def _turns(viewpoints: FloatArray) -> FloatArray:
    """Return how cameras at viewpoints (B, L, 3) turn around people from frame to frame, (B, L, 2) float32; 0 at first.

    That is the change of the azimuth and of the polar angle [rad]: as far as people seem to turn the other way.
    """
    turned = np.zeros((*viewpoints.shape[:2], TURN_CHANNELS), dtype=np.float32)
    turned[:, 1:, 0] = wrap_difference(np.diff(viewpoints[..., AZIMUTH], axis=1))
    turned[:, 1:, 1] = np.diff(viewpoints[..., POLAR], axis=1)
    return turned


def _way(places: Tensor, sure: Tensor) -> Tensor:
    """Return the way (B, L, P, J, c) from frame to frame; 0 where a joint is missing in either, and at first."""
    both = (sure[:, 1:] > 0) & (sure[:, :-1] > 0)
    moved = (places[:, 1:] - places[:, :-1]) * both[..., None]
    return torch.cat([torch.zeros_like(places[:, :1]), moved], dim=1)
