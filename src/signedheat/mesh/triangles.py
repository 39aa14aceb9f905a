"""Triangle meshes in space: the arrays that algorithms need of them, and gradients on their faces."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from .components import element_components
from .edges import EdgeTable


class Triangles(Protocol):
    """Triangles in space."""

    @property
    def vertices(self) -> Floats:
        """(n, 3) positions."""

    @property
    def faces(self) -> Ints:
        """(m, 3) vertex ids."""

    @property
    def edges(self) -> EdgeTable:
        """The edges of the faces."""

    @property
    def n_vertices(self) -> int:
        """Number of vertices."""

    @property
    def n_faces(self) -> int:
        """Number of faces."""

    @property
    def bounds(self) -> Floats:
        """(2, 3) lower and upper corner of the box around the faces."""


def area_vectors(triangles: Floats) -> Floats:
    """(m, 3) of (m, 3, 3) triangles: their normals, as long as their areas."""
    return 0.5 * np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def face_areas(triangles: Floats) -> Floats:
    """(m,) areas of (m, 3, 3) triangles."""
    return np.linalg.norm(area_vectors(triangles), axis=1)


def part_volumes(vertices: Floats, faces: Ints) -> tuple[Ints, Floats]:
    """(m,) connected part of each triangle, and the volume inside each part; negative for cavities.

    Volumes are taken about a vertex of each part, so that nothing cancels far from the origin.
    """
    parts = element_components(faces)
    first = np.unique(parts, return_index=True)[1]
    corners = vertices[faces] - vertices[faces[first, 0]][parts, None]
    return parts, np.bincount(parts, np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))) / 6


def divided_at(faces: Ints, rows: Ints, corners: Ints, points: Ints) -> Ints:
    """Faces, some of which are divided by a point on the side that begins at a corner; their halves are at the end."""
    a, b, c = (faces[rows, (corners + k) % 3] for k in range(3))
    halves = np.concatenate([np.stack([a, points, c], axis=1), np.stack([points, b, c], axis=1)])
    return np.concatenate([np.delete(faces, rows, axis=0), halves])


def gradients_along(sides: Floats, rises: Floats) -> Floats:
    """(p, 3) gradients in the planes of sides (p, 2, 3), along which a function rises by (p, 2); 0 if these are one."""
    normals = np.cross(sides[:, 0], sides[:, 1])
    square = np.einsum("pd,pd->p", normals, normals)
    across = rises[:, :1] * sides[:, 1] - rises[:, 1:] * sides[:, 0]
    return np.cross(across, normals) / np.where(square > 0, square, np.inf)[:, None]


EPSILON = 2.0**-52
"""Distance from 1 to the next larger number."""


@compiled
def areas_of_polygons(vertices: Floats, corners: Ints, offsets: Ints) -> tuple[Floats, Bools]:
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
