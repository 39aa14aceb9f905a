"""Morphological operations on broken shapes, by level sets of their signed distance (Sec. 9.3.1).

An opening or closing computes the distance again after its first offset, since distance to an offset differs from
distance to the shape by a constant on one side only.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Literal, Protocol, TypeAlias, cast, overload

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Floats
from .distances import signed_distance
from .errors import (
    InexactWarning,
    OutsideError,
    SignedHeatError,
    SourceError,
    UnsupportedTypeError,
    counted,
    warn_user,
)
from .fields.blends import smooth_difference, smooth_intersection, smooth_union
from .fields.field import Field
from .grids.grid import RESOLUTION, Grid
from .grids.polyline import Polyline
from .jobs import Progress
from .mesh.box_tree import room_around
from .mesh.triangles import part_volumes
from .parallel import PointTree
from .search.face_tree import FaceFeatures, FaceTree
from .search.nearest_triangles import weights_in
from .shapes.area_elements import bounds_around
from .shapes.foreign import as_list, as_shape, converted
from .shapes.kinds import Domain, Polylines, Shapes, Source, Sources, SurfaceDomain
from .shapes.transforms import concatenated
from .solids.completion import complete
from .solids.contouring import CONTOUR_POINTS, sharp_surface
from .solids.extrusion import extrude
from .solids.gauss import Pieces, sampled
from .solids.implicit_surfaces import contour
from .solids.offsets import Offset, Reach, SheetWall, checked_reach
from .solids.solid import Solid
from .surfaces.digital_surface import DigitalSurface
from .surfaces.point_cloud import PointCloud
from .surfaces.polygon_mesh import PolygonMesh
from .surfaces.surface_curves import Curve, CurveOrPoints, CurvesAndPoints
from .surfaces.triangle_mesh import TriangleMesh
from .tets.tet_mesh import TetMesh
from .validation import (
    array_of,
    callback,
    chosen,
    finite_number,
    flag,
    numbers,
    positive_number,
    public_call,
    refuse_beside,
)

__all__ = [
    "closing", "dilate", "erode", "extrude", "offset", "opening", "shell", "smooth_difference", "smooth_intersection",
    "smooth_union", "thicken",
]  # fmt: skip

Corners: TypeAlias = Literal["round", "mitre", "sharp"]
Side: TypeAlias = Literal["outside", "inside", "both"]
MITRE_LIMITS: dict[Corners, float] = {"round": 1.0, "mitre": 2.0, "sharp": 10.0}
"""Largest distance of a mitred edge or corner from the shape, relative to the offset; longer mitres are cut off. With
2, edges and corners of boxes are kept, and edges between faces at less than 60° are cut off; with 10, those at less
than 12°."""
DRAIN_SIDES = 64
"""Number of sides of a drain hole."""

Boundary: TypeAlias = TriangleMesh | list[Polyline] | list[Curve]
"""Boundary of a result: a mesh in space, polylines in the plane, or curves on a surface."""
Measure: TypeAlias = Callable[[Sources, Domain], Field] | None
"""A function, called as ``measure(shape, domain)``, that returns the distance field whose level sets are the offsets.
None stands for `signed_distance`."""


class _Morphology(Protocol):
    """The signature of `dilate`, `erode`, `opening` and `closing`."""

    @overload
    def __call__(
        self,
        shape: Shapes,
        distance: float,
        domain: Grid | TetMesh | None = ...,
        *,
        resolution: int | None = ...,
        measure: Measure = ...,
    ) -> TriangleMesh: ...
    @overload
    def __call__(
        self,
        shape: Polylines,
        distance: float,
        domain: Grid | None = ...,
        *,
        resolution: int | None = ...,
        measure: Measure = ...,
    ) -> list[Polyline]: ...
    @overload
    def __call__(
        self,
        shape: CurvesAndPoints,
        distance: float,
        domain: SurfaceDomain,
        *,
        resolution: int | None = ...,
        measure: Measure = ...,
    ) -> list[Curve]: ...


def _by_kind_of_shape(function: Callable[..., Boundary]) -> _Morphology:
    """Make a function a `public_call`, and tell type checkers that the type of the shape decides that of the result."""
    return cast("_Morphology", public_call(function))


@_by_kind_of_shape
def dilate(
    shape: Sources,
    distance: float,
    domain: Domain | None = None,
    *,
    resolution: int | None = None,
    measure: Measure = None,
) -> Boundary:
    """Dilate a shape, by offsetting its boundary outward by a distance.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh, PointCloud; in the plane Polyline; on a surface Curve; or a sequence of them
        The shape, which may be broken. Its inside is where `signedheat.signed_distance` is negative.
    distance : float
        How far the boundary moves outward, in the units of the shape; not negative.
    domain : Grid, TetMesh, TriangleMesh or any other domain, optional
        Domain on which the signed distance is computed. By default, a grid around the shape with room for the result.
        Curves need the surface that they lie on.
    resolution : int, optional
        Number of nodes along the longest side of the default grid; 128 by default.
    measure : callable, optional
        Called as ``measure(shape, domain)``, it returns the `Field` of signed distance whose level sets are the
        offsets. By default `signed_distance`; ``partial(signed_distance, keep_overlaps=True)`` sets one of its options.

    Returns
    -------
    TriangleMesh, or list of Polyline or Curve
        The boundary of the result, closed, manifold, and oriented like the shape: a `TriangleMesh` for shapes in space,
        a list of `Polyline` for those in the plane, and a list of `Curve` for curves on a surface.

    Raises
    ------
    SignedHeatError
        If the distance is not a finite nonnegative number.
    SourceError
        If the shape does not fit the domain.
    UnsupportedTypeError
        If a resolution is given beside a domain.
    OutsideError
        If the result is empty, or leaves the domain.

    See Also
    --------
    morphology.erode : Shrink by a distance.
    morphology.closing : Grow, then shrink.
    offset : The closed surface at a distance.

    Examples
    --------
    >>> from signedheat import samples
    >>> ball = samples.sphere(3)
    >>> bool(abs(np.linalg.norm(dilate(ball, 0.5, resolution=32).vertices, axis=1) - 1.5).max() < 0.02)
    True
    """
    return _offsets(shape, distance, (1,), domain, resolution, measure)


@_by_kind_of_shape
def erode(
    shape: Sources,
    distance: float,
    domain: Domain | None = None,
    *,
    resolution: int | None = None,
    measure: Measure = None,
) -> Boundary:
    """Erode a shape, by offsetting its boundary inward by a distance.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh, PointCloud; in the plane Polyline; on a surface Curve; or a sequence of them
        The shape, which may be broken. Its inside is where `signedheat.signed_distance` is negative.
    distance : float
        How far the boundary moves inward, in the units of the shape; not negative.
    domain : Grid, TetMesh, TriangleMesh or any other domain, optional
        Domain on which the signed distance is computed. By default, a grid around the shape with room for the result.
        Curves need the surface that they lie on.
    resolution : int, optional
        Number of nodes along the longest side of the default grid; 128 by default.
    measure : callable, optional
        Called as ``measure(shape, domain)``, it returns the `Field` of signed distance whose level sets are the
        offsets. By default `signed_distance`; ``partial(signed_distance, keep_overlaps=True)`` sets one of its options.

    Returns
    -------
    TriangleMesh, or list of Polyline or Curve
        The boundary of the result, closed, manifold, and oriented like the shape: a `TriangleMesh` for shapes in space,
        a list of `Polyline` for those in the plane, and a list of `Curve` for curves on a surface.

    Raises
    ------
    SignedHeatError
        If the distance is not a finite nonnegative number.
    SourceError
        If the shape does not fit the domain.
    UnsupportedTypeError
        If a resolution is given beside a domain.
    OutsideError
        If the result is empty, or leaves the domain.

    See Also
    --------
    morphology.dilate : Grow by a distance.
    morphology.opening : Shrink, then grow.
    offset : The closed surface at a distance.

    Examples
    --------
    >>> from signedheat import samples
    >>> ball = samples.sphere(3)
    >>> bool(abs(np.linalg.norm(erode(ball, 0.5, resolution=48).vertices, axis=1) - 0.5).max() < 0.02)
    True
    """
    return _offsets(shape, distance, (-1,), domain, resolution, measure)


@_by_kind_of_shape
def opening(
    shape: Sources,
    distance: float,
    domain: Domain | None = None,
    *,
    resolution: int | None = None,
    measure: Measure = None,
) -> Boundary:
    """Erode a shape, then dilate it, which removes parts thinner than twice the distance and rounds convex corners.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh, PointCloud; in the plane Polyline; on a surface Curve; or a sequence of them
        The shape, which may be broken. Its inside is where `signedheat.signed_distance` is negative.
    distance : float
        How far the boundary moves inward, and then outward, in the units of the shape; not negative.
    domain : Grid, TetMesh, TriangleMesh or any other domain, optional
        Domain on which the signed distance is computed. By default, a grid around the shape with room for the result.
        Curves need the surface that they lie on.
    resolution : int, optional
        Number of nodes along the longest side of the default grid; 128 by default.
    measure : callable, optional
        Called as ``measure(shape, domain)``, it returns the `Field` of signed distance whose level sets are the
        offsets, for the shape and for its first offset. By default `signed_distance`.

    Returns
    -------
    TriangleMesh, or list of Polyline or Curve
        The boundary of the result, closed, manifold, and oriented like the shape: a `TriangleMesh` for shapes in space,
        a list of `Polyline` for those in the plane, and a list of `Curve` for curves on a surface.

    Raises
    ------
    SignedHeatError
        If the distance is not a finite nonnegative number.
    SourceError
        If the shape does not fit the domain.
    UnsupportedTypeError
        If a resolution is given beside a domain.
    OutsideError
        If the result is empty, or leaves the domain.

    See Also
    --------
    morphology.closing : Grow, then shrink.
    morphology.erode : Shrink by a distance.

    Examples
    --------
    >>> bar = Polyline([[0, 0], [0, 1], [1, 1], [1, 0.5], [4, 0.5], [4, 0]], closed=True)
    >>> [opened] = opening(bar, 0.3)  # removes what is 0.5 wide
    >>> bool(opened.points[:, 0].max() < 1.1)
    True
    """
    return _offsets(shape, distance, (-1, 1), domain, resolution, measure)


@_by_kind_of_shape
def closing(
    shape: Sources,
    distance: float,
    domain: Domain | None = None,
    *,
    resolution: int | None = None,
    measure: Measure = None,
) -> Boundary:
    """Dilate a shape, then erode it, which fills gaps narrower than twice the distance and rounds concave corners.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh, PointCloud; in the plane Polyline; on a surface Curve; or a sequence of them
        The shape, which may be broken. Its inside is where `signedheat.signed_distance` is negative.
    distance : float
        How far the boundary moves outward, and then inward, in the units of the shape; not negative.
    domain : Grid, TetMesh, TriangleMesh or any other domain, optional
        Domain on which the signed distance is computed. By default, a grid around the shape with room for the result.
        Curves need the surface that they lie on.
    resolution : int, optional
        Number of nodes along the longest side of the default grid; 128 by default.
    measure : callable, optional
        Called as ``measure(shape, domain)``, it returns the `Field` of signed distance whose level sets are the
        offsets, for the shape and for its first offset. By default `signed_distance`.

    Returns
    -------
    TriangleMesh, or list of Polyline or Curve
        The boundary of the result, closed, manifold, and oriented like the shape: a `TriangleMesh` for shapes in space,
        a list of `Polyline` for those in the plane, and a list of `Curve` for curves on a surface.

    Raises
    ------
    SignedHeatError
        If the distance is not a finite nonnegative number.
    SourceError
        If the shape does not fit the domain.
    UnsupportedTypeError
        If a resolution is given beside a domain.
    OutsideError
        If the result is empty, or leaves the domain.

    See Also
    --------
    morphology.opening : Shrink, then grow.
    morphology.dilate : Grow by a distance.

    Examples
    --------
    >>> gap = [Polyline([[x, 0], [x, 1], [x + 1, 1], [x + 1, 0]], closed=True) for x in (0, 1.2)]
    >>> len(gap), len(closing(gap, 0.2))  # joins parts that are 0.2 apart
    (2, 1)
    """
    return _offsets(shape, distance, (1, -1), domain, resolution, measure)


@public_call
def offset(
    shape: Shapes,
    distance: float | ArrayLike | Reach,
    *,
    corners: Corners = "round",
    resolution: int = RESOLUTION,
    spacing: ArrayLike | None = None,
    progress: Progress | None = None,
) -> TriangleMesh:
    """Extract the offset surface of a shape, at a distance that may vary over it, with round or mitred edges.

    Parameters
    ----------
    shape : shape, several, or Solid
        A shape, broken or not. It is completed first, unless it is a solid.
    distance : float, (n,) float or callable
        Distance of the surface from the shape, positive outside and negative inside, in the units of the shape. An
        array has one for each vertex of a mesh, interpolated linearly, or for each point of a cloud. A function takes
        (n, 3) points on the shape and returns (n,) distances. The grid has room for its values at the vertices and at
        some thousand points between them.
    corners : {"round", "mitre", "sharp"}
        Shape of edges where offset faces move apart. With "round", edges are rounded at the distance. Otherwise the
        offset planes of the faces are extended, up to twice the distance with "mitre", which keeps the edges of boxes,
        or up to ten times with "sharp".
    resolution : int
        Number of nodes along the longest side of the grid on which the surface is found, 128 by default. It lies around
        the box of the completed shape, grown by the largest distance, with a fifth of the longest side as padding. With
        "mitre" and "sharp", its cells have the same size, and it has room for the longest mitres instead.
    spacing : float or (3,) float, optional
        Size of the grid's cells, in the units of the shape; by default it follows from `resolution`.
    progress : callable, optional
        Called as ``progress(fraction, step)`` with the fraction done, from 0 to 1, and the name of the step that
        begins. An exception that it raises cancels.

    Returns
    -------
    TriangleMesh
        A closed manifold mesh without self-intersections, with normals that point away from the inside, and vertices on
        sharp edges and at corners of the surface.

    Raises
    ------
    OutsideError
        If the surface passes through no cell of the grid.
    SignedHeatError
        If a distance is not finite, or an array does not have one distance for each vertex.

    See Also
    --------
    Solid.surface : The closed surface.
    morphology.shell : The layer between two offsets.
    morphology.thicken : Make a solid of an open sheet.
    morphology.dilate : Grow by a distance.

    Examples
    --------
    >>> from signedheat import samples
    >>> grown = offset(samples.sphere(4), lambda points: 0.2 + 0.1 * points[:, 2], resolution=40)
    >>> grown.bounds[:, 2].round(2).tolist()
    [-1.1, 1.3]
    """
    chosen(corners, Corners, "corners")
    solid = complete(shape)
    reach: float | Reach
    if callable(distance):
        reach = checked_reach(distance)
        between = sampled(Pieces(solid.triangles, np.zeros(len(solid.triangles), dtype=np.int64)), CONTOUR_POINTS)[1]
        largest = float(reach(np.concatenate([solid.triangles.reshape(-1, 3), between])).max())
    elif (values := numbers(distance, "distance", SignedHeatError)).ndim:
        reach, largest = checked_reach(_linear(shape, values)), float(values.max(initial=0.0))
    else:
        reach = largest = finite_number(distance, "distance")
    sides = np.array([[-1.0], [1.0]])
    grid = Grid.around(solid.bounds + sides * max(largest, 0.0), resolution, None, spacing)
    if MITRE_LIMITS[corners] > 1:  # cells as large as above, so that corners do not change the resolution
        bounds = solid.bounds + sides * MITRE_LIMITS[corners] * max(largest, 0.0)
        grid = Grid.around(bounds, padding=2 * float(grid.spacing.max()), spacing=grid.spacing)
    return sharp_surface(Offset(solid, reach, MITRE_LIMITS[corners]), grid)


@public_call
def shell(
    shape: Shapes,
    inner: float,
    outer: float,
    domain: Grid | None = None,
    *,
    resolution: int | None = None,
    measure: Measure = None,
    keep_outside: bool = False,
    drain: float | None = None,
) -> TriangleMesh:
    """Make a solid wall along a shape, between two of its offsets, where ``inner ≤ φ ≤ outer``.

    φ is the signed distance to the shape, whose holes are closed. Cavities smaller than a ball whose diameter is the
    thickness of the wall are filled. If no point of the shape is deeper than the inner side, the result has no cavity,
    and an `InexactWarning` is issued.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh or PointCloud
        The shape. ``shell(shape, 0, d)`` is a wall on its outside, ``shell(shape, -d, 0)`` on its inside.
    inner, outer : float
        Signed distances of the two sides of the wall from the shape, in its units, with inner < outer.
    domain : Grid, optional
        Grid on which the distance is computed; by default one around the shape with room for the result.
    resolution : int, optional
        Number of nodes along the longest side of the default grid; 128 by default.
    measure : callable, optional
        Called as ``measure(shape, domain)``, it returns the `Field` of signed distance between whose level sets the
        wall lies. By default `signed_distance`.
    keep_outside : bool
        If true, which needs ``outer=0``, the outer side consists of the faces of the shape and of its completion.
    drain : float, optional
        Diameter of a hole, in the units of the shape, from the bottom of the largest cavity straight down (−z). It
        lets liquids and powder out. By default there is no hole.

    Returns
    -------
    TriangleMesh
        The boundary of the wall, closed and manifold, with normals that point out of the wall.

    Raises
    ------
    SignedHeatError
        If inner is not less than outer, one of them is not finite, the wall is thinner than a grid cell, `keep_outside`
        is used with an outer distance other than 0, or there is no cavity to drain.
    GeometryError
        If `keep_outside`, and the faces of the shape do not join with their completion.
    UnsupportedTypeError
        If the domain is not a grid, or a resolution is given beside it.

    See Also
    --------
    offset : The closed surface at a distance.
    morphology.thicken : Make a solid of an open sheet.

    Examples
    --------
    >>> from signedheat import samples
    >>> wall = shell(samples.sphere(3), -0.3, 0.0, resolution=32)
    >>> wall.bounds.round(1).tolist()
    [[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]
    """
    inner, outer = finite_number(inner, "inner"), finite_number(outer, "outer")
    if not inner < outer:
        raise SignedHeatError(
            f"a shell needs inner < outer, not {inner:g} and {outer:g}", remedy="swap them, or make them different"
        )
    if flag(keep_outside, "keep_outside") and outer != 0:
        raise SignedHeatError("the faces of the shape are at distance 0", remedy="leave out keep_outside")
    hole = None if drain is None else positive_number(drain, "drain")
    grid = _grid(_given_or_room(domain, shape, max(abs(inner), abs(outer)), resolution))
    _refuse_thin(grid, outer - inner)
    callback(measure, "measure(shape, domain)")
    field = None if keep_outside and measure is None else (measure or signed_distance)(shape, grid)
    if field is None or keep_outside:
        solid: object = complete(shape) if field is None else field.solid
        if not isinstance(solid, Solid):
            raise SourceError(
                "`measure` returned no distance to a solid with faces", remedy="leave out measure or keep_outside"
            )
        wall = _hollowed(solid.surface(), partial(solid.surface, spacing=grid.spacing), inner)
    else:
        wall = _between_levels(grid, field, inner, outer)
    wall = _without_crumbs(wall, outer - inner)
    return wall if hole is None else _with_drain_hole(wall, hole, float(grid.spacing.max()))


@public_call
def thicken(
    sheet: TriangleMesh | PolygonMesh | Sequence[TriangleMesh | PolygonMesh],
    above: float,
    below: float | None = None,
    domain: Grid | None = None,
    *,
    side: Side = "both",
    faces: ArrayLike | None = None,
    resolution: int | None = None,
) -> TriangleMesh:
    """Make a solid of given thickness around an open surface, with walls perpendicular to it along its boundary.

    Edges of the solid are sharp. The surface is not completed.

    Parameters
    ----------
    sheet : TriangleMesh or PolygonMesh
        A surface, with boundary or not. If both sides get the same thickness, its orientation does not matter.
    above : float
        Thickness on each side, in the units of the sheet.
    below : float, optional
        Thickness behind the faces, in the units of the sheet, if it differs. Then `above` is the thickness on the side
        of the normals only.
    domain : Grid, optional
        Grid on which the solid is computed; by default one around the sheet with room for the result.
    side : {"outside", "inside", "both"}
        The side to thicken if `below` is left out. "outside" is the side of the normals, "inside" that behind the
        faces.
    faces : (k,) int or (m,) bool, optional
        Ids of the faces to thicken, or a boolean for each face; all by default. To add material to some faces of a
        part, write ``complete(part) | complete(thicken(part, 0.2, side="outside", faces=ids))``.
    resolution : int, optional
        Number of nodes along the longest side of the default grid; 128 by default. The solid should be at least
        two cells thick.

    Returns
    -------
    TriangleMesh
        The boundary of the solid, closed and manifold, with normals that point out of it.

    Raises
    ------
    SignedHeatError
        If a thickness is negative or not finite, both are zero, or the solid is thinner than a grid cell.
    UnsupportedTypeError
        If the domain is not a grid, or a resolution is given beside it.

    See Also
    --------
    morphology.shell : The layer between two offsets.
    wall_thickness : How thick walls are.
    offset : The closed surface at a distance.

    Examples
    --------
    >>> sheet = TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> np.abs(thicken(sheet, 0.1, side="outside", resolution=40).bounds).round(6).tolist()
    [[0.0, 0.0, 0.0], [1.0, 1.0, 0.1]]
    """
    above = finite_number(above, "above", least=0)
    chosen(side, Side, "side")
    if below is not None and side != "both":
        raise SignedHeatError("side must be both if `below` is given", element="side", remedy="leave out one of them")
    if below is None:
        above, below = above if side != "inside" else 0.0, above if side != "outside" else 0.0
    below = finite_number(below, "below", least=0)
    reach = max(above, below)
    if reach == 0:
        raise SignedHeatError("a sheet of thickness 0 has no inside", remedy="give a thickness above 0")
    if faces is not None:
        sheet = _chosen(sheet, faces)
    grid = _grid(_given_or_room(domain, sheet, reach, resolution))
    _refuse_thin(grid, above + below)
    wall = SheetWall.around(sheet, grid, above, below)
    return contour(wall.depths, [grid.origin, grid.upper], grid.spacing)


def _chosen(sheet: object, faces: ArrayLike) -> TriangleMesh | PolygonMesh:
    """Return the mesh of some faces of a sheet, given by (k,) ids or by a boolean for each face."""
    sheet = converted(sheet)
    if not isinstance(sheet, TriangleMesh | PolygonMesh):
        raise SourceError("faces can be chosen for a single mesh only", element="faces", remedy="pass it alone")
    n = sheet.n_faces if isinstance(sheet, TriangleMesh) else sheet.n_polygons
    given = array_of(faces, "faces", SourceError)
    ids = np.flatnonzero(given) if given.dtype == bool and given.shape == (n,) else given.ravel()
    if not len(ids) or ids.dtype.kind not in "iu" or ids.min() < 0 or ids.max() >= n:
        raise SourceError(
            f"faces must be face numbers from 0 to {n - 1}, or one boolean for each face", element="faces"
        )
    if isinstance(sheet, TriangleMesh):
        return TriangleMesh(sheet.vertices, sheet.faces[ids])
    polygons = list(sheet.polygons)
    return PolygonMesh(sheet.vertices, [polygons[k] for k in ids])


def _linear(shape: Shapes, values: Floats) -> Reach:
    """Return a function that interpolates distances given at vertices.

    It takes (k, 3) points on a mesh with (n,) values at its vertices, and returns (k,) linearly interpolated values.
    For a point cloud, it returns the value of the nearest point.
    """
    mesh = shape.source if isinstance(shape, Solid) else as_shape(shape)  # type: ignore[arg-type]
    if not isinstance(mesh, TriangleMesh | PolygonMesh | DigitalSurface | PointCloud):
        raise UnsupportedTypeError(
            f"a {type(shape).__name__} has no vertices at which to give distances",
            remedy="pass one mesh, or a function of points",
            element="distance",
        )
    points = mesh.points if isinstance(mesh, PointCloud) else mesh.vertices
    if values.shape != (len(points),) or not np.isfinite(values).all():
        raise SignedHeatError(
            f"there are {counted(len(points), 'vertex')}, and distances of shape {values.shape}, or not all are finite",
            remedy="give one for each",
            element="distance",
        )
    if isinstance(mesh, PointCloud):
        tree = PointTree(points)
        return lambda positions: values[tree.query(positions)[1]]
    if not isinstance(mesh, TriangleMesh):
        values, mesh = mesh.on_triangulation(values), mesh.triangulation
    vertices, corners = mesh.vertices, mesh.faces
    faces = FaceTree.of(FaceFeatures.of(vertices, corners))

    def interpolated(positions: Floats) -> Floats:
        nearest = faces.search(positions)
        ids = corners[faces.features.ids[nearest.faces]]
        return (weights_in(vertices[ids], nearest.places) * values[ids]).sum(axis=1)

    return interpolated


def _between_levels(grid: Grid, field: Field[Any], inner: float, outer: float) -> TriangleMesh:
    """Return the surface of what lies between two level sets of a field on a grid, closed where the grid cuts it."""
    values = field.values
    if (grid._values_at_walls(values) < 0.0).any():  # the grid cuts the shape: a contour ends at its walls
        if not (values < inner).any():
            _warn_not_hollow(inner)
        return cast("TriangleMesh", Field(grid, np.maximum(inner - values, values - outer)).offset(0.0))
    return _hollowed(field.offset(outer), field.offset, inner)


def _hollowed(wall: TriangleMesh, level: Callable[[float], object], inner: float) -> TriangleMesh:
    """Return a closed surface with the one at the distance `inner` in it as a cavity, or warn if there is none.

    ``level(inner)`` returns the surface at that distance, and raises `OutsideError` if nothing is that deep.
    """
    try:
        inside = cast("TriangleMesh", level(inner))
    except OutsideError:
        _warn_not_hollow(inner)
        return wall
    return TriangleMesh(*concatenated([(wall.vertices, wall.faces), (inside.vertices, inside.faces[:, ::-1])]))


def _warn_not_hollow(inner: float) -> None:
    """Warn that no point of a shape is as deep as the inner side of a shell, at the signed distance `inner`."""
    warn_user(
        f"the shape is not hollowed: no point of it is {-inner:g} deep at the resolution of the grid. Use a wall "
        "thinner than half of the part",
        InexactWarning,
    )


def _without_crumbs(wall: TriangleMesh, thickness: float) -> TriangleMesh:
    """Remove cavities smaller than a ball whose diameter is the thickness of the wall."""
    parts, volumes = part_volumes(wall.vertices, wall.faces)
    crumbs = (volumes < 0) & (volumes > -np.pi / 6 * thickness**3)
    if not crumbs.any():
        return wall
    used, faces = np.unique(wall.faces[~crumbs[parts]], return_inverse=True)
    return TriangleMesh(wall.vertices[used], faces.reshape(-1, 3))


def _with_drain_hole(wall: TriangleMesh, diameter: float, cell: float) -> TriangleMesh:
    """Return a wall with a round hole from the bottom of its largest cavity straight down to the outside.

    The hole is a prism along −z of the given diameter. It is added with faces inwards, which subtracts it. It begins
    where the bottom of the cavity is widest, up to differences of a millionth of a grid `cell`.
    """
    parts, volumes = part_volumes(wall.vertices, wall.faces)
    if not volumes.min() < 0:
        raise SignedHeatError("the wall has no cavity to drain", remedy="leave out drain, or make the wall thinner")
    radius = 0.5 * diameter
    cavity = wall.vertices[np.unique(wall.faces[parts == volumes.argmin()])]
    low, high = cavity[:, 2].min(), cavity[:, 2].max()
    lift = min(radius, 0.5 * (high - low))
    bottom = cavity[cavity[:, 2] <= low + 0.5 * lift]
    room = complete(wall, as_oriented=True).distance(np.column_stack([bottom[:, :2], np.full(len(bottom), low + lift)]))
    x, y = bottom[np.argmax(np.round(room / cell, 6)), :2]  # the first of equally wide places
    angles = 2 * np.pi * np.arange(DRAIN_SIDES) / DRAIN_SIDES
    rim = Polyline(np.column_stack([x + radius * np.cos(angles), y + radius * np.sin(angles)]), closed=True)
    foot = wall.bounds[0, 2] - diameter
    prism = extrude(rim, low + lift - foot)
    both = concatenated(
        [(wall.vertices, wall.faces), (prism.vertices + np.array([0.0, 0.0, foot]), prism.faces[:, ::-1])]
    )
    solid = complete(TriangleMesh(*both), as_oriented=True)
    return solid.surface()


def _offsets(
    shape: Sources,
    distance: float,
    signs: tuple[int, ...],
    domain: Domain | None,
    resolution: int | None,
    measure: Measure,
) -> Boundary:
    """Offset a shape once for each of the signs, outward for 1 and inward for −1, computing the distance each time."""
    distance = finite_number(distance, "distance", least=0)
    callback(measure, "measure(shape, domain)")
    domain = _given_or_room(domain, shape, distance if 1 in signs else 0.0, resolution)
    for sign in signs:
        field = (measure or signed_distance)(shape, domain)
        level = sign * distance
        shape = boundary = field.offset(level)
    return boundary


def _given_or_room(domain: Domain | None, shape: Sources, reach: float, resolution: int | None) -> Domain:
    """Return the domain or, if it is None, a grid around the shape with room for offsets up to `reach`."""
    if domain is not None:
        refuse_beside("a domain", resolution=resolution)
        return domain
    shapes: list[Source | Sequence[CurveOrPoints]] = as_list(shape)
    if any(isinstance(part, Curve) for part in shapes):
        raise SourceError("a Curve lies on a surface", remedy="pass that surface as the domain")
    bounds = bounds_around(shapes)
    nodes = RESOLUTION if resolution is None else resolution
    return Grid.around(bounds, nodes, room_around(bounds, reach, share=0.15))


def _grid(domain: object) -> Grid[Literal[3]]:
    """Return the domain if it is a grid in space, else raise an error."""
    if not isinstance(domain, Grid):
        raise UnsupportedTypeError(
            f"walls are made on a Grid, not on a {type(domain).__name__}", remedy="leave the domain out, or pass one"
        )
    if domain.dimension != 3:
        raise SourceError(
            f"a wall lies in 3 dimensions, and the grid in {domain.dimension}",
            remedy="leave the domain out, or pass a grid in space",
        )
    return cast("Grid[Literal[3]]", domain)


def _refuse_thin(grid: Grid[Literal[3]], thickness: float) -> None:
    """Raise an error if a wall is thinner than the largest side of a grid cell."""
    cell = float(grid.spacing.max())
    if thickness < cell:
        nodes = int(np.ceil(max(grid.shape) * 2 * cell / thickness))
        raise SignedHeatError(
            f"a wall of thickness {thickness:g} is thinner than a cell of {cell:g}",
            remedy=f"raise the resolution to {nodes}, or give a grid with cells of {0.5 * thickness:g}",
        )
