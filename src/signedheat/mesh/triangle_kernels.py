"""Kernels on triangles: edges, areas, volumes."""

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled

EPSILON = 2.0**-52
"""Distance from 1 to the next larger number."""


@compiled
def find_edges(
    tails: NDArray[np.int64], heads: NDArray[np.int64], used: NDArray[np.bool_], n_vertices: int
) -> tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Edges of halfedges, in order of first appearance; those that are not used have none.

    There is one list per vertex: an edge is in that of its end with fewer halfedges, so that lists stay short.

    Returns
    -------
    edges : (h,) int
        Edge of each halfedge, or −1.
    forward : (h,) bool
        Whether it runs as the first along its edge does.
    counts, first, second : (e,) int
        Halfedges of each edge; the first and the second, or −1.
    """
    degrees, last = np.zeros(n_vertices, dtype=np.int64), np.full(n_vertices, -1)
    for h in range(len(tails)):
        degrees[tails[h]] += 1
        degrees[heads[h]] += 1
    following, counts = np.empty(len(tails), dtype=np.int64), np.zeros(len(tails), dtype=np.int64)
    first, second = np.empty(len(tails), dtype=np.int64), np.full(len(tails), -1)
    edges, forward = np.full(len(tails), -1), np.zeros(len(tails), dtype=np.bool_)
    n_edges = 0
    for h in range(len(tails)):
        if not used[h]:
            continue
        keeper, other = tails[h], heads[h]
        if degrees[other] < degrees[keeper] or (degrees[other] == degrees[keeper] and other < keeper):
            keeper, other = other, keeper
        edge = last[keeper]
        while edge >= 0 and tails[first[edge]] + heads[first[edge]] - keeper != other:
            edge = following[edge]
        if edge < 0:
            edge = n_edges
            first[edge], following[edge], last[keeper] = h, last[keeper], edge
            n_edges += 1
        elif counts[edge] == 1:
            second[edge] = h
        counts[edge] += 1
        edges[h], forward[h] = edge, tails[h] == tails[first[edge]]
    return edges, forward, counts[:n_edges].copy(), first[:n_edges].copy(), second[:n_edges].copy()


@compiled
def areas_of_polygons(
    vertices: NDArray[np.float64], corners: NDArray[np.int64], offsets: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """(p,) areas of polygons; and which are degenerate: without area, to roundoff, or with a vertex twice.

    An area is none if it is below what moving the corners by a few units in the last place of the coordinates makes.
    Polygon f has the corners from ``offsets[f]`` to ``offsets[f + 1]``.
    """
    n = len(offsets) - 1
    areas, degenerate = np.empty(n), np.zeros(n, dtype=np.bool_)
    seen = np.full(len(vertices), -1)
    middle, away, after, normal = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for f in range(n):
        middle[:], normal[:] = 0.0, 0.0
        largest, radius = 0.0, 0.0
        for c in range(offsets[f], offsets[f + 1]):
            v = corners[c]
            degenerate[f] |= seen[v] == f
            seen[v] = f
            for d in range(3):
                middle[d] += vertices[v, d] / (offsets[f + 1] - offsets[f])
                largest = max(largest, abs(vertices[v, d]))
        for c in range(offsets[f], offsets[f + 1]):
            here, there = corners[c], corners[c + 1 if c + 1 < offsets[f + 1] else offsets[f]]
            for d in range(3):
                away[d], after[d] = vertices[here, d] - middle[d], vertices[there, d] - middle[d]
                radius = max(radius, abs(away[d]))
            for d in range(3):
                normal[d] += away[d - 2] * after[d - 1] - away[d - 1] * after[d - 2]  # a cross product, cyclically
        areas[f] = 0.5 * np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
        degenerate[f] |= areas[f] <= 4.0 * EPSILON * radius * largest
    return areas, degenerate


@compiled
def areas_and_volumes(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64], center: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(m,) areas of triangles, and volumes of the tetrahedra they make with a center: positive if it is behind them."""
    areas, volumes = np.empty(len(triangles)), np.empty(len(triangles))
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ux, uy, uz = vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1], vertices[b, 2] - vertices[a, 2]
        wx, wy, wz = vertices[c, 0] - vertices[a, 0], vertices[c, 1] - vertices[a, 1], vertices[c, 2] - vertices[a, 2]
        nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        areas[t] = 0.5 * np.sqrt(nx * nx + ny * ny + nz * nz)
        px, py, pz = vertices[a, 0] - center[0], vertices[a, 1] - center[1], vertices[a, 2] - center[2]
        volumes[t] = (px * nx + py * ny + pz * nz) / 6.0
    return areas, volumes
