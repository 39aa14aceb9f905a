"""Meshes whose vertices and edges are shared by parts that only touch, made manifold."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .components import by_first_use, connected_components
from .edges import edge_table
from .triangles import divided_at
from .unit_vectors import axes_across


def split_at_pinches(
    points: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Give parts of a closed mesh that touch along edges or at vertices their own: what is inside stays apart.

    Around an edge of more than two faces each is paired with the one that bounds the same wedge of the inside. Edges of
    more whose ends hang together all around get middles. A mesh that is manifold stays as it is.

    Examples
    --------
    Two tetrahedra with an edge in common:

    >>> points = np.array([[0.0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    >>> tet = np.array([[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]])
    >>> other = np.array([0, 1, 4, 5])[tet]
    >>> len(split_at_pinches(points, np.concatenate([tet, other]))[0])
    8
    """
    points, faces = _split(points, faces)
    while True:
        table = edge_table(faces)
        crowded = np.where(table.face_counts[table.face_edges] > 2, table.face_edges, len(table.vertices))
        if not (crowded < len(table.vertices)).any():
            return points, faces
        least = crowded.min(axis=1)  # of each face only one edge is divided at a time
        agreed = np.bincount(least, minlength=len(table.vertices) + 1)[:-1] == table.face_counts
        edges = np.flatnonzero(agreed & (table.face_counts > 2))
        rows, corners = np.nonzero(np.isin(table.face_edges, edges))
        middles = len(points) + np.searchsorted(edges, table.face_edges[rows, corners])
        points = np.concatenate([points, points[table.vertices[edges]].mean(axis=1)])
        points, faces = _split(points, divided_at(faces, rows, corners, middles))


def _split(points: NDArray[np.float64], faces: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    table = edge_table(faces)
    starts, halfedges = table.halfedges
    edges = table.face_edges.ravel()
    tails, heads = points[table.vertices[edges[halfedges]]].swapaxes(0, 1)
    apexes = points[faces.ravel()[3 * (halfedges // 3) + (halfedges + 2) % 3]]
    first, second = axes_across(heads - tails)
    away = apexes - tails
    angles = np.arctan2((away * second).sum(axis=1), (away * first).sum(axis=1))
    around = halfedges[np.lexsort((angles, edges[halfedges]))]
    previous = np.arange(len(around)) - 1
    previous[starts[:-1]] = starts[1:] - 1
    forward = table.forward.ravel()
    paired = forward[around] & ~forward[around[previous]]
    one, other = around[paired], around[previous[paired]]
    following, beyond = (3 * (each // 3) + (each + 1) % 3 for each in (one, other))
    corners = connected_components(faces.size, np.concatenate([one, following]), np.concatenate([beyond, other]))
    if int(corners.max(initial=-1)) + 1 == len(np.unique(faces)):
        return points, faces
    numbers, _ = by_first_use(corners, int(corners.max()) + 1)
    owners = np.empty(int(numbers.max()) + 1, dtype=np.int64)
    owners[numbers] = faces.ravel()
    return points[owners], numbers.reshape(-1, 3)
