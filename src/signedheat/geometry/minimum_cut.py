"""The cheapest way to cut a graph in two."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

UNITS = 5e8
"""What all pulls to one side count together, as integers: flows add up to less than 2³¹."""


def minimum_cut(
    edges: NDArray[np.int64], falling: NDArray[np.float64], rising: NDArray[np.float64], pull: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n,) signs s = ±1 of nodes with the least cost of edges that are cut, less Σ pull s.

    Parameters
    ----------
    edges : (e, 2) int
        The nodes that each edge joins.
    falling, rising : (e,) float
        Cost of an edge whose first node is positive and whose second is negative; and of the reverse.
    pull : (n,) float
        How much each node gains by being positive rather than neither.

    Examples
    --------
    >>> chain = np.array([[0, 1], [1, 2], [2, 3]])
    >>> minimum_cut(chain, np.array([1.0, 0.2, 1.0]), np.ones(3), np.array([3.0, 0, 0, -3.0]))
    array([ 1.,  1., -1., -1.])
    """
    n = len(pull)
    towards, away = np.maximum(2 * pull, 0.0), np.maximum(-2 * pull, 0.0)
    total = max(float(towards.sum()), float(away.sum()))
    if total == 0:
        return np.ones(n)
    nodes = np.arange(n)
    first = np.concatenate([edges[:, 0], edges[:, 1], np.full(n, n), nodes])
    second = np.concatenate([edges[:, 1], edges[:, 0], nodes, np.full(n, n + 1)])
    costs = np.minimum(np.concatenate([falling, rising, towards, away]) / total, 1.0)
    capacity = np.rint(UNITS * costs).astype(np.int32)
    graph = sparse.csr_matrix((capacity, (first, second)), shape=(n + 2, n + 2))
    graph.eliminate_zeros()
    left = graph - maximum_flow(graph, n, n + 1).flow
    left.data = (left.data > 0).astype(np.int8)
    left.eliminate_zeros()
    signs = np.full(n + 2, -1.0)
    signs[breadth_first_order(left, n, return_predecessors=False)] = 1.0
    return signs[:n]
