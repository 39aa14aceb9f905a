"""Kernel: groups of vertices that nearly coincide."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..mesh.gluing_kernels import kernel

NEARNESS = 0.01
"""Vertices nearly coincide where the size of their group is less than this fraction of the distance to any other."""


@kernel
def root(parent: NDArray[np.int64], a: int) -> int:
    """Representative of the group that a vertex belongs to (union–find with path halving)."""
    while parent[a] != a:
        parent[a] = parent[parent[a]]
        a = parent[a]
    return a


@kernel
def coinciding(
    tail: NDArray[np.int64],
    head: NDArray[np.int64],
    length: NDArray[np.float64],
    order: NDArray[np.int64],
    n_vertices: int,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Group vertices that nearly coincide: the first vertex of the group of each, or −1.

    Edges join vertices into ever larger groups, in an order from short to long ones (Kruskal). A group is kept if the
    lengths of the edges that made it sum to less than `NEARNESS` times the length of the next edge that leaves it; of
    nested groups the largest is kept. This sum, a bound on the diameter, is returned at its first vertex.
    """
    parent, node = np.arange(n_vertices), np.arange(n_vertices)
    first, second = np.full(2 * n_vertices, -1), np.full(2 * n_vertices, -1)
    extent, leaving = np.zeros(2 * n_vertices), np.full(2 * n_vertices, np.inf)
    count = n_vertices
    for e in order:
        a, b = root(parent, tail[e]), root(parent, head[e])
        if a == b:
            continue
        one, two = node[a], node[b]
        first[count], second[count] = one, two
        extent[count] = extent[one] + extent[two] + length[e]
        leaving[one] = leaving[two] = length[e]
        parent[b] = a
        node[a] = count
        count += 1
    inside, group, size = np.full(count, -1), np.full(n_vertices, -1), np.zeros(n_vertices)
    for joined in range(count - 1, n_vertices - 1, -1):
        if inside[joined] < 0 and leaving[joined] < np.inf and extent[joined] < NEARNESS * leaving[joined]:
            inside[joined] = joined
        inside[first[joined]] = inside[second[joined]] = inside[joined]
    name = np.full(count, -1)
    for vertex in range(n_vertices):
        if inside[vertex] >= 0:
            if name[inside[vertex]] < 0:
                name[inside[vertex]] = vertex
            group[vertex] = name[inside[vertex]]
            size[group[vertex]] = extent[inside[vertex]]
    return group, size
