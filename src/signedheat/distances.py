"""Signed distance to broken shapes in space, to curves on surfaces, and to drawings in the plane."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Literal, cast, get_args, overload

from numpy.typing import ArrayLike

from .constraints import Constraint, EachComponent, Free, LevelValues, Soft, ZeroSet
from .curves.curve_distance import distance_to_curves
from .curves.drawings import distance_to_lines, unsigned_distance_to_lines
from .errors import SourceError, UnsupportedTypeError
from .fields.field import Field
from .fields.sharpening import sharpen
from .grids.grid import Dimension, Grid
from .jobs import Progress, bound_progress, part_of_work
from .mesh.box_tree import room_around
from .mesh.polylines import FillRule
from .shapes.area_elements import bounds_around
from .shapes.foreign import ForeignShape, as_list, as_shapes, converted
from .shapes.kinds import AnySurface, Domain, Polylines, Shapes, Sources, SpaceSources, SurfaceDomain
from .shapes.transforms import joined_shape
from .solids.completion import Completing, Completion, Lids, completed
from .solids.heat_surfaces import Heat
from .solids.mesh_orientation import orient
from .solids.overlaps import Nesting
from .solids.solid import Solid
from .solver import SignedHeatSolver, checked
from .surfaces.extrapolation import Diffusion
from .surfaces.polygon_mesh import PolygonMesh
from .surfaces.surface_curves import Curve, CurvesAndPoints, ElementList, SurfacePoints
from .surfaces.triangle_mesh import TriangleMesh
from .tets.tet_mesh import TetMesh
from .validation import are_points, public_call, refuse_beside

OF_DEFAULT_GRID = ("resolution", "spacing", "padding")
"""Options of `signed_distance` that define the default grid, and are refused if a domain is given."""


@overload
def signed_distance(
    source: Shapes,
    domain: Grid[Literal[3]] | None = None,
    *,
    resolution: int = 128,
    spacing: ArrayLike | None = None,
    padding: float | None = None,
    band: float | None = None,
    completion: Completing = "lids",
    lids: Lids = "bent",
    nested: Nesting = "given",
    constraint: Constraint | None = None,
    diffusion: float = 1.0,
    as_oriented: bool = False,
    keep_overlaps: bool = False,
    progress: Progress | None = None,
) -> Field[Grid[Literal[3]]]: ...
@overload
def signed_distance(
    source: Polylines,
    domain: Grid[Literal[2]] | None = None,
    *,
    resolution: int = 128,
    spacing: ArrayLike | None = None,
    padding: float | None = None,
    completion: Completing = "lids",
    constraint: Constraint | None = None,
    diffusion: Diffusion | None = None,
    fill: FillRule = "nonzero",
    as_oriented: bool = False,
    every_piece: bool = False,
    progress: Progress | None = None,
) -> Field[Grid[Literal[2]]]: ...
@overload
def signed_distance(
    source: SpaceSources,
    domain: Grid[Dimension],
    *,
    band: float | None = None,
    completion: Completing = "lids",
    lids: Lids = "bent",
    nested: Nesting = "given",
    constraint: Constraint | None = None,
    diffusion: float = 1.0,
    as_oriented: bool = False,
    keep_overlaps: bool = False,
    progress: Progress | None = None,
) -> Field[Grid[Dimension]]: ...
@overload
def signed_distance(
    source: Shapes,
    domain: TetMesh,
    *,
    completion: Completing = "lids",
    lids: Lids = "bent",
    nested: Nesting = "given",
    constraint: Constraint | None = None,
    diffusion: float = 1.0,
    as_oriented: bool = False,
    keep_overlaps: bool = False,
    progress: Progress | None = None,
) -> Field[TetMesh]: ...
@overload
def signed_distance(
    source: CurvesAndPoints | ElementList | Sequence[ElementList],
    domain: AnySurface,
    *,
    completion: Completing = "lids",
    constraint: Free | ZeroSet | Soft | None = None,
    diffusion: float = 1.0,
    intrinsic: bool | Literal["auto"] = "auto",
    as_oriented: bool = False,
    every_piece: bool = False,
    progress: Progress | None = None,
) -> Field[AnySurface]: ...
@overload
def signed_distance(
    source: Sources,
    domain: Domain | ForeignShape | None,
    *,
    constraint: Constraint | None = None,
    diffusion: float = 1.0,
    progress: Progress | None = None,
) -> Field: ...
@public_call
def signed_distance(
    source: Sources | ElementList | Sequence[ElementList],
    domain: Domain | ForeignShape | None = None,
    *,
    resolution: int | None = None,
    spacing: ArrayLike | None = None,
    padding: float | None = None,
    band: float | None = None,
    completion: Completing = "lids",
    lids: Lids = "bent",
    nested: Nesting = "given",
    fill: FillRule = "nonzero",
    constraint: Constraint | None = None,
    diffusion: Diffusion | None = None,
    intrinsic: bool | Literal["auto"] = "auto",
    as_oriented: bool = False,
    keep_overlaps: bool = False,
    every_piece: bool = False,
    progress: Progress | None = None,
) -> Field:
    """Compute the signed distance to a broken shape, which is exact up to the completion of missing parts.

    * Shapes in space are completed (`complete`). Distance is measured to the given faces and to the completion.
    * Closed outlines in the plane are filled.
    * Curves on a surface, and other drawings in the plane, are flipped so that they bound something together. Those
      that bound nothing are left out, and the zero set of the signed heat method closes gaps. On a surface, distance is
      measured along it.

    `SignedHeatSolver` runs the signed heat method alone.

    Parameters
    ----------
    source : shape, curves or polylines; or a sequence of them
        In space, a `Solid`, `TriangleMesh`, `PolygonMesh`, `TetMesh` or `PointCloud`, with normals or without, an
        object of trimesh, PyVista, meshio or Open3D, or a pair (vertices, faces). On a surface, `Curve` and
        `SurfacePoints`, or lists of (element, barycentric coordinates), as in potpourri3d. In the plane, `Polyline`.
    domain : Grid, TetMesh or surface, optional
        Domain of the field. By default, a grid of cubic cells around the shape or drawing. Curves need their surface,
        a `TriangleMesh`, `PolygonMesh`, `PointCloud`, `DigitalSurface` or `IntrinsicTriangulation`.
    resolution : int
        Number of nodes along the longest side of the default grid; 128 by default.
    spacing : float or (d,) float, optional
        Distance between nodes of the default grid, in the units of the shape, in place of `resolution`.
    padding : float, optional
        Room between the shape and the sides of the default grid, in units of the shape; by default a fifth of its
        longest side.
    band : float, optional
        In space, compute only nodes of the grid whose distance is at most this length, in the units of the shape. By
        default all nodes are computed.
    completion, lids, nested : str
        In space, options of `complete`; by default "lids", "bent" and "given". With ``completion="none"``, also on
        surfaces and in the plane, nothing is completed and distance is unsigned. That suits clothes and networks of
        curves.
    constraint : Free, ZeroSet or Soft, optional
        Constraint on φ, the field, at the source, if the signed heat method is used; by default `ZeroSet`.
    diffusion : float, optional
        Factor τ of the time ``t = τ h²`` for which the signed heat method diffuses normals of the source like heat,
        with h the size of cells or triangles; 1 by default. Larger values close gaps more roundly.
    fill : {"nonzero", "evenodd"}
        In the plane, the filling rule of closed outlines, as in SVG.
    as_oriented : bool
        If true, no face or curve is flipped, no outline is filled, and no curve is left out.
    keep_overlaps : bool
        In space, whether to keep surfaces that lie inside other bodies. By default they are left out.
    every_piece : bool
        On surfaces and in the plane, whether to keep curves that bound nothing. By default they are left out.
    intrinsic : "auto", True or False
        On surfaces, whether to use an intrinsic triangulation, as for `SignedHeatSolver`. With "auto", the default, it
        is used if large angles or thin triangles would make distance inaccurate.
    progress : callable, optional
        Called as ``progress(fraction, step)`` with the fraction done, from 0 to 1, and the name of the step that
        begins. An exception that it raises cancels.

    Returns
    -------
    Field
        Signed distance φ in the units of the source. It is negative inside shapes and filled outlines, and to the right
        of curves and strokes. It is positive on both sides of sheets, which bound nothing. ``diagnostics.notes`` say
        what was flipped, left out and completed.

    Raises
    ------
    SourceError
        If there is no source, or it does not fit the domain.
    ConstraintError
        If the constraint gives curves different levels.
    GeometryError
        If resolution, spacing and padding do not define a grid.
    MemoryLimitError
        If the grid does not fit in memory. This is checked after the completion, before the field is allocated.
    UnsupportedTypeError
        If an option does not apply to this kind of source, or to a domain that is given.

    See Also
    --------
    complete : Make a solid of a broken shape.
    Solid.distance : Exact distance of points.
    SignedHeatSolver : The signed heat method alone.
    piecewise_distance : Distance to curves that bound no region.
    redistance : Distance from an array of values or signs.

    Examples
    --------
    Two overlapping balls, which are united:

    >>> import numpy as np
    >>> import signedheat as sh
    >>> from signedheat import samples
    >>> ball, other = samples.sphere(3), samples.sphere(3, center=(1.0, 0, 0))
    >>> field = sh.signed_distance(samples.union(ball, other), resolution=32)
    >>> bool(np.abs(field([[0.5, 0, 0]]) + np.sqrt(0.75)) < 0.05)
    True

    A line across a square of two triangles, which is not a level set of a function linear on them:

    >>> mesh = sh.TriangleMesh([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> sh.signed_distance(mesh.polyline([[1, 0, 0], [1, 4, 0]]), mesh).values.round(6).tolist()
    [1.0, -3.0, -3.0, 1.0]

    A drawing in the plane:

    >>> square = sh.Polyline([[0, 0], [0, 1], [1, 1], [1, 0]], closed=True)
    >>> sh.signed_distance(square, resolution=33)([[0.5, 0.75]]).round(2).tolist()
    [-0.25]
    """
    given = locals()  # before there are any others
    options = {name: given[name] for name, default in DEFAULTS.items() if not is_default(given[name], default)}
    domain = cast("Domain | None", converted(domain))
    measure = _measure(source, domain)
    if isinstance(completion, str) and completion == "none":
        if measure is distance_to_lines:
            measure = unsigned_distance_to_lines
        elif measure is distance_to_curves:
            source, options = _without_sides(source), {name: options[name] for name in options if name != "completion"}
    parameters = inspect.signature(measure).parameters.values()
    accepted = [parameter.name for parameter in parameters if parameter.kind is parameter.KEYWORD_ONLY]
    if domain is not None:
        accepted = [name for name in accepted if name not in OF_DEFAULT_GRID]
        refuse_beside("a domain", **{name: options.pop(name, None) for name in OF_DEFAULT_GRID})
    for option in options:
        if option not in accepted:
            raise UnsupportedTypeError(
                f"{option} is not an option here",
                remedy=f"the options are {', '.join([*accepted, 'progress'])}",
                element=option,
            )
    return measure(source, domain, **options)


DEFAULTS = {
    parameter.name: parameter.default
    for parameter in inspect.signature(signed_distance).parameters.values()
    if parameter.kind is parameter.KEYWORD_ONLY and parameter.name != "progress"
}
"""Options of `signed_distance` with their defaults. An option that differs from its default is refused if it does not
apply to the kind of source."""


def is_default(value: object, default: object) -> bool:
    """Whether an option was left out, or given as its default is; arrays, which compare by element, were not."""
    return value is default or (type(value) is type(default) and isinstance(value, str | float) and value == default)


def distance_to_solid(
    solid: Solid,
    domain: Grid | TetMesh | None = None,
    *,
    resolution: int | None = None,
    spacing: ArrayLike | None = None,
    padding: float | None = None,
    band: float | None = None,
) -> Field[Grid] | Field[TetMesh]:
    """Compute the signed distance to a solid on a grid or on tets, with the options of `signed_distance`."""
    if domain is None or isinstance(domain, Grid):
        return solid.field(
            resolution, spacing=spacing, padding=padding, grid=domain, band=band, progress=bound_progress()
        )
    return completed_distance(solid, domain, Completion(), Heat(), band)


def is_plain(plain: bool, method: Heat) -> bool:
    """Whether the signed heat method runs without completion.

    It does if `plain`, or if the constraint allows levels other than zero on the shape.
    """
    return plain or isinstance(method.constraint, EachComponent | LevelValues)


def measured_distance(
    shape: Any,
    domain: Grid | TetMesh,
    options: Completion,
    method: Heat,
    plain: bool,
    **in_band: Any,
) -> Any:
    """Return the field of the signed distance to a shape or to lines on a grid or on tets.

    If `is_plain`, it is that of the signed heat method alone, after the faces of a mesh have been oriented. `in_band`
    are further options of `completed_distance`.
    """
    if is_plain(plain, method):
        if isinstance(shape, TriangleMesh | PolygonMesh) and not options.as_oriented:
            shape = orient(shape)
        return SignedHeatSolver[Any](domain, method.diffusion, bound_progress()).distance(shape, method.constraint)
    if isinstance(domain, Grid) and domain.dimension == 2:
        if options.completion == "none":
            return unsigned_distance_to_lines(shape, domain)
        return distance_to_lines(shape, domain, **vars(method), as_oriented=options.as_oriented)
    return completed_distance(shape, domain, options, method, **in_band)


def grid_around(
    shape: Any, reach: float, resolution: int, padding: float | None, spacing: ArrayLike | None = None
) -> Grid:
    """Make a grid around one or several shapes, by default with room for offsets up to `reach`."""
    bounds = bounds_around(as_list(shape))
    return Grid.around(bounds, resolution, room_around(bounds, reach) if padding is None else padding, spacing)


def _measure(source: object, domain: Domain | None) -> Callable[..., Field]:
    """Return the function that computes distance to this kind of source on this kind of domain; raise if none does."""
    _refuse_points(source, domain)
    sources = as_shapes(source)
    if isinstance(domain, Grid):
        _refuse_other_dimension(sources, domain)
    if isinstance(source, Solid) and (domain is None or isinstance(domain, Grid | TetMesh)):
        return distance_to_solid
    if domain is None:
        if any(isinstance(part, Curve | SurfacePoints) for part in sources):
            raise SourceError("curves lie on a surface", remedy="pass it: signed_distance(curves, surface)")
        in_space = not sources or any(not hasattr(part, "bounds") or part.bounds.shape[1] == 3 for part in sources)
        return distance_to_shapes if in_space else distance_to_lines
    if not isinstance(domain, (Grid, TetMesh, *get_args(SurfaceDomain))):
        raise UnsupportedTypeError(
            f"distance is not measured on a {type(domain).__name__}",
            remedy="pass the source first, then the grid, the tets or the surface",
            element="domain",
        )
    if isinstance(domain, Grid):
        return distance_to_shapes if domain.dimension == 3 else distance_to_lines
    return distance_to_shapes if isinstance(domain, TetMesh) else distance_to_curves


def _without_sides(source: Any) -> Any:
    """Make curves, also in nested sequences, unoriented, so that distance to them has no sign; return others as is."""
    if isinstance(source, Curve):
        return Curve(source.faces, source.barycentric, source.closed, oriented=False)
    if isinstance(source, Sequence) and all(isinstance(item, Curve | SurfacePoints | Sequence) for item in source):
        return [_without_sides(item) for item in source]
    return source


def _refuse_points(source: object, domain: object) -> None:
    """Raise an error if the arguments of `signed_distance` are points and a shape, in either order."""
    for points, shape in ((source, domain), (domain, source)):
        if are_points(points) and isinstance(converted(shape), TriangleMesh | PolygonMesh | Solid):
            raise UnsupportedTypeError(
                "signed_distance computes a field, not the distance of points",
                remedy="for points use sh.complete(mesh).distance(points)",
                element="domain" if points is domain else "source 0",
            )


def _refuse_other_dimension(sources: Sequence[Any], grid: Grid) -> None:
    """Raise an error if a source does not have as many dimensions as a grid has axes."""
    for index, source in enumerate(sources):
        dimension = source.bounds.shape[1] if hasattr(source, "bounds") else grid.dimension
        if dimension != grid.dimension:
            raise SourceError(
                f"the grid has {grid.dimension} axes, and source {index}, a {type(source).__name__}, has {dimension}",
                remedy="pass a grid with one axis for each dimension, or leave it out",
                element=f"source {index}",
            )


def distance_to_shapes(
    shape: Shapes,
    domain: Grid | TetMesh | None = None,
    *,
    resolution: int = 128,
    spacing: ArrayLike | None = None,
    padding: float | None = None,
    band: float | None = None,
    completion: Completing = "lids",
    lids: Lids = "bent",
    nested: Nesting = "given",
    constraint: Constraint | None = None,
    diffusion: float = 1.0,
    as_oriented: bool = False,
    keep_overlaps: bool = False,
) -> Field[Grid] | Field[TetMesh]:
    """Compute the signed distance to shapes in space on a grid or on tets, with the options of `signed_distance`."""
    options = Completion(completion, lids, nested, as_oriented, keep_overlaps)
    method = Heat(checked(constraint), diffusion)
    joined = joined_shape(shape)
    if domain is None:
        domain = Grid.around(bounds_around([joined]), resolution, padding, spacing)
    return completed_distance(joined, domain, options, method, band)


def completed_distance(
    shape: Shapes,
    domain: Grid | TetMesh,
    options: Completion,
    method: Heat,
    band: float | None = None,
    **tiles: Any,
) -> Field[Grid] | Field[TetMesh]:
    """Complete a shape, and return the field of the signed distance to the solid on a grid or on tets.

    `band` and `tiles` are options of `Solid.field`, which computes it on grids.
    """
    if band is not None and not isinstance(domain, Grid):
        raise UnsupportedTypeError("a band is computed around solids, on a grid in space", remedy="leave out the band")
    with part_of_work(0.0, 0.5):
        solid = completed(shape, options, method)
    with part_of_work(0.5, 1.0):
        if isinstance(domain, Grid):
            return solid.field(grid=domain, band=band, progress=bound_progress(), **tiles)
        phi = sharpen(Field(domain, solid.distance(domain.vertices)), solid.boundary, progress=bound_progress())
    return replace(phi, diagnostics=phi.diagnostics.noting(*solid.diagnostics.notes))
