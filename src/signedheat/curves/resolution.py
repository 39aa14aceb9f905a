"""Finer triangles for curves that the triangles of a mesh do not resolve."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any, TypeVar

from ..discretization import discretize
from ..errors import CancellingNormalsError, FactorizationError, GeometryError, SourceError
from ..jobs import part_of_work
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
"""Length of a curve with all its pieces, in spacings h of the mesh, below which finer triangles are made for it."""

Surface = TypeVar("Surface", bound=SurfaceDomain)
Found = TypeVar("Found")


def on_resolving_triangles(
    measure: Callable[[SignedHeatSolver[Any]], Found],
    solver: SignedHeatSolver[Any],
    curves: CurvesAndPoints,
    always: bool = False,
) -> Found:
    """Call ``measure(solver)`` with a solver whose triangles resolve the curves, and return its result.

    That is the given solver, unless curves on a triangle mesh are small (`are_small`), their normals cancel, or
    `always` is true. Then it is one with an intrinsic triangulation made for the curves. If that fails for small
    curves, it is the given solver after all.
    """
    mesh = solver.domain
    if isinstance(mesh, TriangleMesh) and (always or are_small(solver, curves)):
        try:
            return measure(for_zero_set(mesh, solver.diffusion))
        except (GeometryError, FactorizationError):
            pass
    try:
        return measure(solver)
    except CancellingNormalsError:
        if not isinstance(mesh, TriangleMesh):
            raise
        return measure(replace(solver, intrinsic=True))


def are_small(solver: SignedHeatSolver[Any], curves: CurvesAndPoints) -> bool:
    """Whether all oriented curves together, or the pieces of one curve, are shorter than `SHORT_CURVE` spacings."""
    surface, listed = surface_of(solver), flattened(curves)
    parts = chain.from_iterable(surface.segments(listed))  # refuses curves that do not fit
    lengths = [float(part.lengths.sum()) for part in parts if part.oriented]
    short = SHORT_CURVE * surface.spacing
    if isinstance(solver.domain, TriangleMesh) and (CurveGroups.of(solver.domain, listed).lengths < short).any():
        return True
    return bool(lengths) and sum(lengths) < short


def triangulated_once(solver: SignedHeatSolver[Surface], curves: Sequence[CurveOrPoints]) -> SignedHeatSolver[Surface]:
    """Return a solver that uses the triangulation for all of the curves for any subset of them, too.

    A solver that does not make a triangulation for every set of sources is returned as it is. So is one whose triangles
    had to be divided along unoriented curves, after which other curves cannot be moved to them.
    """
    with part_of_work(0.0, 0.4):
        made = solver.discretization
        surface = made.adapt(curves)[0] if isinstance(made, Retriangulated) else None
    return solver if surface is None or surface.transfer is None else with_discretization(solver, surface)


def surface_of(solver: SignedHeatSolver[Surface]) -> SurfaceDiscretization:
    """Return the surface discretisation of the solver, or of its domain if the solver makes one for every source.

    Raises `SourceError` if the domain is no surface.
    """
    with part_of_work(0.0, 0.4):
        made = solver.discretization
    surface = made if isinstance(made, SurfaceDiscretization) else discretize(solver.domain)
    if not isinstance(surface, SurfaceDiscretization):
        kind = type(solver.domain).__name__
        raise SourceError(f"curves lie on surfaces, not on a {kind}", element="domain", remedy="pass a mesh")
    return surface


def flattened(curves: CurvesAndPoints) -> list[CurveOrPoints]:
    """Return curves and points as a flat list, without nested groups."""
    listed: list[CurveOrPoints | Sequence[CurveOrPoints]] = as_list(curves)
    return list(chain.from_iterable(c if isinstance(c, Sequence) and not isinstance(c, str) else [c] for c in listed))


def for_zero_set(mesh: TriangleMesh, diffusion: Diffusion | None) -> SignedHeatSolver[TriangleMesh]:
    """Return a solver with ``intrinsic=True`` whose triangulations suit the zero set of φ, even for tiny curves."""
    solver = SignedHeatSolver(mesh, diffusion, intrinsic=True)
    return with_discretization(solver, RetriangulatedForZeroSet(mesh))
