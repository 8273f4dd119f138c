import numpy as np
import pytest

from ehar.datasets.source import load_data
from ehar.scenario import split_parts, windows
from planners.perturbed_people import perturbed_windows

DATA = load_data("duo")
POLICY = split_parts(DATA).policy
SEQUENCES = np.random.default_rng(0).choice(POLICY[DATA.lengths[POLICY] >= 60], 30)


def bone_lengths(positions):
    start, end = DATA.skeleton.bone_indices.T
    return np.linalg.norm(positions[..., start, :] - positions[..., end, :], axis=-1)


def perturb(**spreads):
    return perturbed_windows(np.random.default_rng(1), DATA, SEQUENCES, 60, **spreads)


def test_nobody_is_perturbed_by_nothing():
    positions = perturb(limbs=0.0, tempo=0.0, posture=0.0)
    assert positions.shape == (30, 60, 2, 16, 3)
    assert positions.dtype == np.float32
    scenarios = windows(DATA, SEQUENCES[:1], 60, 1)
    every = scenarios.positions(np.arange(len(scenarios)))
    # Between two neighbouring windows of the sequence, a fraction of a frame apart.
    assert np.abs(every - positions[0]).max(axis=(1, 2, 3, 4)).min() < 0.05
    np.testing.assert_allclose(positions.mean(axis=(1, 2, 3)), 0.0, atol=1e-5)


def test_another_posture_keeps_every_bone():
    plain, posed = perturb(limbs=0.0, tempo=0.0, posture=0.0), perturb(limbs=0.0, tempo=0.0, posture=1.0)
    np.testing.assert_allclose(bone_lengths(posed).mean(axis=1), bone_lengths(plain).mean(axis=1), atol=5e-3)
    assert np.abs(posed - plain).mean() > 0.02


def test_limbs_are_scaled_alike_on_both_sides_for_the_whole_window():
    lengths = bone_lengths(perturb(limbs=0.15, tempo=0.0, posture=0.0))
    ratio = lengths / bone_lengths(perturb(limbs=0.0, tempo=0.0, posture=0.0))
    np.testing.assert_allclose(ratio, np.broadcast_to(ratio[:, :1], ratio.shape), rtol=1e-3)
    assert ratio.max() < 1.15 + 1e-3
    assert ratio.min() > 1 / 1.15 - 1e-3
    assert ratio.std() > 0.05
    bones = [tuple(sorted(bone)) for bone in DATA.skeleton.bones]
    mirrored = [tuple(sorted(DATA.skeleton.mirror[list(bone)])) for bone in bones]
    partner = [bones.index(bone) for bone in mirrored]
    np.testing.assert_allclose(ratio, ratio[..., partner], rtol=1e-3)


@pytest.mark.parametrize("length", [60, 110])
def test_a_tempo_never_needs_more_frames_than_there_are(length):
    enough = POLICY[DATA.lengths[POLICY] >= length]
    positions = perturbed_windows(np.random.default_rng(2), DATA, enough, length, tempo=3.0)
    assert np.isfinite(positions).all()
    step = np.linalg.norm(np.diff(positions, axis=1), axis=-1).mean()
    assert step > 0


def test_the_same_draws_give_the_same_people():
    np.testing.assert_array_equal(perturb(), perturb())
