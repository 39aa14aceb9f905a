"""Triangles joined along their edges: those that end on the edges of others divide these."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from .edges import edge_table
from .meshes import divided_at, face_areas
from .welding import coincident_faces, welded

MOST_ROUNDS = 64
"""Times that faces are divided: each halves the number of points on an edge."""
SLITS = 1.0, 10.0, 100.0
"""Widths, over the tolerance, of slits between edges that are closed one after the other: where two triangles that are
hardly inclined cut each other, rounding moves the ends of the cut that much."""


def conforming(
    triangles: NDArray[np.float64], tolerance: float
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """A mesh of (m, 3, 3) triangles of which edges meet whole edges.

    Corners within the tolerance of each other become one vertex. Edges that no other face runs along in the opposite
    direction are divided at the ends of other such edges that lie on them, and their faces with them.

    Returns
    -------
    vertices : (n, 3) float
        Positions.
    faces : (k, 3) int
        In order of the triangles at first; parts of divided ones are at the end.
    open_edges : (e, 2) int
        Edges that faces do not run along as often one way as the other: none if the mesh is closed.

    Examples
    --------
    A large face next to two small ones:

    >>> corners = np.array([[[0.0, 0, 0], [2, 0, 0], [0, 2, 0]], [[0, 0, 0], [1, -1, 0], [1, 0, 0]],
    ...                     [[1, 0, 0], [1, -1, 0], [2, 0, 0]]])
    >>> vertices, faces, open_edges = conforming(corners, 1e-9)
    >>> len(faces), len(open_edges)
    (4, 4)
    """
    vertices, faces = _welded(triangles.reshape(-1, 3), tolerance)
    for slit in SLITS:
        for _ in range(MOST_ROUNDS):
            sides = _open_sides(faces)
            rows, corners, points = _points_on_edges(vertices, faces, sides, tolerance, slit * tolerance)
            if not len(rows):
                break
            faces = divided_at(faces, rows, corners, points)
    sides = _open_sides(faces)
    alone, counts = np.unique(sides // 3, return_counts=True)  # flat ones, which came of dividing, between closed edges
    idle = alone[(counts == 3) & (_heights(vertices[faces[alone]]) <= SLITS[-1] * tolerance)]
    faces = _without_doubles(np.delete(faces, idle, axis=0))
    sides = _open_sides(faces)
    return vertices, faces, np.stack([faces[sides // 3, sides % 3], faces[sides // 3, (sides + 1) % 3]], axis=1)


def _welded(points: NDArray[np.float64], tolerance: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices, and triangles between them that have three different ones.

    Triangles without area are left out: along their longest side two edges of others meet one, which is divided.
    """
    used, numbers = np.unique(welded(points, tolerance), return_inverse=True)
    vertices, faces = points[used], numbers.reshape(-1, 3)
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    return vertices, faces[_heights(vertices[faces]) > tolerance]


def _without_doubles(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Faces without pairs on the same vertices that face opposite ways."""
    first, reverse = coincident_faces(faces.ravel(), np.arange(0, faces.size + 1, 3))
    forth, back = (np.bincount(first[reverse == way], minlength=len(faces)) for way in (False, True))
    return faces[~((forth == 1) & (back == 1))[first]]


def _heights(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m,) of triangles above their longest sides."""
    sides = np.roll(corners, -1, axis=1) - corners
    return 2.0 * face_areas(corners) / np.linalg.norm(sides, axis=2).max(axis=1)


def _open_sides(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Sides of faces, three times the face plus the corner where each begins, along edges that do not cancel."""
    table = edge_table(faces)
    return np.flatnonzero(table.balance[table.face_edges.ravel()] != 0)


def _points_on_edges(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], sides: NDArray[np.int64], tolerance: float, slit: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """For faces with points on a side: the face, the corner where this begins, and of the points the middlemost."""
    tails, heads = faces[sides // 3, sides % 3], faces[sides // 3, (sides + 1) % 3]
    ends = np.union1d(tails, heads)
    nothing = np.zeros(0, dtype=np.int64)
    if not len(ends):
        return nothing, nothing, nothing
    start, stop = vertices[tails], vertices[heads]
    lengths = np.linalg.norm(stop - start, axis=1)
    near = scipy.spatial.cKDTree(vertices[ends]).query_ball_point(0.5 * (start + stop), 0.5 * lengths, workers=-1)
    side = np.repeat(np.arange(len(sides)), [len(each) for each in near])
    point = ends[np.concatenate([np.asarray(each, dtype=np.int64) for each in near])]
    away, along = vertices[point] - start[side], (stop - start)[side] / np.maximum(lengths, 1e-300)[side, None]
    at = (away * along).sum(axis=1)
    off = np.linalg.norm(away - at[:, None] * along, axis=1)
    on = (off <= slit) & (at > tolerance) & (at < lengths[side] - tolerance)
    on &= (point != tails[side]) & (point != heads[side]) & (point != faces[sides // 3, (sides + 2) % 3][side])
    side, point, at = side[on], point[on], at[on]
    order = np.lexsort((np.abs(at / lengths[side] - 0.5), sides[side] // 3))
    _, first = np.unique(sides[side[order]] // 3, return_index=True)
    chosen = order[first]
    return sides[side[chosen]] // 3, sides[side[chosen]] % 3, point[chosen]
