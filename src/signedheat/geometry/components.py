"""Vertices at one position; connected components of graphs and of elements."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..compiled import compiled


def same_positions(vertices: NDArray[np.float64]) -> NDArray[np.int64]:
    """(n,) id of the first vertex at exactly the same position as each vertex.

    Examples
    --------
    >>> same_positions(np.array([[0.0, 1.0], [2.0, 3.0], [-0.0, 1.0]])).tolist()
    [0, 1, 0]
    """
    return _same_rows((np.ascontiguousarray(vertices) + 0.0).view(np.uint64))  # −0 becomes 0


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
    graph = sparse.coo_array((np.ones(len(one), dtype=bool), (one, other)), shape=(n, n))
    labels: NDArray[np.int64] = sparse.csgraph.connected_components(graph.tocsr(), directed=False)[1].astype(np.int64)
    return labels


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
    return _element_components(np.ascontiguousarray(elements), int(elements.max()) + 1)


@compiled
def _same_rows(bits):
    count, dimension = bits.shape
    size = 16
    while size < 2 * count:
        size *= 2
    mask = np.uint64(size - 1)
    table = np.full(size, -1, dtype=np.int64)
    result = np.empty(count, dtype=np.int64)
    for i in range(count):
        key = np.uint64(1469598103934665603)
        for d in range(dimension):
            key = (key ^ bits[i, d]) * np.uint64(0x9E3779B97F4A7C15)
            key ^= key >> np.uint64(29)
        place = key & mask
        while True:
            other = table[place]
            if other < 0:
                table[place] = i
                result[i] = i
                break
            same = True
            for d in range(dimension):
                if bits[i, d] != bits[other, d]:
                    same = False
            if same:
                result[i] = other
                break
            place = (place + np.uint64(1)) & mask
    return result


@compiled
def _element_components(elements, n):
    parent = np.empty(n, dtype=np.int64)
    for i in range(n):
        parent[i] = i
    for e in range(elements.shape[0]):
        for c in range(1, elements.shape[1]):
            a, b = elements[e, 0], elements[e, c]
            while parent[a] != a:
                parent[a] = parent[parent[a]]
                a = parent[a]
            while parent[b] != b:
                parent[b] = parent[parent[b]]
                b = parent[b]
            if a < b:
                parent[b] = a
            else:
                parent[a] = b
    labels = np.full(n, -1, dtype=np.int64)
    result = np.empty(elements.shape[0], dtype=np.int64)
    count = 0
    for e in range(elements.shape[0]):
        a = elements[e, 0]
        while parent[a] != a:
            a = parent[a]
        if labels[a] < 0:
            labels[a] = count
            count += 1
        result[e] = labels[a]
    return result
