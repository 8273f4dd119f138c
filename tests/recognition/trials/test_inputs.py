"""What trials take away from a network's input."""

import numpy as np
import pytest
import torch

from recognition.networks.features import channel_count
from recognition.training.clips import Clips
from recognition.trials.changes import Change
from recognition.trials.inputs import changed_input, channels_of


def seen(persons: int = 1) -> torch.Tensor:
    generator = torch.Generator().manual_seed(0)
    return torch.rand((2, 5, persons, 4, channel_count(persons, view=True)), generator=generator) + 0.5


def changed(features: torch.Tensor, change: Change, viewpoints: np.ndarray | None = None) -> torch.Tensor:
    clips, frames = features.shape[:2]
    still = np.tile([8.0, 1.0, 1.2], (clips, frames, 1)) if viewpoints is None else viewpoints
    return changed_input(Clips(features, torch.zeros(clips), np.arange(clips), still), change)


def test_the_usual_input_is_as_it_was_and_is_not_written_to() -> None:
    before = seen()
    kept = before.clone()
    assert torch.equal(changed(before, Change()), kept)
    changed(before, Change(view=False, stream="bone"))
    assert torch.equal(before, kept)


def test_the_view_is_the_last_two_features() -> None:
    without = changed(seen(), Change(view=False))
    assert (without[..., -2:] == 0).all()
    assert torch.equal(without[..., :-2], seen()[..., :-2])


@pytest.mark.parametrize(("stream", "gone"), [("joint", [5, 6, 7]), ("bone", [0, 1, 2, 3, 4])])
def test_one_stream_is_left(stream: str, gone: list[int]) -> None:
    left = changed(seen(persons=2), Change(stream=stream))  # type: ignore[arg-type]
    kept = [channel for channel in range(12) if channel not in gone]
    assert (left[..., gone] == 0).all()
    assert torch.equal(left[..., kept], seen(persons=2)[..., kept])


def test_motion_is_the_way_between_frames_that_both_show_the_joint() -> None:
    features = seen(persons=2)
    features[0, 2, 0, 1, 4] = 0.0  # joint 1 is missing in frame 2
    moved = changed(features, Change(stream="motion"))
    ways = [0, 1, 2, 3, 8, 9]
    expected = features[:, 1:, :, :, ways] - features[:, :-1, :, :, ways]
    expected[0, 1:3, 0, 1] = 0
    torch.testing.assert_close(moved[:, 1:, :, :, ways], expected)
    torch.testing.assert_close(moved[:, 1:, ..., 5:7], features[:, 1:, ..., 5:7] - features[:, :-1, ..., 5:7])
    assert (moved[:, 0, ..., [*ways, 5, 6]] == 0).all()
    for same in (4, 7, 10, 11):  # how sure, and the view
        assert torch.equal(moved[..., same], features[..., same])


def test_other_features_are_refused() -> None:
    with pytest.raises(ValueError, match="expected 10 features of a joint, got 8"):
        changed(torch.zeros((1, 2, 1, 3, 8)), Change())


def test_the_camera_tells_how_it_turns_around_people() -> None:
    """It passes the azimuth 0, and rises; what it will do is not told before it does it."""
    azimuth = np.array([6.2, 6.25, 0.1, 0.1, 0.3])
    viewpoints = np.stack([np.full(5, 8.0), azimuth, np.array([1.0, 1.0, 0.9, 0.9, 0.9])], axis=1)[None].repeat(
        2, axis=0
    )
    told = changed(seen(persons=2), Change(turning=True), viewpoints)
    assert told.shape[-1] == channels_of(2, Change(turning=True)) == 14
    assert torch.equal(told[..., :12], seen(persons=2))
    turns = torch.tensor([[0, 0], [0.05, 0], [0.1 - 6.25 + 2 * np.pi, -0.1], [0, 0], [0.2, 0]])
    torch.testing.assert_close(told[..., 12:], turns[:, None, None].expand(2, 5, 2, 4, 2).to(torch.float32))
    still = changed(seen(), Change(turning=True))
    assert (still[..., -2:] == 0).all()
