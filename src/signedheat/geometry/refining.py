"""Triangles split where they are too long for what is to be seen on them, and cut along level sets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .edges import edge_table

_TEMPLATES = {
    0: ((0, 1, 2),),
    1: ((0, 3, 2), (3, 1, 2)),
    2: ((0, 1, 4), (0, 4, 2)),
    4: ((0, 1, 5), (1, 2, 5)),
    3: ((3, 1, 4), (0, 3, 4), (0, 4, 2)),
    6: ((4, 2, 5), (0, 1, 4), (0, 4, 5)),
    5: ((0, 3, 5), (3, 1, 2), (3, 2, 5)),
    7: ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
}
"""Triangles that take the place of one, by the edges (bits) that are split; corners 3, 4, 5 are on edges 0, 1, 2."""


def split_at_edges(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], split: NDArray[np.bool_], shares: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Triangles with points put into some of their edges; neighbours share these, so that nothing comes apart.

    Parameters
    ----------
    vertices, faces : (n, 3) float, (m, 3) int
        Triangles.
    split : (e,) bool
        Edges, in the order of `edge_table`, that get a point.
    shares : (e,) float
        Where on each edge, from its tail, 0, to its head, 1.

    Returns
    -------
    vertices, faces : (n + k, 3) float, (m', 3) int
        The new points come last.
    origins : (m',) int
        Face that each face is part of, ascending.

    Examples
    --------
    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> faces = np.array([[0, 1, 2], [0, 2, 3]])
    >>> diagonal = np.array([False, False, True, False, False])
    >>> vertices, faces, origins = split_at_edges(square, faces, diagonal, np.full(5, 0.5))
    >>> vertices[4].tolist(), len(faces), origins.tolist()
    ([0.5, 0.5, 0.0], 4, [0, 0, 1, 1])
    """
    table = edge_table(faces)
    tail, head = vertices[table.vertices[split]].transpose(1, 0, 2)
    at = shares[split, None]
    new = np.cumsum(split) - 1 + len(vertices)
    points = np.concatenate([faces, new[table.face_edges]], axis=1)
    kinds = split[table.face_edges] @ np.array([1, 2, 4])
    parts, origins = [], []
    for kind, template in _TEMPLATES.items():
        chosen = np.flatnonzero(kinds == kind)
        for triangle in template:
            parts.append(points[chosen][:, triangle])
            origins.append(chosen)
    origin = np.concatenate(origins)
    order = np.argsort(origin, kind="stable")
    return np.concatenate([vertices, tail + at * (head - tail)]), np.concatenate(parts)[order], origin[order]
