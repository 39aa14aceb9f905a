"""Loops that count what is wrong with a mesh. Its faces are polygons: all their corners, and where each begins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled


@compiled
def inspect_faces(
    vertices: NDArray[np.float64], corners: NDArray[np.int64], offsets: NDArray[np.int64]
) -> tuple[float, int, NDArray[np.float64]]:
    """Total area; faces without area, to roundoff, or that name a vertex twice; corners of the box around all faces.

    An area is none if it is below what moving the corners by a few units in the last place of the coordinates makes.
    """
    total, degenerate = 0.0, 0
    box = np.empty((2, 3))
    box[0], box[1] = np.inf, -np.inf
    seen = np.full(len(vertices), -1, dtype=np.int32)
    for f in range(len(offsets) - 1):
        begin, end = offsets[f], offsets[f + 1]
        cx, cy, cz = 0.0, 0.0, 0.0
        largest, repeats = 0.0, False
        for c in range(begin, end):
            v = corners[c]
            x, y, z = vertices[v, 0], vertices[v, 1], vertices[v, 2]
            cx, cy, cz = cx + x, cy + y, cz + z
            largest = max(largest, abs(x), abs(y), abs(z))
            repeats = repeats or seen[v] == f
            seen[v] = f
            box[0, 0], box[0, 1], box[0, 2] = min(box[0, 0], x), min(box[0, 1], y), min(box[0, 2], z)
            box[1, 0], box[1, 1], box[1, 2] = max(box[1, 0], x), max(box[1, 1], y), max(box[1, 2], z)
        size = end - begin
        cx, cy, cz = cx / size, cy / size, cz / size
        nx, ny, nz, radius = 0.0, 0.0, 0.0, 0.0
        for c in range(begin, end):
            a, b = corners[c], corners[c + 1 if c + 1 < end else begin]
            ux, uy, uz = vertices[a, 0] - cx, vertices[a, 1] - cy, vertices[a, 2] - cz
            wx, wy, wz = vertices[b, 0] - cx, vertices[b, 1] - cy, vertices[b, 2] - cz
            nx, ny, nz = nx + uy * wz - uz * wy, ny + uz * wx - ux * wz, nz + ux * wy - uy * wx
            radius = max(radius, abs(ux), abs(uy), abs(uz))
        area = 0.5 * np.sqrt(nx * nx + ny * ny + nz * nz)
        total += area
        degenerate += repeats or area <= 4.0 * 2.220446049250313e-16 * radius * largest
    return total, degenerate, box


@compiled
def find_root(parents: NDArray[np.integer], node: int) -> int:
    """The root of a node's tree; paths are halved on the way."""
    while parents[node] != node:
        parents[node] = parents[parents[node]]
        node = parents[node]
    return node


@compiled
def count_components(
    n_vertices: int, tails: NDArray[np.int64], heads: NDArray[np.int64], chosen: NDArray[np.bool_]
) -> int:
    """How many connected sets the chosen halfedges make, all where none are named; vertices of no halfedge are none."""
    parents = np.arange(n_vertices).astype(np.int32)
    used = np.zeros(n_vertices, dtype=np.bool_)
    every = len(chosen) == 0
    for h in range(len(tails)):
        if every or chosen[h]:
            a, b = find_root(parents, tails[h]), find_root(parents, heads[h])
            used[tails[h]] = used[heads[h]] = True
            if a != b:
                parents[max(a, b)] = min(a, b)
    count = 0
    for v in range(n_vertices):
        count += used[v] and parents[v] == v
    return count


@compiled
def count_nonmanifold_vertices(
    n_vertices: int,
    tails: NDArray[np.int64],
    following: NDArray[np.int32],
    edges: NDArray[np.int32],
    counts: NDArray[np.int32],
    first: NDArray[np.int32],
    second: NDArray[np.int32],
) -> int:
    """Vertices at which the faces are no single fan, or that end an edge of more than two faces."""
    parents = np.arange(len(tails)).astype(np.int32)
    for edge in range(len(counts)):
        if counts[edge] == 2:
            h, k = first[edge], second[edge]
            for end in range(2):
                a = h if end == 0 else following[h]
                b = following[k] if tails[k] != tails[a] else k
                a, b = find_root(parents, a), find_root(parents, b)
                if a != b:
                    parents[max(a, b)] = min(a, b)
    fans = np.full(n_vertices, -1, dtype=np.int32)
    bad = np.zeros(n_vertices, dtype=np.bool_)
    for c in range(len(tails)):
        root, v = find_root(parents, c), tails[c]
        if fans[v] < 0:
            fans[v] = root
        bad[v] = bad[v] or fans[v] != root
        if edges[c] >= 0 and counts[edges[c]] > 2:
            bad[v] = bad[tails[following[c]]] = True
    total = 0
    for v in range(n_vertices):
        total += bad[v]
    return total


@compiled
def count_edges(
    tails: NDArray[np.int64],
    edges: NDArray[np.int32],
    counts: NDArray[np.int32],
    first: NDArray[np.int32],
    second: NDArray[np.int32],
) -> tuple[int, int, int, NDArray[np.bool_]]:
    """Edges of one face, of more than two, and of two that run along them the same way; halfedges of the first kind."""
    single, crowded, inconsistent = 0, 0, 0
    for edge in range(len(counts)):
        single += counts[edge] == 1
        crowded += counts[edge] > 2
        inconsistent += counts[edge] == 2 and tails[first[edge]] == tails[second[edge]]
    lonely = np.zeros(len(tails), dtype=np.bool_)
    for h in range(len(tails)):
        lonely[h] = edges[h] >= 0 and counts[edges[h]] == 1
    return single, crowded, inconsistent, lonely
