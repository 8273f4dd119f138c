"""The skeleton as a directed graph: how CTR-GCN divides its edges."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.skeleton import Skeleton
from ehar.data.skeleton_tree import rooted


def partition(skeleton: Skeleton) -> FloatArray:
    """Return the spatial partition that CTR-GCN starts its adjacency from, (3, J, J) float32.

    The parts are identity, inward edges and outward edges (Yan et al., ST-GCN, AAAI 2018, Sec. 3.3, as in the public
    CTR-GCN). In the inward part, `[1, parent, child]` is 1. The outward part is its transpose. The columns of each
    part are divided by their sums. A loop of odd length has an edge between two joints that are equally far from the
    centre; such an edge is in both parts, in both directions.
    """
    adjacency, depth, _ = rooted(skeleton)
    inward = (adjacency & (depth[:, None] <= depth[None, :])).astype(np.float32)
    identity = np.eye(len(depth), dtype=np.float32)
    return np.stack([_column_normalised(edges) for edges in (identity, inward, inward.T)])


def _column_normalised(edges: FloatArray) -> FloatArray:
    degree = edges.sum(axis=0)
    return edges / np.where(degree > 0.0, degree, 1.0)
