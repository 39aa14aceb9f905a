"""Protocols of triangle meshes and tet meshes: the arrays that algorithms need of them."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .box_tree import BoxTree
from .edges import EdgeTable
from .tet_faces import FaceTable


class Triangles(Protocol):
    """Triangles in space."""

    @property
    def vertices(self) -> NDArray[np.float64]:
        """(n, 3) positions."""

    @property
    def faces(self) -> NDArray[np.int64]:
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
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) lower and upper corner of the box around the faces."""


class TetShapes(Protocol):
    """Volumes and face area vectors of tets."""

    @property
    def area_vectors(self) -> NDArray[np.float64]:
        """(m, 4, 3) area times outward normal of the face opposite each corner."""

    @property
    def volumes(self) -> NDArray[np.float64]:
        """(m,) volumes."""

    @property
    def thickness(self) -> NDArray[np.float64]:
        """(m,) volume over the cube of the longest edge."""


class Tets(Protocol):
    """Tets in space."""

    @property
    def vertices(self) -> NDArray[np.float64]:
        """(n, 3) positions."""

    @property
    def tets(self) -> NDArray[np.int64]:
        """(m, 4) vertex ids."""

    @property
    def n_vertices(self) -> int:
        """Number of vertices."""

    @property
    def faces(self) -> FaceTable:
        """The triangles between and around the tets."""

    @property
    def geometry(self) -> TetShapes:
        """Volumes and face area vectors."""

    @property
    def search_tree(self) -> BoxTree:
        """Tree of the bounding boxes of the tets."""
