"""Intrinsic Delaunay triangulations by edge flips, on edge lengths and gluing alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..frozen import Number
from .edges import EdgeTable
from .gluing_kernels import Gluing, flip_until_delaunay
from .intrinsic_mesh import IntrinsicMesh


def glue(triangles: IntrinsicMesh, fixed_edges: NDArray[np.bool_] | None = None) -> Gluing:
    """Start an intrinsic triangulation, with an empty history."""
    edges, first = triangles.edges, triangles.first_halfedges
    edge, n_edges = edges.face_edges.ravel(), triangles.n_edges
    starts, order = edges.halfedges
    used = starts[1:] > starts[:-1]
    sibling = np.empty_like(edge)
    sibling[order] = np.roll(order, -1)
    sibling[order[starts[1:][used] - 1]] = order[starts[:-1][used]]
    start, front = np.zeros(n_edges, dtype=np.int64), np.zeros(len(edge), dtype=bool)
    start[edge[first]], front[first] = first, True
    sums = np.bincount(edge, weights=triangles.edge_lengths.ravel(), minlength=n_edges)
    lengths = sums / np.maximum(edges.face_counts, 1)
    unit = float(lengths.mean()) or 1.0  # what is compared with powers of two does not depend on scale
    fixed = np.zeros(n_edges, dtype=bool) if fixed_edges is None else np.array(fixed_edges, dtype=bool)
    return Gluing(
        tail=triangles.corner_vertices.ravel().copy(),
        edge=edge.copy(),
        forward=edges.forward.ravel().copy(),
        front=front,
        sibling=sibling,
        start=start,
        length=lengths / unit,
        fixed=fixed,
        flips=np.zeros(n_edges, dtype=np.int64),
        counts=np.array([triangles.n_faces, n_edges, triangles.n_vertices, 0, 0]),
        steps=np.empty((2 * n_edges + 64, 4), dtype=np.int64),
        weights=np.empty((2 * n_edges + 64, 4)),
        scratch=np.empty((4, 4), dtype=np.int64),
        unit=unit,
    )


def flip_all(gluing: Gluing) -> Gluing:
    """Flip edges, in place, until the two angles opposite to every edge sum to at most π.

    The surface stays the same, with its vertices, angle sums and area. Boundary, nonmanifold and fixed edges are not
    flipped and keep their ids; faces are turned over where neighbours have opposite orientations. Two edges may then
    join the same two vertices, or an edge a vertex with itself. Returns the gluing with arrays long enough for its
    history.

    Examples
    --------
    A rhombus cut along its long diagonal; the Delaunay edge is the short one.

    >>> sides = np.array([[1.9, 1.0, 1.0], [1.9, 1.0, 1.0]])
    >>> rhombus = IntrinsicMesh.from_lengths(np.array([[0, 1, 2], [1, 0, 3]]), sides, 4)
    >>> lay_out(flip_all(glue(rhombus))).edges.vertices.tolist()
    [[3, 2], [1, 2], [2, 0], [0, 3], [3, 1]]
    """
    n_edges = int(gluing.counts[1])
    gluing.counts[4] = n_edges
    stack, stacked = np.arange(n_edges)[::-1].copy(), np.ones(n_edges, dtype=bool)
    while not flip_until_delaunay(gluing, stack, stacked):
        gluing = gluing._replace(steps=doubled(gluing.steps), weights=doubled(gluing.weights))
    return gluing


def lay_out(gluing: Gluing) -> IntrinsicMesh:
    """The current triangulation as an intrinsic mesh. Edges keep their ids and their frames."""
    n_faces, n_edges, n_vertices = gluing.counts[:3].tolist()
    corners, edge = gluing.tail[: 3 * n_faces].reshape(-1, 3).copy(), gluing.edge[: 3 * n_faces].copy()
    front, heads = np.flatnonzero(gluing.front[: 3 * n_faces]), np.roll(corners, -1, axis=1).ravel()
    leading = np.full(n_edges, -1)
    leading[edge[front]] = front
    ends = np.stack([corners.ravel()[leading], heads[leading]])
    vertices = np.where(gluing.forward[leading], ends, ends[::-1]).T
    table = EdgeTable(vertices, edge.reshape(-1, 3), gluing.forward[: 3 * n_faces].reshape(-1, 3).copy())
    mesh = IntrinsicMesh.from_lengths(corners, gluing.length[table.face_edges] * gluing.unit, n_vertices, table)
    return replace(mesh, leading_sides=leading[leading >= 0])


def doubled(array: NDArray[Number]) -> NDArray[Number]:
    return np.concatenate([array, np.zeros_like(array)])
