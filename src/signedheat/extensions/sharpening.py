"""Sharpening: a field made closer to a true distance, afterwards."""

from __future__ import annotations

from functools import singledispatch
from typing import Any


@singledispatch
def sharpen(field: Any, **options: Any) -> Any:
    """A field closer to the exact distance to its own zero set (Sec. 7.3).

    On grids: the distance of every node to the zero set of the field, second order, with the field's signs.

    On surfaces: the same along straight lines across the faces (`Geodesic`, the default), exact on the polyhedron up to
    ``tolerance``; or ``method=Convex()``, which is less accurate but mends wrong signs. Where the curve is smooth and
    the triangles are good, as for a circle at ``t = h²``, there is little to gain but in the largest errors.

    Parameters
    ----------
    field : GridField or VertexField
        What `signed_distance` or `SignedHeatSolver.distance` returned.
    **options
        Those of the kind of field; on surfaces `method` and `progress`.

    Returns
    -------
    The same kind of field.

    Raises
    ------
    TypeError
        If this kind of field cannot be sharpened.
    OutsideError
        If a field has one sign everywhere.

    Examples
    --------
    >>> import numpy as np
    >>> from signedheat import Grid, GridField
    >>> grid = Grid(origin=(-1, -1, -1), spacing=0.1, shape=(21, 21, 21))
    >>> radius = np.linalg.norm(grid.points, axis=-1)
    >>> sharpened = sharpen(GridField(grid, radius**2 - 0.25))
    >>> bool(np.abs(sharpened.values - (radius - 0.5)).max() < 0.01)
    True
    """
    raise TypeError(f"a {type(field).__name__} cannot be sharpened: pass a field that signed_distance returned")
