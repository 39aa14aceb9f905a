"""Protocol of triangle meshes: the arrays that algorithms need of them."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .edges import EdgeTable


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
