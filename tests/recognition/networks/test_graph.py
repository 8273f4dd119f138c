import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from safetensors import safe_open

from ehar.data.skeleton import Skeleton
from ehar.data.skeleton_tree import parents
from recognition.networks.graph import partition
from tests.helpers.places import SHARED

REFERENCE = SHARED / "ctrgcn_reference.safetensors"
NTU_PARENT = (2, 21, 21, 3, 21, 5, 6, 7, 21, 9, 10, 11, 1, 13, 14, 15, 1, 17, 18, 19, 21, 23, 8, 25, 12)
NTU_CENTRE = 20


def named(joints, bones):
    return Skeleton(tuple(f"joint{i}" for i in range(joints)), tuple(bones))


def ntu():
    return named(25, [(i, parent - 1) for i, parent in enumerate(NTU_PARENT) if i != NTU_CENTRE])


@st.composite
def trees(draw):
    """A random tree whose bones point in arbitrary directions."""
    joints = draw(st.integers(1, 12))
    bones = []
    for joint in range(1, joints):
        other = draw(st.integers(0, joint - 1))
        bones.append(draw(st.sampled_from([(joint, other), (other, joint)])))
    return named(joints, bones)


def test_ntu_partition_is_the_published_one():
    if not REFERENCE.exists():
        pytest.skip("shared/data/ctrgcn_reference.safetensors is absent")
    with safe_open(REFERENCE, "np") as tensors:
        published = tensors.get_tensor("state.l1.gcn1.PA")
    np.testing.assert_allclose(partition(ntu()), published, atol=1e-7)


def test_ntu_parents_are_the_published_inward_pairs():
    np.testing.assert_array_equal(parents(ntu()), np.array(NTU_PARENT) - 1)


def test_chain_by_hand():
    identity, inward, outward = partition(named(3, [(0, 1), (1, 2)]))
    np.testing.assert_array_equal(identity, np.eye(3))
    np.testing.assert_array_equal(inward, [[0, 0, 0], [1, 0, 1], [0, 0, 0]])
    np.testing.assert_array_equal(outward, [[0, 0.5, 0], [0, 0, 0], [0, 0.5, 0]])


@given(trees(), st.data())
def test_direction_and_order_of_bones_do_not_matter(skeleton, data):
    flipped = [bone[::-1] if data.draw(st.booleans()) else bone for bone in skeleton.bones]
    other = named(len(skeleton.joint_names), data.draw(st.permutations(flipped)))
    np.testing.assert_array_equal(partition(skeleton), partition(other))
    np.testing.assert_array_equal(parents(skeleton), parents(other))


@given(trees())
def test_every_bone_is_once_inward_and_once_outward(skeleton):
    identity, inward, outward = partition(skeleton) > 0
    np.testing.assert_array_equal(inward, outward.T)
    assert identity.trace() == identity.sum() == len(skeleton.joint_names)
    assert {frozenset(pair) for pair in np.argwhere(inward).tolist()} == {frozenset(bone) for bone in skeleton.bones}
    assert inward.sum() == len(skeleton.bones)


@given(trees())
def test_columns_sum_to_one_or_are_empty(skeleton):
    sums = partition(skeleton).sum(axis=1)
    assert np.all(np.isclose(sums, 1.0) | (sums == 0.0))


@given(trees())
def test_following_parents_ends_in_the_one_centre(skeleton):
    parent = parents(skeleton)
    joint = np.arange(len(parent))
    for _ in parent:
        joint = parent[joint]
    assert len(set(joint.tolist())) == 1
    assert parent[joint[0]] == joint[0]


def test_parts_that_no_bone_connects_have_centres_of_their_own():
    skeleton = named(7, [(0, 1), (1, 2), (3, 4), (4, 5)])
    np.testing.assert_array_equal(parents(skeleton), [1, 1, 1, 4, 4, 4, 6])
    assert np.isfinite(partition(skeleton)).all()
    assert partition(skeleton)[1:, 6].sum() == partition(skeleton)[1:, :, 6].sum() == 0.0


def test_an_edge_between_equals_is_in_both_partitions_both_ways():
    # The hub 0 has a loop of three, 0-1-2, and a limb 0-3.
    _, inward, outward = partition(named(4, [(0, 1), (0, 2), (1, 2), (0, 3)])) > 0
    for edges in (inward, outward):
        assert edges[1, 2] and edges[2, 1]
    assert inward[0, 3] and not inward[3, 0]
    assert outward[3, 0] and not outward[0, 3]


def test_a_bone_from_a_joint_to_itself_is_no_edge():
    np.testing.assert_array_equal(partition(named(2, [(0, 1), (1, 1)])), partition(named(2, [(0, 1)])))
