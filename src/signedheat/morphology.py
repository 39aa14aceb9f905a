"""Morphological operations on broken shapes: successive offsets of their signed distance (Sec. 9.3.1).

Also the smooth unions, intersections and differences of fields.

Every step recomputes the distance, since the distance to an offset equals that to the shape, up to a constant, on one
side only.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal, Protocol, TypeAlias, cast, overload

import numpy as np
from numpy.typing import NDArray

from .domains.curves import Curve, CurveOrPoints, CurvesAndPoints
from .domains.grid import Grid, room_around
from .domains.kinds import Domain, Polylines, Shapes, Source, Sources, SurfaceDomain
from .domains.polygon_mesh import PolygonMesh
from .domains.polyline import Polyline
from .domains.tet_mesh import TetMesh
from .domains.triangle_mesh import TriangleMesh
from .domains.validation import finite_number
from .errors import SignedHeatError, SourceError, UnsupportedTypeError
from .fields.booleans import smooth_difference, smooth_intersection, smooth_union
from .fields.grid_field import GridField
from .fields.to_field import Field
from .fields.vertex_field import VertexField
from .geometry.face_features import FaceFeatures
from .geometry.face_tree import FaceTree
from .lowering.area_elements import area_elements, bounds_around
from .lowering.grid.discretization import refuse_beyond_memory
from .sharpening.sharpen import sharpen
from .signed_distance import signed_distance
from .solver import SignedHeatSolver, as_list

__all__ = [
    "closing",
    "dilate",
    "erode",
    "opening",
    "shell",
    "smooth_difference",
    "smooth_intersection",
    "smooth_union",
    "thicken",
]

RESOLUTION = 128
ROOM = 0.15
"""Share of its longest side by which a shape is padded, besides what its offsets take."""
BYTES_PER_NODE = 31.0
"""Measured: what each node of a grid takes where a sheet is thickened."""

Boundary: TypeAlias = TriangleMesh | list[Polyline] | list[Curve]
"""The boundary of a result, of the same kind as the shape."""
Measure: TypeAlias = Callable[[Sources, Domain], Field]
"""Called as ``measure(shape, domain)`` for the distance whose level sets are the offsets."""


class _Morphology(Protocol):
    """The signature of `dilate`, `erode`, `opening` and `closing`."""

    @overload
    def __call__(
        self,
        shape: Shapes,
        distance: float,
        domain: Grid | TetMesh | None = None,
        *,
        resolution: int = ...,
        measure: Measure | None = ...,
    ) -> TriangleMesh: ...
    @overload
    def __call__(
        self,
        shape: Polylines,
        distance: float,
        domain: Grid | None = None,
        *,
        resolution: int = ...,
        measure: Measure | None = ...,
    ) -> list[Polyline]: ...
    @overload
    def __call__(
        self,
        shape: CurvesAndPoints,
        distance: float,
        domain: SurfaceDomain,
        *,
        resolution: int = ...,
        measure: Measure | None = ...,
    ) -> list[Curve]: ...


def _by_kind_of_shape(function: Callable[..., Boundary]) -> _Morphology:
    return cast("_Morphology", function)


@_by_kind_of_shape
def dilate(
    shape: Sources,
    distance: float,
    domain: Domain | None = None,
    *,
    resolution: int = RESOLUTION,
    measure: Measure | None = None,
) -> Boundary:
    """Dilate a shape: offset it outward by a distance.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh, PointCloud; in the plane Polyline; on a surface Curve; or a sequence of them
        The shape, which may be broken. Inside is where φ < 0: behind the normals, or to the right of curves.
    distance : float
        The offset, in the units of the shape; not negative.
    domain : Grid, TetMesh, TriangleMesh or any other domain, optional
        Where the distance is computed; by default on a grid around the shape with room for the result.
    resolution : int
        Number of nodes along the longest side of that default grid.
    measure : callable, optional
        Called as ``measure(shape, domain)`` in place of `signed_distance`, to choose its options:
        ``partial(signed_distance, keep_overlaps=True)``.

    Returns
    -------
    TriangleMesh, or list of Polyline or Curve
        The new boundary: closed, manifold, oriented like the shape.

    Raises
    ------
    SignedHeatError
        If the distance is not a finite nonnegative number.
    SourceError
        If the shape does not fit the domain.
    OutsideError
        If the result is empty, or leaves the domain.

    Examples
    --------
    >>> from signedheat import samples
    >>> ball = samples.sphere(3)
    >>> bool(abs(np.linalg.norm(dilate(ball, 0.5, resolution=32).vertices, axis=1) - 1.5).max() < 0.02)
    True
    """
    distance = finite_number(distance, "the distance", least=0)
    return _offsets(shape, (distance,), domain, resolution, measure)


@_by_kind_of_shape
def erode(
    shape: Sources,
    distance: float,
    domain: Domain | None = None,
    *,
    resolution: int = RESOLUTION,
    measure: Measure | None = None,
) -> Boundary:
    """Erode a shape: offset it inward by a distance. Parameters, result and errors are those of `dilate`.

    Examples
    --------
    >>> from signedheat import samples
    >>> ball = samples.sphere(3)
    >>> bool(abs(np.linalg.norm(erode(ball, 0.5, resolution=48).vertices, axis=1) - 0.5).max() < 0.02)
    True
    """
    distance = finite_number(distance, "the distance", least=0)
    return _offsets(shape, (-distance,), domain, resolution, measure)


@_by_kind_of_shape
def opening(
    shape: Sources,
    distance: float,
    domain: Domain | None = None,
    *,
    resolution: int = RESOLUTION,
    measure: Measure | None = None,
) -> Boundary:
    """Erode, then dilate: removes parts thinner than twice the distance, rounds convex corners. See `dilate`."""
    distance = finite_number(distance, "the distance", least=0)
    return _offsets(shape, (-distance, distance), domain, resolution, measure)


@_by_kind_of_shape
def closing(
    shape: Sources,
    distance: float,
    domain: Domain | None = None,
    *,
    resolution: int = RESOLUTION,
    measure: Measure | None = None,
) -> Boundary:
    """Dilate, then erode: fills gaps narrower than twice the distance, rounds concave corners. See `dilate`."""
    distance = finite_number(distance, "the distance", least=0)
    return _offsets(shape, (distance, -distance), domain, resolution, measure)


def shell(
    shape: Shapes,
    inner: float,
    outer: float,
    domain: Grid | None = None,
    *,
    resolution: int = RESOLUTION,
    measure: Measure | None = None,
) -> TriangleMesh:
    """The solid between two offsets of a shape, ``inner ≤ φ ≤ outer``: a wall, in which holes of the shape are closed.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh or PointCloud
        The shape. ``shell(shape, 0, d)`` is a wall on its outside, ``shell(shape, -d, 0)`` on its inside.
    inner, outer : float
        Signed distances of the two sides of the wall, inner < outer.
    domain : Grid, optional
        By default a grid around the shape with room for the result.
    resolution : int
        Number of nodes along the longest side of that default grid.
    measure : callable, optional
        As in `dilate`.

    Returns
    -------
    TriangleMesh
        Closed and manifold, normals pointing out of the wall.

    Raises
    ------
    SignedHeatError
        If inner is not less than outer, one of them is not finite, or the wall is thinner than a grid cell.
    UnsupportedTypeError
        If the domain is not a grid.
    """
    inner, outer = finite_number(inner, "the inner distance"), finite_number(outer, "the outer distance")
    if not inner < outer:
        raise SignedHeatError(
            f"a shell needs inner < outer, not {inner:g} and {outer:g}",
            remedy="swap them, or set them apart",
        )
    grid = _grid(_room(shape, max(abs(inner), abs(outer)), resolution) if domain is None else domain)
    phi = (measure or _field)(shape, grid).values
    _refuse_thin(grid, outer - inner)
    return GridField(grid, np.maximum(inner - phi, phi - outer)).offset(0.0)


def thicken(
    sheet: TriangleMesh | PolygonMesh | Sequence[TriangleMesh | PolygonMesh],
    above: float,
    below: float | None = None,
    domain: Grid | None = None,
    *,
    resolution: int = RESOLUTION,
) -> TriangleMesh:
    """A solid around an open surface, with rounded ends at its boundary. Nothing is completed.

    Parameters
    ----------
    sheet : TriangleMesh or PolygonMesh
        A surface with boundary; if `below` equals `above` its orientation does not matter.
    above, below : float
        Thickness on the side that the normals point to, and on the other side; `below` is `above` by default, and 0
        gives a solid on one side only.
    domain : Grid, optional
        By default a grid around the sheet with room for the result.
    resolution : int
        Number of nodes along the longest side of that default grid. The solid should be at least two cells thick.

    Returns
    -------
    TriangleMesh
        Closed and manifold, normals pointing out of the solid.

    Raises
    ------
    SignedHeatError
        If a thickness is negative or not finite, both are zero, or the solid is thinner than a grid cell.
    UnsupportedTypeError
        If the domain is not a grid.
    """
    above = finite_number(above, "the reach above", least=0)
    below = above if below is None else finite_number(below, "the reach below", least=0)
    reach = max(above, below)
    if reach == 0:
        raise SignedHeatError(
            "a sheet thickened by nothing has no inside",
            remedy="give a reach above zero",
        )
    grid = _grid(_room(sheet, reach, resolution) if domain is None else domain)
    _refuse_thin(grid, above + below)
    refuse_beyond_memory(grid, BYTES_PER_NODE)
    depth = _unsigned_distance(sheet, grid) - reach
    if above != below:
        phi = _sided(grid, sheet).values
        depth = np.maximum(depth, np.maximum(phi - above, -below - phi))
    return GridField(grid, depth).offset(0.0)


def _field(shape: Sources, domain: Domain) -> Field:
    """The distance whose level sets are the offsets: that to a solid, where the domain is a grid in space."""
    if isinstance(domain, Grid) and domain.dimension == 3 and domain.mask is None:
        return signed_distance(shape, domain)
    return _sided(domain, shape)


def _sided(domain: Domain, shape: Sources) -> Field:
    """The signed distance to a shape that may have two sides and no inside; on grids sharpened."""
    field = SignedHeatSolver(domain).distance(shape)
    return sharpen(field) if isinstance(field, GridField) else field


def _offsets(
    shape: Sources, distances: tuple[float, ...], domain: Domain | None, resolution: int, measure: Measure | None
) -> Boundary:
    """Successive offsets, each of the distance to the previous one."""
    if domain is None:
        domain = _room(shape, max(0.0, *distances), resolution)
    for distance in distances:
        field = (measure or _field)(shape, domain)
        boundary = field.contour(distance) if isinstance(field, VertexField) else field.offset(distance)
        shape = boundary
    return boundary


def _room(shape: Sources, reach: float, resolution: int) -> Grid:
    """A grid around a shape, with room for offsets."""
    shapes: list[Source | Sequence[CurveOrPoints]] = as_list(shape)
    if any(isinstance(part, Curve) for part in shapes):
        raise SourceError(
            "a Curve lies on a surface",
            remedy="pass that surface as the domain",
        )
    bounds = bounds_around(shapes)
    return Grid.around(bounds, resolution, room_around(bounds, reach, ROOM))


def _grid(domain: object) -> Grid[Literal[3]]:
    if not isinstance(domain, Grid):
        raise UnsupportedTypeError(
            f"walls are made on a Grid, not on a {type(domain).__name__}",
            remedy="leave the domain out, or pass one",
        )
    return cast("Grid[Literal[3]]", domain)


def _refuse_thin(grid: Grid[Literal[3]], thickness: float) -> None:
    cell = float(grid.spacing.max())
    if thickness < cell:
        raise SignedHeatError(
            f"a wall of thickness {thickness:g} slips between nodes {cell:g} apart",
            remedy=f"raise the resolution to {int(np.ceil(max(grid.shape) * 2 * cell / thickness))}",
        )


def _unsigned_distance(sheet: Shapes, grid: Grid[Literal[3]]) -> NDArray[np.float64]:
    """Exact unsigned distance to a surface itself, at the nodes."""
    for part in as_list(sheet):
        if area_elements(part).corners.shape[1:] != (3, grid.dimension):
            raise SourceError(
                f"a sheet has faces in the {grid.dimension} dimensions of the grid, and a "
                f"{type(part).__name__} has none",
                remedy="reconstruct a mesh first",
            )
    corners = np.concatenate([area_elements(part).corners for part in as_list(sheet)]).reshape(-1, 3)
    features = FaceFeatures.of(corners - grid.origin, np.arange(len(corners)).reshape(-1, 3))
    if not len(features.rows):
        raise SourceError("no face of the sheet has any extent", remedy="check its vertices")
    faces = FaceTree.of(features)
    x, y, z = (step * np.arange(n) for step, n in zip(grid.spacing, grid.shape, strict=True))
    plane = np.stack(np.meshgrid(0.0, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    distance = [faces.distances(plane + np.array([along, 0.0, 0.0])) for along in x]
    return np.stack(distance).reshape(grid.shape)
