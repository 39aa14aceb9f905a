"""Which faces and lids bound a solid: those with the inside on one side only. So bodies that overlap are united."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.cut_faces import cut_faces
from ..geometry.part_levels import face_areas
from .parts import parts_of
from .winding import Windings


@dataclass(frozen=True, eq=False)
class Pieces:
    """Triangles cut where they cross each other.

    Attributes
    ----------
    triangles : (p, 3, 3) float
        Corners.
    origins : (p,) int
        Triangle that each is a piece of.
    behind, ahead : (p,) bool
        Whether it is inside there.
    """

    triangles: NDArray[np.float64]
    origins: NDArray[np.int64]
    behind: NDArray[np.bool_]
    ahead: NDArray[np.bool_]


def pieces_of(
    triangles: NDArray[np.float64], ids: NDArray[np.int64], closing: NDArray[np.bool_], windings: Windings
) -> Pieces:
    """Cut triangles along those that close something, and find out on which of their sides it is inside.

    Between cuts both sides are the same all over a part, which is looked at once.

    Parameters
    ----------
    triangles, ids : (m, 3, 3) float, (m, 3) int
        Corners, and the vertices.
    closing : (m,) bool
        Those that have a winding number.
    windings : Windings
        Theirs.
    """
    pieces, origins, met = cut_faces(triangles, ids, triangles[closing], ids[closing])
    regions = np.arange(len(pieces))
    whole = np.flatnonzero(~met[origins])
    if len(whole):
        parts = parts_of(ids[origins[whole]])
        largest = np.lexsort((-face_areas(pieces[whole]), parts))
        _, first = np.unique(parts[largest], return_index=True)
        regions[whole] = whole[largest[first]][parts]
    some, where = np.unique(regions, return_inverse=True)
    behind, ahead = windings.sides(pieces[some])
    return Pieces(pieces, origins, behind[where], ahead[where])
