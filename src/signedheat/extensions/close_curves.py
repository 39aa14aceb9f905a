"""Completion of broken curves on surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

from ..constraints import Constraint, EachComponent, LevelValues
from ..domains.curves import Curve, CurveOrPoints, CurvesAndPoints, SurfacePoints
from ..domains.foreign import ForeignShape, converted
from ..domains.kinds import SurfaceDomain
from ..domains.triangle_mesh import TriangleMesh
from ..errors import GeometryError, SourceError
from ..fields.vertex_field import VertexField
from ..lowering.surface.intrinsic import RetriangulatedForZeroSet
from ..progress import Progress
from ..solver import SignedHeatSolver, as_list, distance_unwarned
from .curve_pieces import distance_to_pieces
from .zero_set import zero_set


def close_curves(
    domain: SurfaceDomain | ForeignShape,
    curves: CurvesAndPoints,
    *,
    diffusion: float = 1.0,
    constraint: Constraint | None = None,
    as_oriented: bool = False,
    every_piece: bool = False,
) -> list[Curve]:
    """Complete broken curves: the zero set of the signed distance to them, which has no gaps.

    On triangle meshes the method runs on an intrinsic triangulation along whose edges the curves run, so that curves
    may be smaller than the triangles, and the result follows them where they are there. Pieces are first turned until
    they agree, and those left out that belong to no other, as by `curve_distance`.

    Parameters
    ----------
    domain : TriangleMesh, PolygonMesh, PointCloud or DigitalSurface
        The surface.
    curves : Curve or a sequence of them
        Oriented curves, open or closed, noisy, overlapping, crossing.
    diffusion : float
        τ in ``t = τ h²``: larger values close gaps along rounder lines (Fig. 18). On triangle meshes h is at most half
        the length of the pieces, unless the triangles made along them are larger.
    constraint : Free, ZeroSet, EachComponent, LevelValues or Soft
        Imposed on φ at the curves; with `ZeroSet`, the default, the result passes through them. With `EachComponent`
        and `LevelValues` curves are taken as given.
    as_oriented : bool
        Turn no curve, and leave none out.
    every_piece : bool
        Leave no curve out.

    Returns
    -------
    list of Curve
        Oriented as the given curves, one for each connected component; closed, or ending at the boundary of the
        surface.

    Raises
    ------
    SourceError
        If no curve is oriented, or one does not fit the surface.

    Examples
    --------
    A straight line with a gap, on a flat strip of triangles.

    >>> import numpy as np, signedheat as sh
    >>> x, y = np.meshgrid(np.arange(8.0), np.arange(5.0), indexing="ij")
    >>> corner = np.arange(40).reshape(8, 5)[:-1, :-1].ravel()
    >>> faces = np.concatenate([corner[:, None] + [0, 5, 6], corner[:, None] + [0, 6, 1]])
    >>> mesh = sh.TriangleMesh(np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1), faces)
    >>> broken = [mesh.polyline([[0, 2.5, 0], [2, 2.5, 0]]), mesh.polyline([[5, 2.5, 0], [7, 2.5, 0]])]
    >>> whole = sh.close_curves(mesh, broken)
    >>> whole
    [Curve(30 points, open, oriented)]
    """
    listed: list[CurveOrPoints | Sequence[CurveOrPoints]] = as_list(curves)
    refuse_without_sides(listed)
    field = conforming_distance(domain, listed, constraint, diffusion, None, as_oriented, every_piece)
    return zero_set(field, listed)


def conforming_distance(
    domain: SurfaceDomain | ForeignShape,
    curves: CurvesAndPoints,
    constraint: Constraint | None,
    diffusion: float,
    progress: Progress | None = None,
    as_oriented: bool = False,
    every_piece: bool = False,
) -> VertexField:
    """Distance on triangles that have the curves along their edges, so that none is too small to be seen.

    Other domains than triangle meshes, and meshes too thin to be triangulated anew, are taken as they are.
    """
    own_levels = isinstance(constraint, EachComponent | LevelValues)

    def measured(solver: SignedHeatSolver[SurfaceDomain]) -> VertexField:
        if as_oriented or own_levels:
            return distance_unwarned(solver, curves, constraint)
        return distance_to_pieces(solver, curves, constraint, every_piece)[0]

    surface = cast("SurfaceDomain", converted(domain))
    if isinstance(surface, TriangleMesh):
        try:
            return measured(for_zero_set(surface, diffusion, progress))
        except GeometryError:
            pass
    return measured(SignedHeatSolver(surface, diffusion, progress))


def for_zero_set(
    mesh: TriangleMesh, diffusion: float, progress: Progress | None = None
) -> SignedHeatSolver[TriangleMesh]:
    """A solver with ``intrinsic=True``, and with diffusion times that suit the pieces, however small they are."""
    solver = SignedHeatSolver(mesh, diffusion, progress, intrinsic=True)
    report = None if progress is None else lambda share, _: progress((1 + share) / 5, "refine")
    solver.__dict__["discretization"] = RetriangulatedForZeroSet(mesh, report)
    return solver


def refuse_without_sides(curves: Sequence[CurveOrPoints | Sequence[CurveOrPoints]]) -> None:
    """Raise `SourceError` if no curve is oriented: an unsigned distance has no zero set besides its sources."""
    if all(isinstance(curve, Curve | SurfacePoints) and not getattr(curve, "oriented", False) for curve in curves):
        raise SourceError(
            "curves without sides, and points, bound nothing that could be completed",
            remedy="orient the curves",
        )
