"""The boundary of a solid as one closed mesh of the faces that were given and of what completes them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..domains.triangle_mesh import TriangleMesh
from ..errors import GeometryError
from ..geometry.conforming import conforming
from .winding import Windings

TOGETHER = 1e-7
"""Distance, over the size of the solid, up to which corners are one: triangles that cut each other are cut one by one,
and come to the same place only up to rounding in their planes."""


def given_surface(triangles: NDArray[np.float64], windings: Windings) -> TriangleMesh:
    """Triangles with the inside on one side, turned to have it behind them, joined into a closed mesh.

    Raises
    ------
    GeometryError
        If they do not join all around.
    """
    behind, ahead = windings.beside(triangles)
    turned = np.where(ahead[:, None, None], triangles[:, ::-1], triangles)[behind != ahead]
    if not len(turned):
        raise GeometryError(
            "nothing of the shape bounds a solid", remedy="thicken it, or take the surface at a distance above zero"
        )
    vertices, faces, gaps = conforming(turned, TOGETHER * float(np.ptp(triangles.reshape(-1, 3), axis=0).max()))
    if len(gaps):
        place = vertices[gaps[0]].mean(axis=0)
        raise GeometryError(
            f"faces and completion do not join along {len(gaps)} edges, the first at "
            f"({place[0]:.4g}, {place[1]:.4g}, {place[2]:.4g})",
            remedy="leave out keep_faces: the sharp surface is closed",
            element="surface",
        )
    used, renumbered = np.unique(faces, return_inverse=True)
    return TriangleMesh(vertices[used], renumbered.reshape(-1, 3))
