"""The skeleton as a directed graph: which joint lies toward the body's centre, and how CTR-GCN divides the edges."""

import numpy as np
from scipy.sparse.csgraph import shortest_path

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.data.skeleton import Skeleton


def partition(skeleton: Skeleton) -> FloatArray:
    """Return the spatial partition that CTR-GCN starts its adjacency from, (3, J, J) float32.

    The parts are identity, inward edges and outward edges (Yan et al., ST-GCN, AAAI 2018, Sec. 3.3, as in the public
    CTR-GCN). In the inward part, `[1, parent, child]` is 1. The outward part is its transpose. The columns of each
    part are divided by their sums. A loop of odd length has an edge between two joints that are equally far from the
    centre; such an edge is in both parts, in both directions.
    """
    adjacency, depth, _ = _rooted(skeleton)
    inward = (adjacency & (depth[:, None] <= depth[None, :])).astype(np.float32)
    identity = np.eye(len(depth), dtype=np.float32)
    return np.stack([_column_normalised(edges) for edges in (identity, inward, inward.T)])


def parents(skeleton: Skeleton) -> IntArray:
    """Return each joint's neighbour toward the centre, (J,); the centre of a connected part is its own neighbour.

    A joint in a loop may have two such neighbours; the one with the lower index is taken.
    """
    adjacency, depth, centre = _rooted(skeleton)
    nearer = adjacency & (depth[None, :] < depth[:, None])
    return np.where(nearer.any(axis=1), nearer.argmax(axis=1), centre)


def _rooted(skeleton: Skeleton) -> tuple[BoolArray, FloatArray, IntArray]:
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


def _column_normalised(edges: FloatArray) -> FloatArray:
    degree = edges.sum(axis=0)
    return edges / np.where(degree > 0.0, degree, 1.0)
