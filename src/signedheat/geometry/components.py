"""Connected components of graphs and of elements."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..frozen import read_only


def connected_components(n: int, one: NDArray[np.integer], other: NDArray[np.integer]) -> NDArray[np.int64]:
    """(n,) connected component of each node of a graph, numbered by first appearance.

    Parameters
    ----------
    n : int
        Number of nodes.
    one, other : (k,) int
        The ends of each edge.

    Examples
    --------
    >>> connected_components(4, np.array([0, 3]), np.array([2, 3])).tolist()
    [0, 1, 0, 2]
    """
    return np.asarray(_labels(n, *(read_only(np.ascontiguousarray(ends, dtype=np.int64)) for ends in (one, other))))


def element_components(elements: NDArray[np.int64]) -> NDArray[np.int64]:
    """(m,) connected component of each element, numbered by first appearance.

    Parameters
    ----------
    elements : (m, k) int
        The vertices of each element, or its edges, or its faces: elements that share one are connected.

    Examples
    --------
    >>> element_components(np.array([[0, 1, 2], [3, 4, 5], [2, 6, 7]])).tolist()
    [0, 1, 0]
    """
    links = np.repeat(elements[:, 0], elements.shape[1] - 1), elements[:, 1:].ravel()
    labels = connected_components(int(elements.max()) + 1, *links)[elements[:, 0]]
    first = np.empty(int(labels.max()) + 1, dtype=np.int64)
    first[labels[::-1]] = np.arange(len(labels))[::-1]
    is_first = first[labels] == np.arange(len(labels))
    return (np.cumsum(is_first) - 1)[first[labels]]


@compiled
def _labels(n: int, one: NDArray[np.int64], other: NDArray[np.int64]) -> NDArray[np.int64]:
    """The root of a tree is its least node; paths are halved on the way to it."""
    parents = np.arange(n)
    for k in range(len(one)):
        a, b = one[k], other[k]
        while parents[a] != a:
            parents[a] = parents[parents[a]]
            a = parents[a]
        while parents[b] != b:
            parents[b] = parents[parents[b]]
            b = parents[b]
        parents[max(a, b)] = min(a, b)
    count = 0
    for node in range(n):  # those above it have their numbers already
        if parents[node] == node:
            parents[node] = -1 - count
            count += 1
        else:
            parents[node] = parents[parents[node]]
    return -1 - parents
