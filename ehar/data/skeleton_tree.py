"""The skeleton as a tree: which joint lies toward the body's centre, and how joints follow from bones."""

import numpy as np
from scipy.sparse.csgraph import shortest_path

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.data.skeleton import Skeleton


def parents(skeleton: Skeleton) -> IntArray:
    """Return each joint's neighbour toward the centre, (J,); the centre of a connected part is its own neighbour.

    A joint in a loop may have two such neighbours; the one with the lower index is taken.
    """
    adjacency, depth, centre = rooted(skeleton)
    nearer = adjacency & (depth[None, :] < depth[:, None])
    return np.where(nearer.any(axis=1), nearer.argmax(axis=1), centre)


def rooted(skeleton: Skeleton) -> tuple[BoolArray, FloatArray, IntArray]:
    """Return the symmetric adjacency (J, J), each joint's distance to its centre in bones (J,), and the centre (J,).

    The centre is the joint of least eccentricity. Of several such joints, it is the one with the least total distance,
    and then with the lowest index. A part that no bone connects to the rest has its own centre.
    """
    joints = len(skeleton.joint_names)
    start, end = skeleton.bone_indices.T
    adjacency = np.zeros((joints, joints), dtype=np.bool_)
    adjacency[start, end] = adjacency[end, start] = True
    np.fill_diagonal(adjacency, False)
    distance = shortest_path(adjacency, unweighted=True)
    reachable = np.isfinite(distance)
    within = np.where(reachable, distance, 0.0)
    rank = np.empty(joints, dtype=np.int64)
    rank[np.lexsort((np.arange(joints), within.sum(axis=1), within.max(axis=1)))] = np.arange(joints)
    centre = np.where(reachable, rank[None, :], joints).argmin(axis=1)
    return adjacency, distance[np.arange(joints), centre], centre


def roots(toward: IntArray) -> IntArray:
    """Return the centre that each joint's parents (J,) lead to, (J,)."""
    root = toward
    for _ in toward:
        root = toward[root]
    return root


def paths(toward: IntArray) -> FloatArray:
    """Return the matrix (J, J) float32 that adds up the bones from the centre to each joint, with parents (J,)."""
    joints = np.arange(len(toward))
    matrix = np.zeros((len(toward), len(toward)), dtype=np.float32)
    at: IntArray = joints.copy()
    for _ in toward:
        moving = toward[at] != at
        matrix[joints[moving], at[moving]] = 1
        at = toward[at]
    return matrix
