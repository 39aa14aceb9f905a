"""Distance to curves on surfaces in one call: exact where they are there, completed by heat where they are missing."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

from ..constraints import EachComponent, Free, LevelValues, Soft, ZeroSet
from ..domains.curves import CurvesAndPoints
from ..domains.kinds import AnySurface
from ..domains.triangle_mesh import TriangleMesh
from ..errors import CancellingNormalsError, ConstraintError, GeometryError
from ..fields.vertex_field import VertexField
from ..progress import Progress
from ..solver import SignedHeatSolver, distance_unwarned
from .close_curves import for_zero_set
from .curve_pieces import distance_to_pieces
from .sharpening import sharpen
from .small_curves import are_small


def curve_distance(
    domain: AnySurface,
    curves: CurvesAndPoints,
    *,
    constraint: Free | ZeroSet | Soft | None = None,
    diffusion: float = 1.0,
    intrinsic: bool | Literal["auto"] = "auto",
    as_oriented: bool = False,
    every_piece: bool = False,
    progress: Progress | None = None,
) -> VertexField[AnySurface]:
    """Signed distance to curves and points on a surface, however broken, however they cross the faces.

    Pieces of broken curves are turned until they agree (`orient`), and those are left out that neither continue others
    nor lie on what completes these. The signed heat method (`SignedHeatSolver`) tells the sides and completes what is
    missing; then distance is measured along the surface, exactly, to the curves themselves and to what completes them
    (`sharpen`).

    Parameters
    ----------
    domain : TriangleMesh, PolygonMesh, PointCloud, DigitalSurface or IntrinsicTriangulation
        The surface, with triangles of any shape.
    curves : Curve, SurfacePoints or a sequence of them
        Oriented curves have a positive side, to their left; unoriented ones and points have none.
    constraint : Free, ZeroSet or Soft, optional
        Imposed on φ at the curves by the method; `ZeroSet` by default.
    diffusion : float
        τ in ``t = τ h²``: larger values close gaps along rounder lines.
    intrinsic : "auto", True or False
        On what triangles the method runs: see `SignedHeatSolver`.
    as_oriented : bool
        Turn no curve, and leave none out.
    every_piece : bool
        Leave no curve out.
    progress : callable, optional
        Called as ``progress(fraction, step)``; an exception that it raises cancels.

    Returns
    -------
    VertexField
        φ, with a note `diagnostics.SharpenedToCurves` in its diagnostics: how much was completed. If curves were turned
        or left out, a note `CurvesTaken` says which; for those left out there is an `InexactWarning`.

    Raises
    ------
    SourceError
        If there is no source, or one does not fit the domain.
    ConstraintError
        If the constraint gives curves levels of their own: distance is then not that to all of them.

    Examples
    --------
    A square, cut in two triangles, and a line across it that is no level set of a function linear on them.

    >>> import signedheat as sh
    >>> mesh = sh.TriangleMesh([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> across = mesh.polyline([[1, 0, 0], [1, 4, 0]])
    >>> sh.curve_distance(mesh, across).values.round(6).tolist()
    [1.0, -3.0, -3.0, 1.0]
    """
    if isinstance(constraint, EachComponent | LevelValues):
        raise ConstraintError(
            f"distance to curves is zero on all of them, which {constraint!r} denies",
            remedy="use SignedHeatSolver.distance",
        )
    share = None if progress is None else (lambda done, step: progress(0.7 * done, step))
    solver = SignedHeatSolver(domain, diffusion, share, intrinsic)
    mesh = solver.domain if intrinsic == "auto" and isinstance(solver.domain, TriangleMesh) else None

    def measured(by: SignedHeatSolver[Any]) -> tuple[VertexField[AnySurface], CurvesAndPoints]:
        if as_oriented:
            return distance_unwarned(by, curves, constraint), curves
        return distance_to_pieces(by, curves, constraint, every_piece)

    try:
        small = mesh is not None and are_small(solver, curves)
        field, taken = measured(for_zero_set(mesh, diffusion, share) if mesh is not None and small else solver)
    except GeometryError:  # too thin to be triangulated anew
        field, taken = measured(solver)
    except CancellingNormalsError:  # loops inside single faces
        if mesh is None:
            raise
        field, taken = measured(replace(solver, intrinsic=True))
    rest = None if progress is None else (lambda done, step: progress(0.7 + 0.3 * done, step))
    return sharpen(field, taken, progress=rest)
