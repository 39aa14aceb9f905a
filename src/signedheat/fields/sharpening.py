"""Sharpening: post-processing that makes a field closer to an exact distance (Sec. 7.3)."""

from __future__ import annotations

from typing import TypeVar, overload

from ..grids import redistancing  # noqa: F401  registers how its fields are sharpened
from ..grids.grid import Dimension, Grid
from ..jobs import Progress
from ..methods import Method, sharpen_on
from ..shapes.kinds import Shapes, SurfaceDomain
from ..surfaces import surface_sharpening  # noqa: F401  registers how its fields are sharpened
from ..surfaces.surface_curves import CurvesAndPoints
from ..tets import tet_sharpening  # noqa: F401  registers how its fields are sharpened
from ..tets.tet_mesh import TetMesh
from ..validation import public_call
from .field import Field

OnSurface = TypeVar("OnSurface", bound=SurfaceDomain)


@overload
def sharpen(field: Field[Grid[Dimension]], *, progress: Progress | None = None) -> Field[Grid[Dimension]]: ...
@overload
def sharpen(
    field: Field[OnSurface],
    source: CurvesAndPoints | None = None,
    *,
    method: Method | None = None,
    progress: Progress | None = None,
) -> Field[OnSurface]: ...
@overload
def sharpen(
    field: Field[TetMesh],
    source: Shapes | None = None,
    *,
    method: Method | None = None,
    progress: Progress | None = None,
) -> Field[TetMesh]: ...
@overload
def sharpen(field: Field, *, progress: Progress | None = None) -> Field: ...
@public_call
def sharpen(
    field: Field,
    source: CurvesAndPoints | Shapes | None = None,
    *,
    method: Method | None = None,
    progress: Progress | None = None,
) -> Field:
    """Replace a field φ by the distance to its own zero set, or to what it was computed from.

    This is Section 7.3 of the paper.

    On grids: the distance of every node to the zero set, with second-order accuracy and the signs of the field. A field
    that holds the solid of `complete` is exact already, and stays so.

    On surfaces: exact geodesic distance on the polyhedral surface, up to a tolerance (`Geodesic`, the default). For
    smooth curves on good triangles, such as a circle, mainly the largest errors become smaller. With a
    `source`: exact distance to the curves and points themselves, however they cross the faces. In regions that curves
    bound, the curves decide the sign; elsewhere the field does, and its zero set replaces missing curves where it is
    farther from all curves than the size of a triangle, or begins at a free end of a curve.

    On tets: distance along straight lines in space, which bend around the boundary of the mesh, to the zero set. With a
    `source`: to the faces of the shape, exactly, and to the zero set where it is farther than one and a half edges
    from all faces. Within two edges of a face the face decides the sign, if the surface is closed there.

    On surfaces and tets ``method=Convex()`` is the method of the paper, which is less accurate but can correct wrong
    signs. On tets it usually increases the error: gradients of length at most one in every tet make the field too
    small.

    Parameters
    ----------
    field : Field
        From `signed_distance` or `SignedHeatSolver.distance`.
    source : curves and points, or meshes, optional
        What the field was computed from. On surfaces `Curve`, `SurfacePoints` or a sequence of them; on tets
        `TriangleMesh`, `PolygonMesh` or a sequence of them, oriented, and without parts inside others. By default
        distance is measured to the zero set of the field alone.
    method : Geodesic or Convex, optional
        How to sharpen on surfaces and tets, if no source is given; `Geodesic` by default.
    progress : callable, optional
        Called as ``progress(fraction, step)`` with the fraction done, from 0 to 1, and the name of the step that
        begins. An exception that it raises cancels.

    Returns
    -------
    Field
        The sharpened field, on the same domain. If it was sharpened to a source, there is a note
        `diagnostics.SharpenedToShape` on tets, or `diagnostics.SharpenedToCurves` on surfaces. On surfaces and tets
        ``diagnostics`` has a note `diagnostics.SlopeErrors`, the root mean squares of ``|∇φ| − 1`` over the domain
        before and after, and notes of the method. If slopes became clearly worse, an `InexactWarning` is issued, and
        the note says so.

    Raises
    ------
    UnsupportedTypeError
        If this kind of field cannot be sharpened, or not by this method.
    OutsideError
        If the field has the same sign everywhere, and no source with faces or curves is given; or if it is NaN
        everywhere.
    GeometryError
        If a value is infinite.
    SourceError
        If the field cannot be sharpened to a source of this kind.

    See Also
    --------
    signed_distance : Distance on a grid, on tets or along a surface.
    redistance : Distance from an array of values or signs.
    methods.Geodesic : Sharpening by exact geodesic distance.
    methods.Convex : The paper's way to sharpen.

    Examples
    --------
    >>> import numpy as np
    >>> from signedheat import Field, Grid
    >>> grid = Grid(origin=(-1, -1, -1), spacing=0.1, shape=(21, 21, 21))
    >>> radius = np.linalg.norm(grid.points, axis=-1)
    >>> sharpened = sharpen(Field(grid, radius**2 - 0.25))
    >>> bool(np.abs(sharpened.values - (radius - 0.5)).max() < 0.01)
    True
    """
    return sharpen_on(getattr(field, "domain", None), field, source, method)
