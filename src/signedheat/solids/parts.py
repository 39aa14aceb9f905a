"""Parts of oriented surfaces: faces that hang together across edges of two."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..mesh.components import element_components
from ..mesh.edges import edge_table


def parts_of(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """(m,) the part that each face is of: faces that share an edge which two faces have, in opposite directions."""
    table = edge_table(faces)
    joins = (table.face_counts == 2) & (table.balance == 0)
    alone = len(table.vertices) + np.arange(3 * len(faces)).reshape(-1, 3)
    sides = np.where(joins[table.face_edges], table.face_edges, alone)
    return element_components(sides)
