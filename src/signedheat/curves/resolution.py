"""Curves that triangles do not resolve, and the triangles that are made for them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any, TypeVar

from ..discretization import discretize
from ..errors import CancellingNormalsError, GeometryError, SourceError
from ..jobs import Progress, within
from ..shapes.foreign import as_list
from ..shapes.kinds import SurfaceDomain
from ..solver import SignedHeatSolver, with_discretization
from ..surfaces.extrapolation import Diffusion
from ..surfaces.intrinsic_discretization import Retriangulated, RetriangulatedForZeroSet
from ..surfaces.source_segments import CurveGroups
from ..surfaces.surface_curves import CurveOrPoints, CurvesAndPoints
from ..surfaces.surface_discretization import SurfaceDiscretization
from ..surfaces.triangle_mesh import TriangleMesh

SHORT_CURVE = 16.0
"""Curves that are shorter than this, in h, with all of their pieces, get triangles of their own."""

Surface = TypeVar("Surface", bound=SurfaceDomain)
Found = TypeVar("Found")


def on_resolving_triangles(
    measure: Callable[[SignedHeatSolver[Any]], Found],
    solver: SignedHeatSolver[Any],
    curves: CurvesAndPoints,
    always: bool = False,
) -> Found:
    """Return what is measured on triangles that resolve the curves: those of the mesh, or smaller ones where needed."""
    mesh = solver.domain
    if isinstance(mesh, TriangleMesh) and (always or are_small(solver, curves)):
        try:
            return measure(for_zero_set(mesh, solver.diffusion, solver.progress))
        except GeometryError:
            pass
    try:
        return measure(solver)
    except CancellingNormalsError:
        if not isinstance(mesh, TriangleMesh):
            raise
        return measure(replace(solver, intrinsic=True))


def are_small(solver: SignedHeatSolver[Any], curves: CurvesAndPoints) -> bool:
    """Whether oriented curves, or the pieces of one of them, are so short that triangles do not resolve them."""
    surface, listed = surface_of(solver), flattened(curves)
    parts = chain.from_iterable(surface.segments(listed))  # refuses curves that do not fit
    lengths = [float(part.lengths.sum()) for part in parts if part.oriented]
    short = SHORT_CURVE * surface.spacing
    if isinstance(solver.domain, TriangleMesh) and (CurveGroups.of(solver.domain, listed).lengths < short).any():
        return True
    return bool(lengths) and sum(lengths) < short


def triangulated_once(solver: SignedHeatSolver[Surface], curves: Sequence[CurveOrPoints]) -> SignedHeatSolver[Surface]:
    """Return the solver with the triangles that it makes for all curves, which it then also uses for some of them."""
    made = solver.discretization
    if not isinstance(made, Retriangulated):
        return solver
    return with_discretization(solver, made.adapt(curves)[0])


def surface_of(solver: SignedHeatSolver[Surface]) -> SurfaceDiscretization:
    """Return the discretisation that the solver uses for all sources, or else that of its domain."""
    made = solver.discretization
    surface = made if isinstance(made, SurfaceDiscretization) else discretize(solver.domain)
    if not isinstance(surface, SurfaceDiscretization):
        kind = type(solver.domain).__name__
        raise SourceError(f"curves lie on surfaces, not on a {kind}", element="domain", remedy="pass a mesh")
    return surface


def flattened(curves: CurvesAndPoints) -> list[CurveOrPoints]:
    """Return the curves and points, without the groups that they were given in."""
    listed: list[CurveOrPoints | Sequence[CurveOrPoints]] = as_list(curves)
    return list(chain.from_iterable(c if isinstance(c, Sequence) and not isinstance(c, str) else [c] for c in listed))


def for_zero_set(
    mesh: TriangleMesh, diffusion: Diffusion | None, progress: Progress | None = None
) -> SignedHeatSolver[TriangleMesh]:
    """Return a solver with ``intrinsic=True`` and diffusion times that suit the pieces, however small they are."""
    solver = SignedHeatSolver(mesh, diffusion, progress, intrinsic=True)
    return with_discretization(solver, RetriangulatedForZeroSet(mesh, within(progress, 0.2, 0.4)))
