"""Compiled kernel that finds vertices that all but coincide."""

from __future__ import annotations

import numpy as np

from .gluing_kernels import kernel

NEARNESS = 0.01
"""Vertices all but coincide where they are together smaller than this part of the way to any other."""


@kernel
def root(parent, a):
    """The group that a vertex belongs to so far."""
    while parent[a] != a:
        parent[a] = parent[parent[a]]
        a = parent[a]
    return a


@kernel
def coinciding(tail, head, length, order, n_vertices):
    """Group vertices that all but coincide.

    The shortest edges join vertices into ever larger groups (Kruskal). One is kept if the edges that made it sum to
    less than `NEARNESS` times the next one that leaves it; the largest such group counts.

    Parameters
    ----------
    tail, head : (e,) int
        Vertices of the edges.
    length : (e,) float
        Their lengths.
    order : (e,) int
        The edges, short ones first.
    n_vertices : int
        Number of vertices.

    Returns
    -------
    (n,) int
        The first vertex of the group, or −1.
    (n,) float
        At that vertex the sum of the edges that made the group: no two of its vertices are farther apart.
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
