"""Completion of broken curves on surfaces: the zero set of the distance to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from ..arrays import Floats, Ints, mask_of
from ..constraints import Constraint, EachComponent, LevelValues
from ..discretization import discretize
from ..errors import InexactWarning, SourceError, UnsupportedTypeError, warn_user
from ..fields.field import Field
from ..mesh.components import connected_components
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..parallel import PointTree
from ..shapes.foreign import ForeignShape, as_list, converted
from ..shapes.kinds import SurfaceDomain
from ..solver import SignedHeatSolver, distance_unwarned
from ..surfaces.repaired_mesh import RepairedMesh
from ..surfaces.source_segments import as_curves, given_curves, numbers_given
from ..surfaces.surface import LinearDomain
from ..surfaces.surface_curves import Curve, CurveOrPoints, CurvesAndPoints, ElementList, SurfacePoints
from ..surfaces.surface_discretization import SurfaceDiscretization
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import flag, public_call
from .curve_distance import distance_to_pieces, warn_of_gaps
from .resolution import flattened, on_resolving_triangles
from .stroke_directions import pieces_for_all

LEAST_LOOP = 0.5
"""Least length of a loop of the zero set, and its greatest distance from the curves, both relative to the shortest
curve. Loops that are shorter or farther away are left out, since they complete nothing: φ has the wrong sign inside."""


@public_call
def close_curves(
    curves: CurvesAndPoints | ElementList | Sequence[ElementList],
    domain: SurfaceDomain | ForeignShape,
    *,
    diffusion: float = 1.0,
    constraint: Constraint | None = None,
    as_oriented: bool = False,
    every_piece: bool = False,
) -> list[Curve]:
    """Close the gaps of broken curves by the zero set of φ, the signed distance to them.

    Before, a mesh is repaired, curves are flipped so that they bound a region together, and those that bound nothing
    are left out, as by `signed_distance`. On triangle meshes the method runs on an intrinsic triangulation whose edges
    follow the curves. So curves may be smaller than the triangles, and the result coincides with them except at gaps.

    Parameters
    ----------
    curves : Curve or a sequence of them
        Oriented curves, open or closed, which may be noisy, overlap or cross, or lists of (element, barycentric
        coordinates), as for `signed_distance`. Curves without length are left out if there are others.
    domain : TriangleMesh, PolygonMesh, PointCloud or DigitalSurface
        The surface.
    diffusion : float
        Factor τ of the time ``t = τ h²`` for which normals of the curves are diffused like heat; larger values close
        gaps along rounder lines (Fig. 18). The length h is half the mean length of edges. If a curve with gaps on a
        triangle mesh has short strokes, h is smaller: half the mean length of these strokes, or half the size of the
        intrinsic triangles along the curves if that is more.
    constraint : Free, ZeroSet, EachComponent, LevelValues or Soft
        Constraint on φ at the curves. With `ZeroSet`, the default, the result passes through them. With `EachComponent`
        and `LevelValues` no curve is flipped or left out.
    as_oriented : bool
        If true, no curve is flipped or left out.
    every_piece : bool
        If true, no curve is left out.

    Returns
    -------
    list of Curve
        One curve for each connected component of the zero set, oriented as the given curves are after flipping. Each is
        closed or ends at the boundary of the surface.

    Raises
    ------
    SourceError
        If no curve is oriented, or a curve names faces that the surface does not have.

    See Also
    --------
    signed_distance : Distance on a grid, on tets or along a surface.
    piecewise_distance : Distance to curves that bound no region.
    orientation : The same, and what was flipped.
    io.write_curves : Write curves on a surface.

    Examples
    --------
    A straight line with a gap, on a flat strip of triangles.

    >>> import numpy as np, signedheat as sh
    >>> x, y = np.meshgrid(np.arange(8.0), np.arange(5.0), indexing="ij")
    >>> corner = np.arange(40).reshape(8, 5)[:-1, :-1].ravel()
    >>> faces = np.concatenate([corner[:, None] + [0, 5, 6], corner[:, None] + [0, 6, 1]])
    >>> mesh = sh.TriangleMesh(np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1), faces)
    >>> broken = [mesh.polyline([[0, 2.5, 0], [2, 2.5, 0]]), mesh.polyline([[4, 2.5, 0], [7, 2.5, 0]])]
    >>> whole = sh.close_curves(broken, mesh)
    >>> whole
    [Curve(21 points, open, oriented)]
    """
    surface = converted(domain)
    if not isinstance(surface, SurfaceDomain):
        raise UnsupportedTypeError(
            f"curves are completed on a surface, not on a {type(domain).__name__}",
            remedy="pass the curves first, then the surface",
            element="domain",
        )
    listed = as_curves(surface, as_list(curves))
    refuse_without_sides(listed)
    _, completed = completion(surface, listed, constraint, diffusion, as_oriented=as_oriented, every_piece=every_piece)
    return completed


def completion(
    domain: SurfaceDomain | ForeignShape,
    curves: CurvesAndPoints,
    constraint: Constraint | None,
    diffusion: float,
    as_oriented: bool = False,
    every_piece: bool = False,
) -> tuple[Field[SurfaceDomain], list[Curve]]:
    """Return the signed distance to broken curves, and its zero set, which completes them.

    The arguments are those of `close_curves`. Meshes are repaired first, and both results lie on the given surface.
    """
    as_oriented, every_piece = flag(as_oriented, "as_oriented"), flag(every_piece, "every_piece")
    own_levels = isinstance(constraint, EachComponent | LevelValues)
    surface = cast("SurfaceDomain", converted(domain))
    warn_of_gaps(surface)
    repaired = RepairedMesh.of(surface)
    if repaired is not None:
        surface, curves = repaired.mesh, repaired.on_it(curves)
    kept, left_out = given_curves(surface, as_list(curves))

    pieces = None if as_oriented or own_levels else pieces_for_all(surface, flattened(kept))

    def measured(solver: SignedHeatSolver[SurfaceDomain]) -> tuple[Field[SurfaceDomain], str]:
        if as_oriented or own_levels:
            return distance_unwarned(solver, curves, constraint), ""
        numbers = numbers_given(kept, left_out)
        field, _, doubt = distance_to_pieces(solver, kept, constraint, every_piece, numbers, pieces)
        return field if left_out is None else replace(field, diagnostics=field.diagnostics.noting(left_out)), doubt

    field, doubt = on_resolving_triangles(measured, SignedHeatSolver(surface, diffusion), kept, always=True)
    if doubt:
        warn_user(doubt, InexactWarning)
    completed = zero_set(field, curves)
    if repaired is None:
        return field, completed
    return repaired.on_given(field), [repaired.curve_on_given(curve) for curve in completed]


def refuse_without_sides(curves: Sequence[CurveOrPoints | Sequence[CurveOrPoints]]) -> None:
    """Raise `SourceError` if no curve is oriented: an unsigned distance has no zero set besides its sources."""
    if all(isinstance(curve, Curve | SurfacePoints) and not getattr(curve, "oriented", False) for curve in curves):
        raise SourceError(
            "curves without sides, and points, bound nothing that could be completed", remedy="orient the curves"
        )


def zero_set(field: Field[SurfaceDomain], curves: CurvesAndPoints) -> list[Curve]:
    """Return the zero set of a field as curves, without loops that `LEAST_LOOP` excludes.

    If it excludes all of them, all are returned.
    """
    if not isinstance(field.domain, TriangleMesh):
        return field.contour(0.0)
    fine = cast("Field[LinearDomain]", field.finest)  # its contours, too, are curves on the given mesh
    surface = discretize(fine.domain)
    assert isinstance(surface, SurfaceDiscretization)
    values = fine.values.copy()
    signed_along_boundary(surface.triangles, values)  # else contours may run along it, where φ only touches 0
    contour = replace(fine, values=values).contour(0.0)
    kept, _ = given_curves(field.domain, as_list(curves))
    given = [each for each in flattened(kept) if isinstance(each, Curve) and each.oriented]
    shortest = min(length(field.domain, each) for each in given)
    near = PointTree(np.concatenate([field.domain.positions(each) for each in given]))
    completing = [  # open curves end at the boundary, and are no stray loops
        curve
        for curve in contour
        if not curve.closed
        or (
            length(field.domain, curve) > LEAST_LOOP * shortest
            and near.query(field.domain.positions(curve))[0].min() < LEAST_LOOP * shortest
        )
    ]
    return completing or contour  # at least one, if all of them are small


def signed_along_boundary(triangles: IntrinsicMesh, values: Floats) -> None:
    """Replace zeros at boundary vertices by tiny values, in place, so that no contour runs along the boundary.

    `values` are φ at the vertices, (n,). A run of zeros along the boundary gets the sign that φ has on the boundary
    beyond both of its ends. If those signs differ, it gets the sign opposite to that of its neighbours.
    """
    least = 1e-7 * float(triangles.lengths_of_edges.mean())
    is_zero, edges = np.abs(values) <= least, triangles.edges.vertices
    rim = edges[triangles.edges.face_counts == 1]
    run = connected_components(len(values), *rim[is_zero[rim].all(axis=1)].T)
    in_run = mask_of(len(values), rim[is_zero[rim]])

    def neighbor_signs(edges: Ints) -> Floats:
        """Return (n,) sums of the signs of φ at the far ends of (k, 2) edges that leave each run of zeros."""
        tail, head = np.concatenate([edges, edges[:, ::-1]]).T
        leaves = in_run[tail] & ~is_zero[head]
        return np.bincount(run[tail[leaves]], np.sign(values[head[leaves]]), len(values)).astype(float)

    at_ends, all_around = neighbor_signs(rim), neighbor_signs(edges)
    has_edges = np.bincount(run[in_run], minlength=len(values)) > 1
    sign = np.where(np.abs(at_ends) > 1, np.sign(at_ends), np.where(has_edges, -np.sign(all_around), 0.0))[run]
    chosen = in_run & (sign != 0)
    values[chosen] = least * sign[chosen]


def length(mesh: TriangleMesh, curve: Curve) -> float:
    """Return the length of the polygon through a curve's points in space, in the units of the mesh."""
    points = mesh.positions(curve)
    following = np.roll(points, -1, axis=0) if curve.closed else points[1:]
    return float(np.linalg.norm(following - points[: len(following)], axis=1).sum())
