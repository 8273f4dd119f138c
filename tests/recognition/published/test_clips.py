"""Clips of the published protocol: centred, scaled, cut, and random only in training."""

import numpy as np
import pytest

from recognition.published.clips import FRAMES, published_clip

PARENTS = np.array([1, 1, 1])


def motion(frames: int = 20) -> np.ndarray:
    return np.random.default_rng(0).normal([3.0, 2.0, 1.0], [1.0, 2.0, 0.5], (frames, 1, 3, 3))


def test_a_test_clip_spans_the_cube_and_takes_frames_evenly() -> None:
    clip = published_clip(motion(), "joint", PARENTS)
    assert clip.shape == (FRAMES, 1, 3, 3) and clip.dtype == np.float32
    np.testing.assert_allclose(clip.min(axis=(0, 1, 2)), -1, atol=1e-6)
    np.testing.assert_allclose(clip.max(axis=(0, 1, 2)), 1, atol=1e-6)
    np.testing.assert_array_equal(clip, published_clip(motion() + 7.0, "joint", PARENTS))  # it does not matter where
    frames = np.linspace(0, 19, FRAMES).astype(int)
    assert (np.diff(frames) == 0).any()  # 20 frames make 52
    repeated = np.diff(frames) == 0
    assert not np.diff(clip, axis=0)[repeated].any() and np.diff(clip, axis=0)[~repeated].any(axis=(1, 2, 3)).all()


def test_bones_are_joints_minus_their_parents() -> None:
    joints, bones = (published_clip(motion(), stream, PARENTS) for stream in ("joint", "bone"))
    np.testing.assert_allclose(bones, joints - joints[:, :, [1]], atol=1e-6)
    assert not bones[:, :, 1].any()


def test_a_training_clip_is_turned_sized_and_cut_at_random_but_in_order() -> None:
    ordered = np.zeros((100, 1, 3, 3))
    ordered[:, 0, 0, 0] = np.arange(100)  # one joint walks to the right
    ordered[:, 0, 2, 2] = 1.0
    first, again, other = (published_clip(ordered, "joint", PARENTS, np.random.default_rng(seed)) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    assert (np.diff(first[:, 0, 0, 0]) >= 0).all()


def test_people_are_turned_and_tilted_but_never_lean_to_the_side() -> None:
    upright = np.random.default_rng(1).normal(size=(60, 1, 3, 3))
    upright[:, 0, 2] = upright[:, 0, 1] + [0.0, 0.0, 1.7]  # one joint straight above another
    for seed in range(5):
        clip = published_clip(upright, "joint", PARENTS, np.random.default_rng(seed))
        above = clip[:, 0, 2] - clip[:, 0, 1]
        np.testing.assert_allclose(above[:, 0], 0, atol=1e-6)
        assert np.abs(above[:, 1]).min() > 1e-3 and above[:, 2].min() > 0


@pytest.mark.parametrize("frames", [1, 2, 500])
def test_any_length_makes_a_clip(frames: int) -> None:
    for rng in (None, np.random.default_rng(0)):
        clip = published_clip(motion(frames), "bone", PARENTS, rng)
        assert clip.shape[0] == FRAMES and np.isfinite(clip).all()
