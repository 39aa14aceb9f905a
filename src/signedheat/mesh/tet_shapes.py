"""Tets in space: their faces, areas and volumes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .box_tree import BoxTree
from .components import grouped
from .triangles import area_vectors
from .welding import distinct_rows

FACE_CORNERS = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
"""Corners of the face opposite each corner, counter-clockwise seen from outside."""


@dataclass(frozen=True, eq=False)
class FaceTable:
    """The faces of tets, and how tets and faces are incident."""

    vertices: NDArray[np.int64]  # (f, 3) vertex ids, counter-clockwise as seen from outside the FIRST tet at the face
    tet_faces: NDArray[np.int64]  # (m, 4) face opposite each corner of each tet

    @cached_property
    def tet_counts(self) -> NDArray[np.int64]:
        """(f,) number of tets at each face: 1 on the boundary, more than 2 where nonmanifold."""
        return np.bincount(self.tet_faces.ravel(), minlength=len(self.vertices))

    @cached_property
    def neighbors(self) -> NDArray[np.int64]:
        """(m, 4) the tet beyond the face opposite each corner, −1 at the boundary."""
        flat = self.tet_faces.ravel()
        _, order = grouped(flat, len(self.vertices))
        same = flat[order[1:]] == flat[order[:-1]]
        beyond = np.full(len(flat), -1, dtype=np.int64)
        beyond[order[1:][same]] = order[:-1][same] // 4
        beyond[order[:-1][same]] = order[1:][same] // 4
        return beyond.reshape(-1, 4)


def face_table(tets: NDArray[np.int64]) -> FaceTable:
    """Find the faces of tets, numbered by first appearance, in linear time."""
    corners = tets[:, FACE_CORNERS].reshape(-1, 3)
    number, first = distinct_rows(np.sort(corners, axis=1))
    return FaceTable(corners[first], number.reshape(-1, 4))


@dataclass(frozen=True, eq=False)
class TetShapes:
    """Tets in space."""

    vertices: NDArray[np.float64]  # (n, 3) positions
    tets: NDArray[np.int64]  # (m, 4) corners; of positive volume, or degenerate

    @cached_property
    def area_vectors(self) -> NDArray[np.float64]:
        """(m, 4, 3) N_k: area times outward normal of the face opposite each corner."""
        return np.stack([area_vectors(self.vertices[self.tets[:, face]]) for face in FACE_CORNERS], axis=1)

    @cached_property
    def volumes(self) -> NDArray[np.float64]:
        """(m,) signed volumes."""
        return signed_volumes(self.vertices, self.tets)

    @cached_property
    def longest_edges(self) -> NDArray[np.float64]:
        """(m,) length of each tet's longest edge."""
        points = [self.vertices[self.tets[:, k]] for k in range(4)]
        squares = [np.square(points[i] - points[j]).sum(axis=1) for i in range(4) for j in range(i)]
        return np.sqrt(np.max(squares, axis=0))

    @cached_property
    def thickness(self) -> NDArray[np.float64]:
        """(m,) volume over the cube of the longest edge; zero for tets whose corners coincide."""
        cubes = self.longest_edges**3
        return np.maximum(self.volumes, 0) / np.where(cubes > 0, cubes, 1)

    @cached_property
    def faces(self) -> FaceTable:
        """The triangles between and around the tets."""
        return face_table(self.tets)

    @cached_property
    def search_tree(self) -> BoxTree:
        """Tree of the bounding boxes of the tets."""
        corners = self.vertices[self.tets]
        return BoxTree.of(corners.min(axis=1), corners.max(axis=1))


def signed_volumes(vertices: NDArray[np.float64], tets: NDArray[np.int64]) -> NDArray[np.float64]:
    """(m,) volumes, negative for inverted tets."""
    a, b, c, d = (vertices[tets[:, k]] for k in range(4))
    return np.einsum("mi,mi->m", np.cross(b - a, c - a), d - a) / 6
