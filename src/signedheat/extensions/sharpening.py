"""Sharpening: a field made closer to a true distance, afterwards."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import singledispatch
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ..discretization import Diagnostics, Discretization
from ..errors import GeometryError, OutsideError
from ..operators.linear_elements import LinearElements
from ..progress import Progress
from .sharpening_methods import Geodesic


@runtime_checkable
class Method(Protocol):
    """A way to sharpen."""

    def sharpened(
        self,
        discretization: Discretization,
        elements: LinearElements,
        values: NDArray[np.float64],
        source: Any,
        progress: Progress | None,
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """New values at the unknowns from old ones, and notes for the diagnostics."""


@singledispatch
def sharpen(field: Any, **options: Any) -> Any:
    """A field closer to the exact distance to its own zero set (Sec. 7.3).

    On grids: the distance of every node to the zero set of the field, second order, with the field's signs.

    On surfaces: the same along straight lines across the faces (`Geodesic`, the default), exact on the polyhedron up to
    ``tolerance``. Where the curve is smooth and the triangles are good, as for a circle at ``t = h²``, there is little
    to gain but in the largest errors. On tets: along straight lines through space, which bend round walls.

    On both ``method=Convex()`` is the method of the paper instead, which is less accurate but mends wrong signs. On
    tets it does harm otherwise: slopes of at most one in every tet make the field too small by more than it erred.

    Parameters
    ----------
    field : GridField, VertexField or TetField
        What `signed_distance` or `SignedHeatSolver.distance` returned.
    **options
        `progress`, called as ``progress(fraction, step)``; what it raises cancels. On surfaces and tets also `method`:
        `Geodesic` or `Convex`.

    Returns
    -------
    The same kind of field. On surfaces and tets ``diagnostics.notes`` gains `slope_error_before` and
    `slope_error_after`, the root mean square of ``|∇φ| − 1`` over the domain, and notes of the method.

    Raises
    ------
    TypeError
        If this kind of field cannot be sharpened, or not by this method.
    OutsideError
        If a field has one sign everywhere, or no value anywhere.
    GeometryError
        If a value is infinite, or there is not one for each vertex.

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


def sharpened(
    field: Any,
    discretization: Discretization,
    elements: LinearElements,
    values: NDArray[np.float64],
    method: Method | None,
    progress: Progress | None,
) -> tuple[NDArray[np.float64], Diagnostics]:
    """What fields on surfaces and on tets have in common: new values, and diagnostics that compare the slopes."""
    method = Geodesic() if method is None else method
    if isinstance(method, type) or not isinstance(method, Method):
        raise TypeError(f"{method!r} is no method of sharpening: pass Geodesic() or Convex()")
    known = np.isfinite(values)
    if not known.any():
        raise OutsideError("the field has no value anywhere: pass one that a source reaches")
    if not (known | np.isnan(values)).all():
        raise GeometryError(f"the field is infinite at vertex {np.flatnonzero(np.isinf(values))[0]}: compute it anew")
    begin = time.perf_counter()
    if progress is not None:
        progress(0.0, "sharpen")
    new, notes = method.sharpened(discretization, elements, values, field.source, progress)
    if progress is not None:
        progress(1.0, "done")
    old = field.diagnostics
    errors = {"slope_error_before": elements.slope_error(values), "slope_error_after": elements.slope_error(new)}
    timings = {**old.timings, "sharpen": time.perf_counter() - begin}
    return new, replace(old, timings=timings, notes={**old.notes, **errors, **notes})
