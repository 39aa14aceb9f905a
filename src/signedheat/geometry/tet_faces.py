"""The triangular faces of tets."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .components import grouped
from .welding import distinct_rows

FACE_CORNERS = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
"""Corners of the face opposite each corner, counter-clockwise seen from outside."""


@dataclass(frozen=True, eq=False)
class FaceTable:
    """The faces of tets, and how tets and faces are incident.

    Attributes
    ----------
    vertices : (f, 3) int
        Vertex ids, counter-clockwise as seen from outside the FIRST tet at the face.
    tet_faces : (m, 4) int
        Face opposite each corner of each tet.
    """

    vertices: NDArray[np.int64]
    tet_faces: NDArray[np.int64]

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
    """Find the faces of tets, numbered by first appearance, in linear time.

    Examples
    --------
    >>> table = face_table(np.array([[0, 1, 2, 3], [4, 1, 3, 2]]))
    >>> table.tet_faces.tolist()
    [[0, 1, 2, 3], [0, 4, 5, 6]]
    >>> table.tet_counts.tolist(), table.neighbors.tolist()
    ([2, 1, 1, 1, 1, 1, 1], [[1, -1, -1, -1], [0, -1, -1, -1]])
    """
    corners = tets[:, FACE_CORNERS].reshape(-1, 3)
    number, first = distinct_rows(np.sort(corners, axis=1))
    return FaceTable(corners[first], number.reshape(-1, 4))
