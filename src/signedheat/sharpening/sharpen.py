"""Sharpening: post-processing that makes a field closer to an exact distance (Sec. 7.3)."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial, singledispatch
from typing import Any, Protocol, TypeVar, overload, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ..diagnostics import Diagnostics, Note, SlopeErrors
from ..discretization import Discretization, SourceTerm
from ..domains.curves import CurvesAndPoints
from ..domains.grid import Dimension
from ..domains.kinds import Shapes
from ..errors import GeometryError, InexactWarning, OutsideError, UnsupportedTypeError, warn_user
from ..fields.grid_field import GridField
from ..fields.tet_field import TetField
from ..fields.to_field import Field
from ..fields.vertex_field import VertexField
from ..operators.linear_elements import LinearElements
from ..progress import Progress
from .methods import Geodesic, distance_to_nearest


@runtime_checkable
class Method(Protocol):
    """A method of sharpening, for fields on surfaces and tets."""

    def sharpened(
        self,
        discretization: Discretization,
        elements: LinearElements,
        values: NDArray[np.float64],
        source: SourceTerm | None,
        progress: Progress | None,
    ) -> tuple[NDArray[np.float64], tuple[Note, ...]]:
        """Sharpened values at the unknowns, from the old ones, and notes for the diagnostics."""


WORSE = 0.1
"""Mean deviation of slopes from 1, none counted above 1, that sharpening may add. Triangles on their own have .08."""

TO_CURVES = 1e-5
"""Tolerance of distance to curves: at a tenth of that of `Geodesic`, it changes by less than 1e-6 of its range with the
order of faces."""

OnSurface = TypeVar("OnSurface", bound=VertexField)


@overload
def sharpen(field: GridField[Dimension], *, progress: Progress | None = None) -> GridField[Dimension]: ...
@overload
def sharpen(
    field: OnSurface,
    source: CurvesAndPoints | None = None,
    *,
    method: Method | None = None,
    progress: Progress | None = None,
) -> OnSurface: ...
@overload
def sharpen(
    field: TetField, source: Shapes | None = None, *, method: Method | None = None, progress: Progress | None = None
) -> TetField: ...
@overload
def sharpen(field: Field, *, progress: Progress | None = None) -> Field: ...
def sharpen(
    field: Field,
    source: CurvesAndPoints | Shapes | None = None,
    *,
    method: Method | None = None,
    progress: Progress | None = None,
) -> Field:
    """Replace a field by the distance to its own zero set, or to what it was computed from.

    This is Section 7.3 of the paper.

    On grids: the distance of every node to the zero set, second order, with the signs of the field. Distance to a shape
    itself is that of `complete`.

    On surfaces: exact geodesic distance on the polyhedral surface, up to a tolerance (`Geodesic`, the default). For
    smooth curves on good triangles, such as a circle at ``t = h²``, mainly the largest errors become smaller. With a
    `source`: exact distance to the curves and points themselves, however they cross the faces. In regions that curves
    bound, these decide the side; elsewhere the field does, and its zero set replaces missing curve where it is
    farther from any curve than the triangles are large, or begins at the free end of one.

    On tets: distance along straight lines in space, which bend around the boundary of the mesh, to the zero set. With a
    `source`: to the faces of the shape, exactly, and to the zero set where it is farther than one and a half edges
    from any. Within two edges of a face the face decides the side, where the surface is closed there.

    On surfaces and tets ``method=Convex()`` is the method of the paper, which is less accurate but can correct wrong
    signs. On tets it usually increases the error: gradients of length at most one in every tet make the field too
    small.

    Parameters
    ----------
    field : GridField, VertexField or TetField
        From `signed_distance` or `SignedHeatSolver.distance`.
    source : curves and points, or meshes, optional
        What the field was computed from. On surfaces `Curve`, `SurfacePoints` or a sequence of them; on tets
        `TriangleMesh`, `PolygonMesh` or a sequence of them, oriented, and without parts inside others.
    method : Geodesic or Convex, optional
        On surfaces and tets, without a source.
    progress : callable, optional
        Called as ``progress(fraction, step)``; an exception that it raises cancels.

    Returns
    -------
    GridField, VertexField or TetField
        The same kind of field, with a note `diagnostics.SharpenedToShape` or `diagnostics.SharpenedToCurves`. On
        surfaces and tets ``diagnostics`` has a note `diagnostics.SlopeErrors`, the root mean squares of ``|∇φ| − 1``
        over the domain before and after, and notes of the method. If slopes became clearly worse, an `InexactWarning`
        is issued, and the note says so.

    Raises
    ------
    UnsupportedTypeError
        If this kind of field cannot be sharpened, or not by this method.
    OutsideError
        If the field has the same sign everywhere, or is NaN everywhere; with a source, if that has no faces besides.
    GeometryError
        If a value is infinite, or there is not one value for each vertex.
    SourceError
        If the source is none that the field can be sharpened to.

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
    return sharpen_field(field, source, method, progress)


@singledispatch
def sharpen_field(field: object, source: Any, method: Method | None, progress: Progress | None) -> Field:
    """Sharpen a field; every kind of field registers a function of its own. `sharpen` is the public function."""
    raise UnsupportedTypeError(
        f"a {type(field).__name__} cannot be sharpened",
        remedy="pass one that SignedHeatSolver.distance returned",
    )


def sharpened(
    field: VertexField | TetField,
    discretization: Discretization,
    elements: LinearElements,
    values: NDArray[np.float64],
    source: Any,
    method: Method | None,
    progress: Progress | None,
) -> tuple[NDArray[np.float64], Diagnostics]:
    """Sharpened values of a field on a surface or on tets, and diagnostics with the slope errors before and after."""
    if source is not None and method is not None:
        raise UnsupportedTypeError(
            "a method measures to the zero set alone", remedy="leave out the method or the source", element="method"
        )
    method = Geodesic() if method is None else method
    if isinstance(method, type) or not isinstance(method, Method):
        raise UnsupportedTypeError(
            f"{method!r} is no method of sharpening",
            remedy="pass Geodesic() or Convex()",
        )
    finite = np.isfinite(values)
    if not finite.any():
        raise OutsideError(
            "the field has no value anywhere",
            remedy="pass one that a source reaches",
        )
    if not (finite | np.isnan(values)).all():
        raise GeometryError(
            f"the field is infinite at vertex {np.flatnonzero(np.isinf(values))[0]}",
            remedy="compute it anew",
            element=f"vertex {np.flatnonzero(np.isinf(values))[0]}",
        )
    if source is None:
        run = partial(method.sharpened, discretization, elements, values, field.source, progress)
    else:
        run = partial(distance_to_nearest, discretization, values, field.source, source, TO_CURVES, progress)
    new, diagnostics = timed(run, field.diagnostics, progress)
    worse = elements.bounded_slope_error(new) > 1.5 * elements.bounded_slope_error(values) + WORSE
    errors = SlopeErrors(elements.slope_error(values), elements.slope_error(new), worse)
    if worse:
        warn_user(f"sharpening made the field worse: {errors}", InexactWarning)
    return new, diagnostics.noting(errors)


def timed(
    run: Callable[[], tuple[NDArray[np.float64], tuple[Note, ...]]], before: Diagnostics, progress: Progress | None
) -> tuple[NDArray[np.float64], Diagnostics]:
    """The values that a function makes, and the diagnostics with its notes and its seconds."""
    begin = time.perf_counter()
    if progress is not None:
        progress(0.0, "sharpen")
    values, notes = run()
    if progress is not None:
        progress(1.0, "done")
    timings = {**before.timings, "sharpen": time.perf_counter() - begin}
    return values, replace(before, timings=timings).noting(*notes)
